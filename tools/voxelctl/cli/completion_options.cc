#include "tools/voxelctl/cli/completion_options.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "daemon/usage/command_table.h"
#include "daemon/usage/man_page.h"
#include "tools/voxelctl/cli/argument_checks.h"
#include "tools/voxelctl/completion/completion.h"

namespace voxeld::voxelctl {
namespace {

const Choices<Shell> kShells = {
    {"bash", Shell::kBash}, {"zsh", Shell::kZsh}, {"fish", Shell::kFish}};

constexpr const char* kExitStatus =
    "0\tall went well.\n"
    "1\tit did not; standard error says why.\n"
    "2\tthe command line was not understood.\n"
    "3\tof verify: there is no device.\n"
    "130\tan interrupt (Ctrl-C) ended it before its end.";
constexpr const char* kEnvironment =
    "VOXELD_SERVER\tthe server's address, where --server does not say it.\n"
    "VOXELD_TOKEN, VOXELD_TOKEN_FILE\twho you are.\n"
    "VOXELD_TLS_CA, VOXELD_TLS_CERT, VOXELD_TLS_KEY, VOXELD_TLS_NAME\tas the options of these "
    "names.\n"
    "NO_COLOR\tnot empty: top shows no colours.";

}  // namespace

void CompletionArguments::Add(CLI::App* completion, CLI::App* complete, CLI::App* manual) {
  completion->add_option("SHELL", shell_, "Which shell's")->type_name("bash|zsh|fish");
  complete->group("");
  complete->add_option("KIND", complete_.kind, "displays, layers, owners, entities, profiles");
  complete->add_option("BEGINNING", complete_.beginning, "What has been typed of it");
  manual->group("");
  manual->add_option("DIR", manual_.folder, "Where the pages go");
}

std::string CompletionArguments::Script(const CLI::App& app) const {
  if (shell_.empty()) throw UsageError{"completion wants a SHELL: bash, zsh or fish"};
  return CompletionScript(Choose("the shell", shell_, kShells), usage::DescribeCommand(app));
}

ManualOptions CompletionArguments::ReadManual(const CLI::App& app) const {
  if (manual_.folder.empty()) throw UsageError{"__manual wants the DIR that the pages go to"};
  ManualOptions options = manual_;
  const usage::CommandEntry program = usage::DescribeCommand(app);
  usage::ManualInfo info;
  info.source = absl::StrCat("voxeld ", VOXELD_VERSION);
  info.sections = {{"EXIT STATUS", kExitStatus}, {"ENVIRONMENT", kEnvironment}};
  info.see_also = {"voxeld(8)"};
  options.pages.emplace_back(absl::StrCat(program.name, ".1"), usage::ManPage(program, info));
  info.program = program.name;
  info.sections.clear();
  info.see_also = {absl::StrCat(program.name, "(1)"), "voxeld(8)"};
  for (const usage::CommandEntry& command : program.commands) {
    options.pages.emplace_back(absl::StrCat(program.name, "-", command.name, ".1"),
                               usage::ManPage(command, info));
  }
  return options;
}

}  // namespace voxeld::voxelctl
