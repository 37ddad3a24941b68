// Generates manual pages from a description of a command line.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "daemon/usage/command_table.h"

namespace voxeld::usage {

struct ManualInfo {
  std::string section = "1";
  std::string source;   // "voxeld 0.1.0"
  std::string program;  // program of a command; empty: it is a program itself
  // Sections after the options, as headings with paragraphs of plain text: {"EXIT STATUS", "0 …"}.
  // A line "WORD<tab>text" is a list entry.
  std::vector<std::pair<std::string, std::string>> sections;
  std::vector<std::string> see_also;  // "voxeld(8)"
};

// Returns: a page in ASCII with man(7) macros. Its date is SOURCE_DATE_EPOCH if that is set, else
// today.
std::string ManPage(const CommandEntry& command, const ManualInfo& info);

}  // namespace voxeld::usage
