// Runs voxelctl in this process against a server that is also in this process.
#pragma once

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "tests/tools/voxelctl/fake_server.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/commands/commands.h"

namespace voxeld::voxelctl {

struct Result {
  int code = -1;
  std::string out, err;
};

class CommandsTest : public testing::Test {
 protected:
  // Runs voxelctl with these arguments, as main would.
  Result RunTool(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"--server", server_.address()});
    return RunAnywhere(std::move(arguments));
  }

  Result RunAnywhere(const std::vector<std::string>& arguments) {
    const ParsedCommandLine parsed = ParseCommandLine(arguments);
    if (!parsed.options) return {parsed.exit_code, parsed.out, parsed.err};
    std::ostringstream out, err;
    Console console(out, err, parsed.options->json, false);
    const int code = voxelctl::Run(
        *parsed.options, [](const char*) { return std::string(); }, interrupt_, console);
    return {code, out.str(), err.str()};
  }

  // Runs it, and returns its output, which must be a single JSON document.
  nlohmann::json RunJson(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "--json");
    const Result result = RunTool(std::move(arguments));
    EXPECT_EQ(result.code, 0) << result.err;
    return nlohmann::json::parse(result.out, nullptr, false);
  }

  TempFolder folder_;
  FakeServer server_{folder_.Path("s")};
  Interrupt interrupt_{Interrupt::Watch::kNothing};
};

}  // namespace voxeld::voxelctl
