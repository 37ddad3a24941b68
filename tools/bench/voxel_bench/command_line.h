// What the command line of voxel-bench asks for.
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
  // Not empty: to be printed, and that is all.
  std::string print_and_exit;
};

// `arguments` without the program's name. InvalidArgument is a usage error.
absl::StatusOr<CommandLine> ParseCommandLine(const std::vector<std::string>& arguments);

}  // namespace voxeld::bench
