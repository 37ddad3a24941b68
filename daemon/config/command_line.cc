#include "daemon/config/command_line.h"

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "daemon/usage/command_table.h"
#include "daemon/usage/man_page.h"
#include "daemon/usage/usage_error.h"

namespace voxeld::daemon {
namespace {

// Converts the parser's error to a Status.
absl::Status Explain(const CLI::App& app, const CLI::ParseError& error) {
  const std::string wrong = app.remaining().empty() ? "" : app.remaining().front();
  if (!wrong.empty() && wrong.front() != '-') {
    return absl::InvalidArgumentError(
        absl::StrCat("\"", wrong, "\" is not expected; voxeld takes options only (see --help)"));
  }
  return absl::InvalidArgumentError(
      absl::StrCat(usage::ExplainError(error, {&app}), " (see --help)"));
}

std::string Manual(const CLI::App& app, const std::string& version) {
  usage::ManualInfo info;
  info.section = "8";
  info.source = absl::StrCat("voxeld ", version);
  info.sections = {
      {"FILES",
       "/etc/voxeld/voxeld.toml\tthe configuration, where the user has none; an example is in "
       "/usr/share/doc/voxeld/examples, and each field's meaning in "
       "/usr/share/doc/voxeld/configuration.md.\n"
       "$XDG_CONFIG_HOME/voxeld/voxeld.toml\tthe user's own.\n"
       "/usr/share/voxeld/profiles\tdescriptions of displays."},
      {"SIGNALS",
       "SIGTERM, SIGINT\tend it, clients told.\n"
       "SIGHUP\thas it read its configuration, grants and certificates again."},
      {"EXIT STATUS",
       "0\tit ended as it was told to.\n"
       "1\tit could not begin or go on; its log says why.\n"
       "2\tthe command line or the configuration was not understood."}};
  info.see_also = {"voxelctl(1)"};
  return usage::ManPage(usage::DescribeCommand(app), info);
}

}  // namespace

absl::StatusOr<CommandLine> ParseCommandLine(int argc, const char* const* argv,
                                             const std::string& version) {
  CommandLine out;
  CLI::App app("Volumetric display driver: takes 3D primitives over gRPC, shows them on displays.",
               "voxeld");
  app.footer(
      "ADDR is HOST:PORT, tls:HOST:PORT or unix:PATH. Without --config the first of "
      "$XDG_CONFIG_HOME/voxeld/"
      "voxeld.toml\n(~/.config), /etc/voxeld/voxeld.toml is read. --listen and --display replace "
      "the defaults and the file's.\nOf every display are profile, view, view_box, gpus (such as "
      "gpus=0;1: the slices shared out over these GPUs), genlock, power_limit and power_full.");
  app.add_option("--config", out.config, "Configuration file (TOML)")->type_name("FILE");
  app.add_option("--listen", out.listen, "Where to serve gRPC; may be repeated")
      ->type_name("ADDR")
      ->expected(1)
      ->take_all();
  app.add_option("--http", out.http, "Where to serve /healthz and /metrics, or off")
      ->type_name("ADDR|off");
  app.add_option("--display", out.displays, "A display and its options; may be repeated")
      ->type_name("NAME=DRIVER[,KEY=VALUE...]")
      ->expected(1)
      ->take_all();
  app.add_option("--engine", out.engine, "Volume engine")->type_name("auto|cpu|cuda");
  app.add_option("--state-dir", out.state_dir,
                 "Where layers that clients keep, and their owners, outlive the daemon")
      ->type_name("DIR");
  app.add_option("--log-level", out.log_level, "How much is logged")
      ->type_name("trace|debug|info|warn|error|off");
  app.add_option("--log-format", out.log_format, "How it is logged")->type_name("text|json");
  app.add_flag("--check-config", out.check_config,
               "Print the configuration in force, or what is wrong with it, and exit");
  bool manual = false;
  app.add_flag("--help-man", manual)->group("");
  app.set_version_flag("--version", "voxeld " + version, "Print the version and exit");

  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    out.print_and_exit = app.help();
  } catch (const CLI::CallForVersion& call) {
    out.print_and_exit = absl::StrCat(call.what(), "\n");
  } catch (const CLI::ParseError& error) {
    return Explain(app, error);
  }
  if (manual) out.print_and_exit = Manual(app, version);
  return out;
}

}  // namespace voxeld::daemon
