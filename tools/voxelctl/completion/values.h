// The values that are possible in a place of the command line.
#pragma once

#include <string>
#include <vector>

#include "daemon/usage/command_table.h"

namespace voxeld::voxelctl {

struct Values {
  enum class Kind : uint8_t { kAny, kWords, kLive, kFiles, kFolders };
  Kind kind = Kind::kAny;
  std::vector<std::string> words;  // kWords: all of them
  std::string of;  // kLive: the kind for __complete; kFiles: ".mcap", or empty for all
};

// Returns the values of an option or an argument; `command` is empty for global options.
Values ValuesOf(const std::string& command, const usage::OptionEntry& option);

// Quotes text with single quotes for bash and zsh.
std::string ShellQuoted(const std::string& text);

// Return the first line of an option's help text, and the first sentence of a command's.
std::string Brief(const std::string& about);
std::string FirstSentence(const std::string& about);

std::string BashCompletion(const usage::CommandEntry& program);
std::string ZshCompletion(const usage::CommandEntry& program);
std::string FishCompletion(const usage::CommandEntry& program);

}  // namespace voxeld::voxelctl
