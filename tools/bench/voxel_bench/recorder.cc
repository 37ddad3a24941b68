#include "tools/bench/voxel_bench/recorder.h"

#include <signal.h>

#include <optional>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "tools/child/programs.h"

namespace voxeld::bench {

absl::StatusOr<std::unique_ptr<Recorder>> Recorder::Start(const std::string& address) {
  absl::StatusOr<child::TemporaryFolder> folder = child::TemporaryFolder::Make("voxel-bench");
  if (!folder.ok()) return folder.status();
  std::unique_ptr<Recorder> recorder(new Recorder(*std::move(folder)));
  const std::string& path = recorder->folder_.path();
  absl::StatusOr<std::unique_ptr<child::ChildProcess>> process = child::ChildProcess::Start(
      {child::ProgramBeside("voxelctl"), "--server", address, "--json", "record",
       absl::StrCat(path, "/scene.mcap")},
      {.environment = child::CleanEnvironment(path), .errors = child::Errors::kApart});
  if (!process.ok()) return process.status();
  recorder->process_ = *std::move(process);
  return recorder;
}

absl::StatusOr<nlohmann::json> Recorder::Stop() {
  process_->Signal(SIGINT);
  const std::optional<int> code = process_->Wait();
  nlohmann::json said = nlohmann::json::parse(process_->output(), nullptr, false);
  if (code != 0 || !said.is_object() || said.value("change_sets", 0) == 0) {
    return absl::UnavailableError(absl::StrCat("voxelctl recorded nothing; it said:\n",
                                               process_->output(), process_->errors()));
  }
  said.erase("file");
  return said;
}

}  // namespace voxeld::bench
