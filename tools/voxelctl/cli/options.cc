#include "tools/voxelctl/cli/options.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "absl/algorithm/container.h"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/text/printable.h"
#include "common/text/suggest.h"
#include "daemon/usage/usage_error.h"
#include "tools/voxelctl/cli/about.h"
#include "tools/voxelctl/cli/argument_checks.h"
#include "tools/voxelctl/cli/completion_options.h"
#include "tools/voxelctl/cli/demo_options.h"
#include "tools/voxelctl/cli/light_options.h"
#include "tools/voxelctl/cli/patterns.h"
#include "tools/voxelctl/cli/picture_options.h"
#include "tools/voxelctl/cli/play_options.h"
#include "tools/voxelctl/cli/server_options.h"
#include "tools/voxelctl/cli/service_options.h"

namespace voxeld::voxelctl {
namespace {

// The declaration of the command line, and the values that it fills in.
class Parser {
 public:
  Parser() : app_(kAbout, "voxelctl") {
    app_.set_version_flag("--version", absl::StrCat("voxelctl ", VOXELD_VERSION),
                          "Print the version and end");
    app_.option_defaults()->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
    AddServerOptions(app_, &options_.server, &options_.credentials);
    app_.add_flag("--json", options_.json,
                  "Write data as one JSON document (a line each with stats --watch and watch)");
    app_.require_subcommand(0, 1);
    app_.fallthrough();
    app_.allow_extras();
    play_texts_.Add(Add("play", kPlayAbout));
    AddDemoOptions(Add("demo", kDemoAbout), &demo_);
    AddDraw();
    snapshot_texts_.Add(Add("snapshot", kSnapshotAbout));
    render_texts_.Add(Add("render", kRenderAbout));
    export_texts_.Add(Add("export", kExportAbout));
    AddGalleryOptions(Add("gallery", kGalleryAbout), &gallery_);
    Add("displays", "Lists the displays, their geometry and state");
    AddStats();
    AddTopOptions(Add("top", kTopAbout), &top_);
    AddEntities();
    AddWhyOptions(Add("why", kWhyAbout), &why_);
    AddWatch();
    AddClear();
    AddPattern();
    AddSet();
    AddCalibrate();
    AddVerifyOptions(Add("verify", kVerifyAbout), &verify_);
    AddProfile();
    Add("init", kInitAbout)->add_option("FILE.toml", init_.file, "Where the profile goes");
    AddTokenOptions(Add("token", kTokenAbout), &token_);
    AddRecordOptions(Add("record", kRecordAbout), &record_);
    AddReplayOptions(Add("replay", kReplayAbout), &replay_);
    AddPlaylistOptions(Add("playlist", kPlaylistAbout), &playlist_);
    AddMarkersOptions(Add("markers", kMarkersAbout), &markers_);
    Add("assets", kAssetsAbout)->add_option("FILE", assets_.files, "What to bring to the server");
    input_texts_.Add(Add("input", kInputAbout));
    pipe_texts_.Add(Add("pipe", kPipeAbout));
    Add("doctor", kDoctorAbout);
    completion_texts_.Add(Add("completion", kCompletionAbout), AddHidden("__complete"),
                          AddHidden("__manual"));
  }

  ParsedCommandLine Parse(const std::vector<std::string>& arguments) {
    ParsedCommandLine result;
    try {
      CheckCommand(arguments);
      // Arguments after -- are never options; CLI11 would pass them to the parent command.
      const auto end = std::find(arguments.begin(), arguments.end(), "--");
      if (end != arguments.end()) plain_.assign(end + 1, arguments.end());
      // CLI11 takes them from the back.
      std::vector<std::string> reversed(arguments.begin(), end);
      std::reverse(reversed.begin(), reversed.end());
      app_.parse(std::move(reversed));
      CheckExtras();
      FillIn();
      if (printed_.empty()) {
        result.options = options_;
      } else {
        result.out = printed_;
      }
    } catch (const UsageError& error) {
      result.err = Usage(error.message);
      result.exit_code = kExitUsage;
    } catch (const CLI::CallForHelp&) {
      const CLI::App* chosen = Chosen();
      result.out = chosen == &app_ ? app_.help() : chosen->help("voxelctl");
    } catch (const CLI::CallForVersion& version) {
      result.out = absl::StrCat(version.what(), "\n");
    } catch (const CLI::Error& error) {
      result.err = Usage(EscapeForTerminal(usage::ExplainError(error, {Chosen(), &app_})));
      result.exit_code = kExitUsage;
    }
    return result;
  }

 private:
  // A hidden command is for programs, so it is not shown to people.
  CLI::App* AddHidden(const char* name) {
    CLI::App* command = Add(name, "");
    names_.pop_back();
    hidden_.emplace_back(name);
    return command;
  }

  CLI::App* Add(const char* name, const char* about) {
    CLI::App* command = app_.add_subcommand(name, about);
    command->fallthrough();
    command->footer("Before or after the command: --server ADDR, --json (voxelctl --help)");
    command->allow_extras();
    command->option_defaults()->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
    names_.emplace_back(name);
    return command;
  }

  void AddDraw() {
    CLI::App* c = Add("draw", kDrawAbout);
    c->add_option("SHAPE", draw_.shapes, "Shapes or expressions, each in quotes")
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    c->add_flag("--add", draw_.add, "Leave up what voxelctl put up before");
  }

  void AddStats() {
    CLI::App* c = Add("stats", "Shows the server's and the displays' figures");
    c->add_flag("--watch", stats_.watch, "Again and again, until Ctrl-C");
    AddNumber(c, "--interval", &stats_.interval_s, 0.01, 3600, "Seconds between, 0.01 to 3600",
              "S");
  }

  void AddEntities() {
    AddFilter(Add("entities", "Lists layers and entities"), &entities_.layer, &entities_.owner);
  }

  void AddWatch() { AddFilter(Add("watch", kWatchAbout), &watch_.layer, &watch_.owner); }

  void AddClear() {
    CLI::App* c = Add("clear", kClearAbout);
    c->add_option("--layer", clear_.layer, "This layer instead, whoever owns it")
        ->type_name("NAME");
    c->add_flag("--all", clear_.all, "Every layer of every owner, and test patterns");
  }

  void AddPattern() {
    CLI::App* c = Add("pattern", kPatternAbout);
    c->add_option("NAME", pattern_name_, "The pattern, none, or list")
        ->type_name(absl::StrCat(absl::StrJoin(PatternNames(), "|"), "|none|list"));
    c->add_option("--display", pattern_.display, "Only on this display (default: on all)")
        ->type_name("NAME");
  }

  void AddSet() {
    CLI::App* c = Add("set", "Sets a display's brightness, blank and power limit");
    c->add_option("--display", set_.display, "Only on this display (default: on all)")
        ->type_name("NAME");
    WantNumber(c->add_option("--brightness", set_brightness_, "Of the display, 0 to 1")
                   ->type_name("SHARE"),
               0, 1);
    c->add_option("--blank", set_blank_, "on: dark; off: light again")->type_name("on|off");
    WantNumber(c->add_option("--power-limit", set_power_, "The most that it may draw; 0: no limit")
                   ->type_name("WATTS"),
               0, 1e6);
  }

  void AddCalibrate() {
    CLI::App* c = Add(
        "calibrate",
        "Shows patterns on a display, which it opens itself (voxeld must not have it), asks what "
        "is seen, and writes the display's profile with what was found: orientation, mirrors, "
        "eccentricity, keystone");
    c->add_option("DISPLAY", calibrate_.display, "[NAME=]DRIVER[,KEY=VALUE…], as for verify");
    c->add_option("FILE", calibrate_.file, "Where the profile goes; must not be there yet");
  }

  void AddProfile() {
    CLI::App* c = Add("profile", kProfileAbout);
    c->add_option("ACTION", profile_action_, "check or list")->type_name("check|list");
    c->add_option("PROFILE", profile_.profile, "Of check: a path, or the name of one installed");
  }

  // CLI11's message for an unknown command is not useful.
  void CheckCommand(const std::vector<std::string>& arguments) const {
    if (arguments.empty())
      throw UsageError{absl::StrCat("a command is expected: ", absl::StrJoin(names_, ", "))};
    for (size_t i = 0; i < arguments.size(); ++i) {
      const std::string& word = arguments[i];
      if (IsServerOption(word)) {
        ++i;
      } else if (!absl::StartsWith(word, "-") || word == "-") {
        if (absl::c_linear_search(names_, word) || absl::c_linear_search(hidden_, word)) return;
        throw UsageError{absl::StrCat("\"", EscapeForTerminal(word), "\" is no command",
                                      Suggestion(word, names_))};
      } else if (word == "--help" || word == "-h" || word == "--version") {
        return;
      } else {
        CheckBefore(word);
      }
    }
  }

  // An option before the command must be a global one: for any other it is unknown whether it takes
  // the next word.
  void CheckBefore(const std::string& word) const {
    const std::string name = word.substr(0, word.find('='));
    if (app_.get_option_no_throw(name) != nullptr) return;
    for (const CLI::App* command : app_.get_subcommands([](const CLI::App*) { return true; })) {
      if (command->get_option_no_throw(name) == nullptr) continue;
      throw UsageError{absl::StrCat(EscapeForTerminal(name), " is an option of ",
                                    command->get_name(), ", and belongs behind it")};
    }
    throw UsageError{EscapeForTerminal(usage::UnknownOption(word, {&app_}))};
  }

  const CLI::App* Chosen() const {
    const std::vector<const CLI::App*> chosen =
        app_.get_subcommands([](const CLI::App* app) { return app->parsed(); });
    return chosen.empty() ? &app_ : chosen.front();
  }

  void CheckExtras() const {
    const std::vector<std::string> extras = app_.remaining(true);
    if (extras.empty()) return;
    const std::string& extra = extras.front();
    if (!absl::StartsWith(extra, "-")) {
      throw UsageError{absl::StrCat("\"", EscapeForTerminal(extra), "\" is one argument too many")};
    }
    throw UsageError{EscapeForTerminal(usage::UnknownOption(extra, {Chosen(), &app_}))};
  }

  void FillIn() {
    const CLI::App* chosen = Chosen();
    if (chosen == &app_)
      throw UsageError{absl::StrCat("a command is expected: ", absl::StrJoin(names_, ", "))};
    const std::string name = chosen->get_name();
    if (name == "play") {
      options_.command = play_texts_.Read(plain_);
      return;
    }
    if (name == "demo") {
      options_.command = ReadDemoOptions(demo_, plain_);
      return;
    }
    if (name == "draw") {
      draw_.shapes.insert(draw_.shapes.end(), plain_.begin(), plain_.end());
      if (draw_.shapes.empty()) throw UsageError{"draw wants at least one SHAPE"};
      options_.command = draw_;
      return;
    }
    if (name == "assets") {
      assets_.files.insert(assets_.files.end(), plain_.begin(), plain_.end());
      options_.command = assets_;
      return;
    }
    TakePlain(name == "snapshot"   ? snapshot_texts_.file()
              : name == "render"   ? render_texts_.file()
              : name == "export"   ? export_texts_.file()
              : name == "gallery"  ? &gallery_.file
              : name == "pattern"  ? &pattern_name_
              : name == "verify"   ? &verify_.display
              : name == "profile"  ? &profile_.profile
              : name == "init"     ? &init_.file
              : name == "token"    ? &token_.name
              : name == "record"   ? &record_.file
              : name == "replay"   ? &replay_.file
              : name == "playlist" ? &playlist_.file
              : name == "markers"  ? &markers_.url
              : name == "why"      ? &why_.id
                                   : nullptr);
    if (name == "snapshot") options_.command = snapshot_texts_.Read(*chosen);
    if (name == "render") options_.command = render_texts_.Read(*chosen);
    if (name == "export") options_.command = export_texts_.Read();
    if (name == "gallery") FillInChecked(gallery_, CheckGalleryOptions);
    if (name == "pattern") return FillInPattern();
    if (name == "verify") return FillInVerify();
    if (name == "profile") return FillInProfile();
    if (name == "doctor") options_.command = DoctorOptions();
    if (name == "init") {
      if (init_.file.empty()) throw UsageError{"init wants the name of a file, such as cube.toml"};
      options_.command = init_;
    }
    if (name == "token") FillInChecked(token_, CheckTokenOptions);
    if (name == "record") FillInChecked(record_, CheckRecordOptions);
    if (name == "replay") FillInChecked(replay_, CheckReplayOptions);
    if (name == "markers") FillInChecked(markers_, CheckMarkersOptions);
    if (name == "playlist") FillInChecked(playlist_, CheckPlaylistOptions);
    if (name == "why") FillInChecked(why_, CheckWhyOptions);
    if (name == "input") options_.command = input_texts_.Read();
    if (name == "pipe") options_.command = pipe_texts_.Read();
    if (name == "set") return FillInSet();
    if (name == "calibrate") {
      if (calibrate_.file.empty()) {
        throw UsageError{
            "calibrate wants a DISPLAY and the name of a file: calibrate "
            "voxlink,profile=./mine.toml measured.toml"};
      }
      options_.command = calibrate_;
    }
    if (name == "completion") printed_ = completion_texts_.Script(app_);
    if (name == "__complete") options_.command = completion_texts_.ReadComplete();
    if (name == "__manual") options_.command = completion_texts_.ReadManual(app_);
    if (name == "displays") options_.command = DisplaysOptions();
    if (name == "entities") options_.command = entities_;
    if (name == "watch") options_.command = watch_;
    if (name == "stats") options_.command = stats_;
    if (name == "top") options_.command = top_;
    if (name == "clear") {
      if (clear_.all && !clear_.layer.empty())
        throw UsageError{"--all and --layer do not go together"};
      options_.command = clear_;
    }
  }

  template <typename T>
  void FillInChecked(const T& options, void (*check)(const T&)) {
    check(options);
    options_.command = options;
  }

  // Stores the only positional argument of a command; null if it has none.
  void TakePlain(std::string* argument) {
    if (plain_.empty()) return;
    if (argument == nullptr || !argument->empty() || plain_.size() > 1) {
      throw UsageError{
          absl::StrCat("\"", EscapeForTerminal(plain_.back()), "\" is one argument too many")};
    }
    *argument = plain_.front();
  }

  void FillInPattern() {
    if (pattern_name_.empty())
      throw UsageError{absl::StrCat("pattern wants a name: ", absl::StrJoin(PatternNames(), ", "),
                                    ", none or list")};
    pattern_.list = pattern_name_ == "list";
    if (!pattern_.list) {
      Choices<v1::TestPattern> choices = Patterns();
      choices.emplace_back("list", v1::TEST_PATTERN_UNSPECIFIED);
      pattern_.pattern = Choose("the pattern", pattern_name_, choices);
    }
    options_.command = pattern_;
  }

  void FillInSet() {
    if (!std::isnan(set_brightness_)) set_.brightness = set_brightness_;
    if (!std::isnan(set_power_)) set_.power_limit_w = set_power_;
    if (!set_blank_.empty()) {
      set_.blank = Choose("--blank", set_blank_, Choices<bool>{{"on", true}, {"off", false}});
    }
    if (!set_.brightness && !set_.power_limit_w && !set_.blank) {
      throw UsageError{"set wants something to set: --brightness, --blank or --power-limit"};
    }
    options_.command = set_;
  }

  void FillInProfile() {
    if (profile_action_.empty()) {
      throw UsageError{"profile wants to know what to do: check PROFILE, or list"};
    }
    profile_.list =
        Choose("the action", profile_action_, Choices<bool>{{"check", false}, {"list", true}});
    if (!profile_.list && profile_.profile.empty()) {
      throw UsageError{"profile check wants a PROFILE: a path such as ./rotor.toml, or a name"};
    }
    if (profile_.list && !profile_.profile.empty()) {
      throw UsageError{"profile list takes no PROFILE"};
    }
    options_.command = profile_;
  }

  void FillInVerify() {
    if (verify_.display.empty()) {
      throw UsageError{
          "verify wants a DISPLAY: [NAME=]DRIVER[,KEY=VALUE…], such as voxlink,serial=A1 or "
          "simulated"};
    }
    options_.command = verify_;
  }

  std::string Usage(absl::string_view message) const {
    const CLI::App* chosen = Chosen();
    return absl::StrCat("voxelctl: ", message, "\nTry `voxelctl ",
                        chosen == &app_ ? "" : absl::StrCat(chosen->get_name(), " "), "--help`.\n");
  }

  CLI::App app_;
  std::vector<std::string> names_, hidden_;
  std::vector<std::string> plain_;  // arguments after --
  std::string printed_;             // text that the command prints immediately, if any
  Options options_;
  DemoOptions demo_;
  DrawOptions draw_;
  GalleryOptions gallery_;
  SnapshotArguments snapshot_texts_;
  RenderArguments render_texts_;
  ExportArguments export_texts_;
  StatsOptions stats_;
  TopOptions top_;
  EntitiesOptions entities_;
  WhyOptions why_;
  WatchOptions watch_;
  ClearOptions clear_;
  PatternOptions pattern_;
  SetOptions set_;
  CalibrateOptions calibrate_;
  double set_brightness_ = std::nan(""), set_power_ = std::nan("");
  std::string set_blank_;
  VerifyOptions verify_;
  ProfileOptions profile_;
  InitOptions init_;
  TokenOptions token_;
  RecordOptions record_;
  ReplayOptions replay_;
  PlaylistOptions playlist_;
  MarkersOptions markers_;
  AssetsOptions assets_;
  CompletionArguments completion_texts_;
  InputArguments input_texts_;
  PipeArguments pipe_texts_;
  PlayArguments play_texts_;
  std::string profile_action_, pattern_name_;
};

}  // namespace

ParsedCommandLine ParseCommandLine(const std::vector<std::string>& arguments) {
  return Parser().Parse(arguments);
}

}  // namespace voxeld::voxelctl
