// Manual pages from what a command line has.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "daemon/usage/command_table.h"

namespace voxeld::usage {

struct ManualInfo {
  std::string section = "1";
  std::string source;   // "voxeld 0.1.0"
  std::string program;  // whose command it is; empty: it is a program itself
  // Headings with paragraphs of plain text, behind the options: {"EXIT STATUS", "0 …"}. A line "WORD<tab>text" is an
  // entry of a list.
  std::vector<std::pair<std::string, std::string>> sections;
  std::vector<std::string> see_also;  // "voxeld(8)"
};

// In man(7)'s macros and ASCII. Its date is SOURCE_DATE_EPOCH's where that is set, else today.
std::string ManPage(const CommandEntry& command, const ManualInfo& info);

}  // namespace voxeld::usage
