// What voxeld-ros's command line says.
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

// Either what to do, or what to print and the code to end with (help, version, a usage error).
struct ParsedCommandLine {
  std::optional<Options> options;
  int exit_code = 0;
  std::string out, err;
};

inline constexpr int kExitFailure = 1;
inline constexpr int kExitUsage = 2;

// `arguments` without the program's name; those that have ":=" are ROS's own, as roslaunch gives them. The master is
// --master's, else __master's, else `environment`'s (ROS_MASTER_URI), else the one of this machine.
ParsedCommandLine ParseCommandLine(const std::vector<std::string>& arguments,
                                   const client::Environment& environment);

}  // namespace voxeld::ros1
