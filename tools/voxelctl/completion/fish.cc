#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "tools/voxelctl/completion/values.h"

namespace voxeld::voxelctl {
namespace {

std::string Quoted(const std::string& text) {
  return absl::StrCat("'", absl::StrReplaceAll(text, {{"\\", "\\\\"}, {"'", "\\'"}}), "'");
}

// Returns the completions of a place; -f and -F say whether files are offered.
std::string Offer(const Values& values) {
  switch (values.kind) {
    case Values::Kind::kWords:
      return absl::StrCat(" -f -a ", Quoted(absl::StrJoin(values.words, " ")));
    case Values::Kind::kLive:
      return absl::StrCat(" -f -a '(__voxelctl_live ", values.of, ")'");
    case Values::Kind::kFiles:
      return values.of.empty() ? " -F"
                               : absl::StrCat(" -f -a '(__fish_complete_suffix ", values.of, ")'");
    case Values::Kind::kFolders:
      return " -f -a '(__fish_complete_directories)'";
    case Values::Kind::kAny:
      break;
  }
  return " -f";
}

std::string OptionLine(const std::string& condition, const std::string& command,
                       const usage::OptionEntry& option) {
  std::string out = absl::StrCat("complete -c voxelctl", condition);
  for (const std::string& name : option.names) {
    absl::StrAppend(&out, absl::StartsWith(name, "--") ? " -l " : " -s ",
                    name.substr(name.find_first_not_of('-')));
  }
  if (!option.value.empty()) absl::StrAppend(&out, " -r", Offer(ValuesOf(command, option)));
  absl::StrAppend(&out, " -d ", Quoted(Brief(option.about)), "\n");
  return out;
}

}  // namespace

std::string FishCompletion(const usage::CommandEntry& program) {
  std::string out =
      R"SCRIPT(# fish's completion of voxelctl, as `voxelctl completion fish` writes it.
function __voxelctl_live # KIND: what the server has of it
    set -l words (commandline -opc)
    set -l server
    set -l option
    for word in $words[2..-1]
        if test -n "$option"
            set -a server $option $word
            set option
        else
            switch $word
                case '--server=*' '--token-file=*' '--tls-*=*'
                    set -a server $word
                case --server --token-file '--tls-*'
                    set option $word
            end
        end
    end
    $words[1] $server __complete $argv[1] 2>/dev/null
end

complete -c voxelctl -f
)SCRIPT";
  for (const usage::OptionEntry& option : program.options) out += OptionLine("", "", option);
  for (const usage::CommandEntry& command : program.commands) {
    absl::StrAppend(&out, "complete -c voxelctl -n __fish_use_subcommand -a ", command.name, " -d ",
                    Quoted(FirstSentence(command.about)), "\n");
    const std::string condition =
        absl::StrCat(" -n '__fish_seen_subcommand_from ", command.name, "'");
    for (const usage::OptionEntry& option : command.options)
      out += OptionLine(condition, command.name, option);
    for (const usage::OptionEntry& argument : command.arguments) {
      absl::StrAppend(&out, "complete -c voxelctl", condition,
                      Offer(ValuesOf(command.name, argument)), "\n");
    }
  }
  return out;
}

}  // namespace voxeld::voxelctl
