#include "tests/e2e/voxeld_process.h"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/programs.h"

namespace voxeld::e2e {

Folder::Folder() : path_((std::filesystem::temp_directory_path() / "voxeld-e2e-XXXXXX").string()) {
  EXPECT_NE(mkdtemp(path_.data()), nullptr);
}

Folder::~Folder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::string Folder::File(const std::string& name, const std::string& text) const {
  std::string path = std::string(path_).append("/").append(name);
  std::ofstream(path) << text;
  return path;
}

std::map<std::string, std::string> CleanEnvironment(const Folder& folder) {
  return child::CleanEnvironment(folder.path());
}

std::string VoxeldBinary() { return ProgramBeside("voxeld"); }

std::vector<std::string> Voxeld(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), VoxeldBinary());
  return arguments;
}

Daemon::Daemon(const std::vector<std::string>& more)
    : unix_target_(std::string("unix:").append(folder_.path()).append("/voxeld.sock")) {
  std::vector<std::string> arguments = Voxeld(
      {"--listen", unix_target_, "--listen", "127.0.0.1:0", "--http", "127.0.0.1:0", "--display",
       "sim=simulated,size=16x16x8,rate=100", "--engine", "cpu", "--log-format", "json"});
  arguments.insert(arguments.end(), more.begin(), more.end());
  process_ = std::make_unique<Process>(arguments, CleanEnvironment(folder_));
  const std::optional<std::string> ready = process_->ReadLineWith("\"event\":\"ready\"");
  EXPECT_TRUE(ready.has_value()) << process_->output();
  if (!ready.has_value()) return;
  const auto line = nlohmann::json::parse(*ready);
  const std::string listen = line["listen"];
  tcp_target_ = listen.substr(listen.find(' ') + 1);
  http_ = line["http"];
}

}  // namespace voxeld::e2e
