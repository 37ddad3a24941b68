// Describes a program's command line as plain data, for manual pages and shell completion.
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}  // namespace CLI

namespace voxeld::usage {

struct OptionEntry {
  std::vector<std::string> names;    // "--fps"; short names first; empty: a positional argument
  std::string argument;              // name of a positional argument: "FILE"
  std::string value;                 // "N", "auto|x|y|z"; empty: takes no value
  std::vector<std::string> choices;  // allowed values, if these are a few words
  std::string about;
  std::string fallback;   // default value, if the program documents one
  bool repeated = false;  // may be repeated, or takes several values
};

struct CommandEntry {
  std::string name;   // "voxelctl"; for one of its commands "play"
  std::string about;  // lines; those that begin with two spaces are examples
  std::string footer;
  std::vector<OptionEntry> arguments;  // positional, in their order
  std::vector<OptionEntry> options;
  std::vector<CommandEntry> commands;
};

// Returns: everything that is not hidden (CLI11's group ""), in the order of declaration.
CommandEntry DescribeCommand(const CLI::App& app);

}  // namespace voxeld::usage
