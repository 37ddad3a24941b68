// What may stand in a place of the command line.
#pragma once

#include <string>
#include <vector>

#include "daemon/usage/command_table.h"

namespace voxeld::voxelctl {

struct Values {
  enum class Kind : uint8_t { kAny, kWords, kLive, kFiles, kFolders };
  Kind kind = Kind::kAny;
  std::vector<std::string> words;  // kWords: all of them
  std::string of;  // kLive: what __complete is asked; kFiles: ".mcap", or empty: all
};

// Of an option's value or an argument; `command` is empty for options of all commands.
Values ValuesOf(const std::string& command, const usage::OptionEntry& option);

// In single quotes for bash and zsh.
std::string ShellQuoted(const std::string& text);

// The first line of what is said about an option; the first sentence of what is said of a command.
std::string Brief(const std::string& about);
std::string FirstSentence(const std::string& about);

std::string BashCompletion(const usage::CommandEntry& program);
std::string ZshCompletion(const usage::CommandEntry& program);
std::string FishCompletion(const usage::CommandEntry& program);

}  // namespace voxeld::voxelctl
