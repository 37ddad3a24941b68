#include "daemon/usage/command_table.h"

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace voxeld::usage {
namespace {

bool IsWord(absl::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](unsigned char c) {
    return absl::ascii_islower(c) || absl::ascii_isdigit(c) || c == '-' || c == '_';
  });
}

OptionEntry Describe(const CLI::Option& option) {
  OptionEntry entry;
  for (const std::string& name : option.get_snames())
    entry.names.push_back(absl::StrCat("-", name));
  for (const std::string& name : option.get_lnames())
    entry.names.push_back(absl::StrCat("--", name));
  if (entry.names.empty()) entry.argument = option.get_name(true);
  // A flag expects no value, and CLI11 names an unnamed value by its type.
  if (option.get_items_expected_max() > 0) entry.value = option.get_type_name();
  if (option.get_positional() && !absl::StrContains(entry.value, '|')) entry.value.clear();
  if (absl::StrContains(entry.value, '|')) {
    for (const absl::string_view part : absl::StrSplit(entry.value, '|')) {
      if (IsWord(part)) entry.choices.emplace_back(part);
    }
  }
  entry.about = option.get_description();
  entry.fallback = option.get_default_str();
  entry.repeated = option.get_items_expected_max() > 1 ||
                   option.get_multi_option_policy() == CLI::MultiOptionPolicy::TakeAll;
  return entry;
}

}  // namespace

CommandEntry DescribeCommand(const CLI::App& app) {
  CommandEntry entry;
  entry.name = app.get_name();
  entry.about = app.get_description();
  entry.footer = app.get_footer();
  for (const CLI::Option* option : app.get_options()) {
    // Each command repeats the program's help option.
    const bool again = app.get_parent() != nullptr && option == app.get_help_ptr();
    if (option->get_group().empty() || again) continue;
    (option->get_positional() ? entry.arguments : entry.options).push_back(Describe(*option));
  }
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (!command->get_group().empty()) entry.commands.push_back(DescribeCommand(*command));
  }
  return entry;
}

}  // namespace voxeld::usage
