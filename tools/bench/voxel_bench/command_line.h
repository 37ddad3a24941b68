// The command line of voxel-bench.
#pragma once

#include <string>
#include <variant>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/bench/voxel_bench/run.h"

namespace voxeld::bench {

struct SinkOptions {
  std::vector<std::string> listen;
};

struct CommandLine {
  bool json = false;
  std::string daemon;
  std::variant<IngestOptions, LatencyOptions, FairnessOptions, BesideOptions, OverloadOptions,
               IdleOptions, PaperOptions, FrameOptions, SinkOptions>
      command;
  // If not empty, the program prints it and exits.
  std::string print_and_exit;
};

// `arguments` excludes the program's name. Errors: InvalidArgument for a usage error.
absl::StatusOr<CommandLine> ParseCommandLine(const std::vector<std::string>& arguments);

}  // namespace voxeld::bench
