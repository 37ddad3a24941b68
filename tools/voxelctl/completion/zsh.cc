#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "tools/voxelctl/completion/values.h"

namespace voxeld::voxelctl {
namespace {

// Escapes a text within [brackets] or before a colon of a specification.
std::string Escaped(const std::string& text) {
  return absl::StrReplaceAll(text, {{"\\", "\\\\"}, {"[", "\\["}, {"]", "\\]"}, {":", "\\:"}});
}

std::string Action(const Values& values) {
  switch (values.kind) {
    case Values::Kind::kWords:
      return absl::StrCat("(", absl::StrJoin(values.words, " "), ")");
    case Values::Kind::kLive:
      // The space suppresses what _arguments would add for others.
      return absl::StrCat(" _voxelctl_live ", values.of);
    case Values::Kind::kFiles:
      return values.of.empty() ? "_files" : absl::StrCat("_files -g \"*", values.of, "\"");
    case Values::Kind::kFolders:
      return "_files -/";
    case Values::Kind::kAny:
      break;
  }
  return " ";
}

std::string OptionSpec(const std::string& command, const usage::OptionEntry& option) {
  std::string out;
  for (const std::string& name : option.names) {
    std::string spec = absl::StrCat(option.repeated ? "*" : "", name);
    if (!option.value.empty()) spec += name.size() > 2 ? "=" : "+";
    absl::StrAppend(&spec, "[", Escaped(Brief(option.about)), "]");
    if (!option.value.empty()) {
      absl::StrAppend(&spec, ":", Escaped(option.value), ":", Action(ValuesOf(command, option)));
    }
    absl::StrAppend(&out, " \\\n        ", ShellQuoted(spec));
  }
  return out;
}

std::string Specs(const usage::CommandEntry& command, const std::string& name) {
  std::string out;
  for (const usage::OptionEntry& option : command.options) out += OptionSpec(name, option);
  for (size_t i = 0; i < command.arguments.size(); ++i) {
    const usage::OptionEntry& argument = command.arguments[i];
    absl::StrAppend(&out, " \\\n        ",
                    ShellQuoted(absl::StrCat(argument.repeated ? "*" : absl::StrCat(i + 1), ":",
                                             Escaped(argument.argument), ":",
                                             Action(ValuesOf(name, argument)))));
  }
  return out;
}

}  // namespace

std::string ZshCompletion(const usage::CommandEntry& program) {
  std::string commands, cases;
  for (const usage::CommandEntry& command : program.commands) {
    absl::StrAppend(
        &commands, "    ",
        ShellQuoted(absl::StrCat(command.name, ":", Escaped(FirstSentence(command.about)))), "\n");
    absl::StrAppend(&cases, "    ", command.name, ")\n      _arguments \"${common[@]}\"",
                    Specs(command, command.name), "\n      ;;\n");
  }
  std::string common;
  for (const usage::OptionEntry& option : program.options) common += OptionSpec("", option);
  return absl::StrCat(
      R"SCRIPT(#compdef voxelctl
# zsh's completion of voxelctl, as `voxelctl completion zsh` writes it.
_voxelctl_live() { # KIND: what the server has of it
  local -a server names
  local word option
  for word in "${line_before[@]}"; do
    if [[ -n $option ]]; then
      server+=("$option" "$word")
      option=''
    else
      case $word in
        --server=*|--token-file=*|--tls-*=*) server+=("$word") ;;
        --server|--token-file|--tls-*) option=$word ;;
      esac
    fi
  done
  names=("${(@f)$("$program_called" "${server[@]}" __complete "$1" 2>/dev/null)}")
  names=("${(@)names:#}")
  (( $#names )) && compadd -a names
}

_voxelctl() {
  local -a line_before=("${words[@]}") line common commands
  local program_called=$words[1] context state state_descr
  typeset -A opt_args
  common=()SCRIPT",
      common, "\n  )\n  commands=(\n", commands,
      R"SCRIPT(  )
  _arguments -C "${common[@]}" '1:command:->command' '*::argument:->argument'
  case $state in
    command) _describe -t commands command commands; return ;;
    argument) ;;
    *) return ;;
  esac
  case $line[1] in
)SCRIPT",
      cases, R"SCRIPT(  esac
}

if [[ $funcstack[1] == _voxelctl ]]; then
  _voxelctl "$@"
else
  compdef _voxelctl voxelctl
fi
)SCRIPT");
}

}  // namespace voxeld::voxelctl
