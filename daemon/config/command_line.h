// Parses voxeld's command line. LoadConfig and ApplyCommandLine interpret the values.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace voxeld::daemon {

struct CommandLine {
  std::optional<std::string> config;  // --config FILE
  std::vector<std::string> listen;    // --listen ADDR…
  std::optional<std::string> http;    // --http ADDR|off
  std::vector<std::string> displays;  // --display NAME=DRIVER[,k=v…]…
  std::optional<std::string> engine;  // --engine auto|cpu|cuda
  std::optional<std::string> log_level;
  std::optional<std::string> log_format;
  std::optional<std::string> state_dir;  // --state-dir DIR
  bool check_config = false;
  std::string print_and_exit;  // if not empty, the text to print for --help or --version
};

// Errors: InvalidArgument for a usage error, with the remedy. --help-man, which the build uses,
// returns the manual page.
absl::StatusOr<CommandLine> ParseCommandLine(int argc, const char* const* argv,
                                             const std::string& version);

}  // namespace voxeld::daemon
