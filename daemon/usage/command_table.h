// What a program's command line has, as plain data: for its manual pages and for shells that complete it.
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}  // namespace CLI

namespace voxeld::usage {

struct OptionEntry {
  std::vector<std::string> names;    // "--fps"; short ones first; empty: an argument by its place
  std::string argument;              // of one by its place, its name: "FILE"
  std::string value;                 // "N", "auto|x|y|z"; empty: it takes none
  std::vector<std::string> choices;  // what the value may be, where it is one of a few words
  std::string about;
  std::string fallback;   // what holds without it, where the program says so
  bool repeated = false;  // may be given again, or takes several
};

struct CommandEntry {
  std::string name;   // "voxelctl"; of a command of it "play"
  std::string about;  // lines; those that begin with two spaces are examples
  std::string footer;
  std::vector<OptionEntry> arguments;  // in their order
  std::vector<OptionEntry> options;
  std::vector<CommandEntry> commands;
};

// All of it that is not hidden (CLI11's group ""), in the order in which it was declared.
CommandEntry DescribeCommand(const CLI::App& app);

}  // namespace voxeld::usage
