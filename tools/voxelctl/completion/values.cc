#include "tools/voxelctl/completion/values.h"

#include <algorithm>

#include "absl/algorithm/container.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "tools/voxelctl/completion/completion.h"

namespace voxeld::voxelctl {

Values ValuesOf(const std::string& command, const usage::OptionEntry& option) {
  if (!option.choices.empty()) return {Values::Kind::kWords, option.choices, ""};
  const auto is = [&](const char* name) { return absl::c_linear_search(option.names, name); };
  if (is("--display")) return {Values::Kind::kLive, {}, "displays"};
  if (is("--layer")) return {Values::Kind::kLive, {}, "layers"};
  if (is("--owner")) return {Values::Kind::kLive, {}, "owners"};
  const std::string& name = option.names.empty() ? option.argument : option.value;
  if (command == "why" && name == "ID") return {Values::Kind::kLive, {}, "entities"};
  if (command == "profile" && name == "PROFILE") return {Values::Kind::kLive, {}, "profiles"};
  if (name == "DIR") return {Values::Kind::kFolders, {}, ""};
  if (absl::StartsWith(name, "FILE") || absl::StartsWith(name, "OUT")) {
    const size_t dot = name.find('.');
    return {Values::Kind::kFiles, {}, dot == std::string::npos ? "" : name.substr(dot)};
  }
  return {};
}

std::string ShellQuoted(const std::string& text) {
  return absl::StrCat("'", absl::StrReplaceAll(text, {{"'", "'\\''"}}), "'");
}

std::string Brief(const std::string& about) {
  return about.substr(0, std::min(about.find('\n'), about.size()));
}

std::string FirstSentence(const std::string& about) {
  std::string first = Brief(about);
  for (const char* end : {". ", ": ", "; "}) first = first.substr(0, first.find(end));
  return first;
}

std::string CompletionScript(Shell shell, const usage::CommandEntry& program) {
  switch (shell) {
    case Shell::kBash:
      return BashCompletion(program);
    case Shell::kZsh:
      return ZshCompletion(program);
    case Shell::kFish:
      break;
  }
  return FishCompletion(program);
}

}  // namespace voxeld::voxelctl
