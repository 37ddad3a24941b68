// voxeld-ros: shows markers of ROS 1 in a voxeld.
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <exception>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/usage/standard_output.h"
#include "tools/ros/options.h"
#include "tools/ros/ros_feed.h"
#include "tools/voxelctl/cli/server_options.h"
#include "tools/voxelctl/commands/console.h"
#include "tools/voxelctl/connection/address.h"
#include "tools/voxelctl/connection/connection.h"
#include "tools/voxelctl/feed/show_feed.h"
#include "tools/voxelctl/process/interrupt.h"

namespace voxeld::ros1 {
namespace {

std::string EnvironmentVariable(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

absl::Status Show(const Options& options, RosFeed& feed, voxelctl::Interrupt& interrupt,
                  voxelctl::Console& console) {
  absl::StatusOr<std::unique_ptr<voxelctl::Connection>> connection = voxelctl::Connection::Connect(
      voxelctl::ChooseServer(options.server, EnvironmentVariable),
      voxelctl::ChooseCredentials(options.credentials, EnvironmentVariable), interrupt);
  if (!connection.ok()) return connection.status();
  return voxelctl::ShowFeed({.source = options.ros.master,
                             .channel = "topic",
                             .layer = options.layer,
                             .client_name = "voxeld-ros",
                             .reconnect = false},
                            feed, **connection, interrupt, console);
}

int Run(const Options& options, voxelctl::Interrupt& interrupt, voxelctl::Console& console) {
  const auto say = [&](const absl::Status& status) {
    console.Say(absl::StrCat("voxeld-ros: ", status.message()));
  };
  const absl::StatusOr<std::string> target =
      voxelctl::ServerTarget(voxelctl::ChooseServer(options.server, EnvironmentVariable));
  if (!target.ok()) {
    say(target.status());
    return kExitUsage;
  }
  const absl::StatusOr<std::unique_ptr<RosFeed>> feed =
      RosFeed::Open(options.ros, [&interrupt] { interrupt.Request(); });
  if (!feed.ok()) {
    say(voxelctl::Escaped(feed.status()));
    return kExitUsage;
  }
  const absl::Status status = Show(options, **feed, interrupt, console);
  const bool interrupted = absl::IsCancelled(status) && interrupt.requested();
  if (!status.ok() && !interrupted) say(status);
  const int code = status.ok() || interrupted ? 0 : kExitFailure;
  if (!(*feed)->Close()) {
    console.Say("voxeld-ros: the ROS master is silent; it was left without a word");
    std::_Exit(code);
  }
  return code;
}

}  // namespace
}  // namespace voxeld::ros1

int main(int argc, char** argv) {
  using namespace voxeld;  // NOLINT(google-build-using-namespace)
  try {
    // A closed reader becomes an error of the write and does not terminate the process.
    std::signal(SIGPIPE, SIG_IGN);
    const ros1::ParsedCommandLine parsed = ros1::ParseCommandLine(
        std::vector<std::string>(argv + 1, argv + argc), ros1::EnvironmentVariable);
    std::cout << parsed.out << std::flush;
    std::cerr << parsed.err;
    if (!parsed.options) return usage::CheckedExit("voxeld-ros", parsed.exit_code);
    voxelctl::Interrupt interrupt(voxelctl::Interrupt::Watch::kSignals);
    voxelctl::Console console(std::cout, std::cerr, parsed.options->json,
                              ::isatty(STDERR_FILENO) == 1);
    return usage::CheckedExit("voxeld-ros", ros1::Run(*parsed.options, interrupt, console));
  } catch (const std::exception& error) {
    std::cerr << "voxeld-ros: " << error.what() << "\n";
    return ros1::kExitFailure;
  }
}
