#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "tools/voxelctl/completion/values.h"

namespace voxeld::voxelctl {
namespace {

// Returns what the script's functions print for a place: a line that _voxelctl understands.
std::string Answer(const Values& values) {
  switch (values.kind) {
    case Values::Kind::kWords:
      return absl::StrCat("words ", absl::StrJoin(values.words, " "));
    case Values::Kind::kLive:
      return absl::StrCat("live ", values.of);
    case Values::Kind::kFiles:
      return absl::StrCat("files ", values.of);
    case Values::Kind::kFolders:
      return "folders";
    case Values::Kind::kAny:
      break;
  }
  return "any";
}

std::string Names(const std::vector<usage::OptionEntry>& options) {
  std::string out;
  for (const usage::OptionEntry& option : options) {
    if (!option.names.empty()) absl::StrAppend(&out, " ", option.names.back());
  }
  return out;
}

std::string ValueCases(const std::string& command, const std::vector<usage::OptionEntry>& options) {
  std::string out;
  for (const usage::OptionEntry& option : options) {
    if (option.value.empty()) continue;
    for (const std::string& name : option.names) {
      const std::string pattern = command.empty() ? absl::StrCat("*", ShellQuoted(" " + name))
                                                  : ShellQuoted(absl::StrCat(command, " ", name));
      absl::StrAppend(&out, "    ", pattern, ") echo ",
                      ShellQuoted(Answer(ValuesOf(command, option))), " ;;\n");
    }
  }
  return out;
}

// Returns the cases for positional arguments, counted from 0; if the last one repeats, it covers
// all later places.
std::string PlaceCases(const usage::CommandEntry& command) {
  std::string out;
  for (size_t i = 0; i < command.arguments.size(); ++i) {
    const usage::OptionEntry& argument = command.arguments[i];
    absl::StrAppend(&out, "    ",
                    argument.repeated ? absl::StrCat(ShellQuoted(command.name + " "), "*")
                                      : ShellQuoted(absl::StrCat(command.name, " ", i)),
                    ") echo ", ShellQuoted(Answer(ValuesOf(command.name, argument))), " ;;\n");
  }
  return out;
}

constexpr const char* kComplete = R"SCRIPT(
_voxelctl() {
  local IFS=$' \t\n'
  COMPREPLY=()
  # COMP_WORDS are cut at colons and equals signs too, which addresses have.
  local -a line=() server=() names=()
  read -ra line <<<"${COMP_LINE:0:COMP_POINT}"
  local current=''
  if [[ ${COMP_LINE:0:COMP_POINT} != *[[:space:]] ]]; then
    current=${line[${#line[@]}-1]}
    unset "line[${#line[@]}-1]"
  fi
  local command='' option='' word place=0 plain=0
  for word in "${line[@]:1}"; do
    if [[ -n $option ]]; then
      case $option in --server | --token-file | --tls-*) server+=("$option" "$word") ;; esac
      option=''
    elif [[ $plain == 0 && $word == -- ]]; then
      plain=1
    elif [[ $plain == 0 && $word == --*=* ]]; then
      case $word in --server=* | --token-file=* | --tls-*=*) server+=("$word") ;; esac
    elif [[ $plain == 0 && $word == -* ]]; then
      [[ -z $(_voxelctl_value "$command" "$word") ]] || option=$word
    elif [[ -z $command ]]; then
      command=$word
    else
      place=$((place + 1))
    fi
  done

  local typed=$current before='' kind=''
  if [[ -n $option ]]; then
    kind=$(_voxelctl_value "$command" "$option")
  elif [[ $plain == 0 && $current == --*=* ]]; then
    before=${current%%=*}=
    typed=${current#*=}
    kind=$(_voxelctl_value "$command" "${before%=}")
  elif [[ $plain == 0 && $current == -* ]]; then
    kind="words $(_voxelctl_options "$command")"
  elif [[ -z $command ]]; then
    kind="words $(_voxelctl_commands)"
  else
    kind=$(_voxelctl_place "$command" "$place")
  fi

  local name
  case $kind in
    words*) read -ra names <<<"${kind#words}" ;;
    live*) mapfile -t names < <("${1:-voxelctl}" "${server[@]}" __complete "${kind#live }" "$typed" 2>/dev/null) ;;
    folders)
      compopt -o filenames 2>/dev/null
      mapfile -t COMPREPLY < <(compgen -P "$before" -d -- "$typed")
      ;;
    files*)
      compopt -o filenames 2>/dev/null
      while IFS= read -r name; do
        if [[ -d $name || $name == *"${kind#files }" ]]; then COMPREPLY+=("$before$name"); fi
      done < <(compgen -f -- "$typed")
      ;;
  esac
  # Names that others chose are quoted: one that is completed runs nothing.
  for name in "${names[@]}"; do
    if [[ $name == "$typed"* ]]; then COMPREPLY+=("$(printf %q "$before$name")"); fi
  done
  # What readline puts in place begins behind the last of these.
  if [[ $current == *[:=]* ]]; then
    local i cut=${current%"${current##*[:=]}"}
    for i in "${!COMPREPLY[@]}"; do COMPREPLY[i]=${COMPREPLY[i]#"$cut"}; done
  fi
}
complete -F _voxelctl voxelctl
)SCRIPT";

}  // namespace

std::string BashCompletion(const usage::CommandEntry& program) {
  std::string commands, options, values = ValueCases("", program.options), places;
  for (const usage::CommandEntry& command : program.commands) {
    absl::StrAppend(&commands, " ", command.name);
    absl::StrAppend(&options, "    ", command.name, ") echo", Names(command.options),
                    Names(program.options), " ;;\n");
    absl::StrAppend(&values, ValueCases(command.name, command.options));
    absl::StrAppend(&places, PlaceCases(command));
  }
  return absl::StrCat(
      "# bash's completion of voxelctl, as `voxelctl completion bash` writes it.\n"
      "_voxelctl_commands() {\n  echo",
      commands, "\n}\n_voxelctl_options() { # COMMAND\n  case $1 in\n", options, "    *) echo",
      Names(program.options),
      " ;;\n  esac\n}\n"
      "_voxelctl_value() { # COMMAND OPTION: what its value is; nothing where it takes none\n"
      "  case \"$1 $2\" in\n",
      values,
      "  esac\n}\n_voxelctl_place() { # COMMAND NUMBER: of an argument, from 0\n"
      "  case \"$1 $2\" in\n",
      places, "  esac\n}\n", kComplete);
}

}  // namespace voxeld::voxelctl
