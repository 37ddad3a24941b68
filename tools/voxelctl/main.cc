// voxelctl: command-line client of voxeld.
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <exception>
#include <iostream>
#include <string>
#include <vector>

#include "common/text/printable.h"
#include "daemon/usage/standard_output.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/commands/console.h"
#include "tools/voxelctl/connection/quiet_grpc.h"
#include "tools/voxelctl/process/interrupt.h"

namespace {

std::string EnvironmentVariable(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace voxeld::voxelctl;  // NOLINT(google-build-using-namespace)
  try {
    // A closed reader becomes an error of the write and does not terminate the process.
    std::signal(SIGPIPE, SIG_IGN);
    QuietGrpc();
    const ParsedCommandLine parsed =
        ParseCommandLine(std::vector<std::string>(argv + 1, argv + argc));
    std::cout << parsed.out << std::flush;
    std::cerr << voxeld::EscapeLines(parsed.err);
    if (!parsed.options) return voxeld::usage::CheckedExit("voxelctl", parsed.exit_code);
    Interrupt interrupt(Interrupt::Watch::kSignals);
    Console console(std::cout, std::cerr, parsed.options->json, ::isatty(STDERR_FILENO) == 1);
    return voxeld::usage::CheckedExit(
        "voxelctl", Run(*parsed.options, EnvironmentVariable, interrupt, console));
  } catch (const std::exception& error) {
    std::cerr << "voxelctl: " << voxeld::EscapeLines(error.what()) << "\n";
    return kExitFailure;
  }
}
