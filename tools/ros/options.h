// The command line of voxeld-ros.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tools/ros/ros_feed.h"
#include "voxeld/credentials.h"

namespace voxeld::ros1 {

struct Options {
  std::string server;               // empty: see voxelctl::ChooseServer
  client::Credentials credentials;  // as given; see voxelctl::ChooseCredentials
  bool json = false;
  std::string layer = "markers";
  RosOptions ros;
};

// Either the options, or a text to print with the exit code (help, version, a usage error).
struct ParsedCommandLine {
  std::optional<Options> options;
  int exit_code = 0;
  std::string out, err;
};

inline constexpr int kExitFailure = 1;
inline constexpr int kExitUsage = 2;

// `arguments` excludes the program's name; those with ":=" are ROS's own, as roslaunch passes them.
// The master is that of --master, or else of __master, or else of `environment` (ROS_MASTER_URI),
// or else the one on this machine.
ParsedCommandLine ParseCommandLine(const std::vector<std::string>& arguments,
                                   const client::Environment& environment);

}  // namespace voxeld::ros1
