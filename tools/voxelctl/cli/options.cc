#include "tools/voxelctl/cli/options.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "absl/algorithm/container.h"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "daemon/suggest/suggest.h"
#include "tools/voxelctl/cli/about.h"
#include "tools/voxelctl/cli/argument_checks.h"
#include "tools/voxelctl/cli/light_options.h"
#include "tools/voxelctl/cli/patterns.h"
#include "tools/voxelctl/cli/play_options.h"
#include "tools/voxelctl/cli/server_options.h"
#include "tools/voxelctl/cli/service_options.h"
#include "tools/voxelctl/text/escape.h"

namespace voxeld::voxelctl {
namespace {

// The command line as declared, and the values that it fills in.
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
    AddDraw();
    AddSnapshot();
    AddGallery();
    Add("displays", "Lists the displays, their geometry and state");
    AddStats();
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
  }

  ParsedCommandLine Parse(const std::vector<std::string>& arguments) {
    ParsedCommandLine result;
    try {
      CheckCommand(arguments);
      // What follows -- is no option whatever it looks like;
      // CLI11 would hand it to the parent command.
      const auto end = std::find(arguments.begin(), arguments.end(), "--");
      if (end != arguments.end()) plain_.assign(end + 1, arguments.end());
      // CLI11 takes them from the back.
      std::vector<std::string> reversed(arguments.begin(), end);
      std::reverse(reversed.begin(), reversed.end());
      app_.parse(std::move(reversed));
      CheckExtras();
      FillIn();
      result.options = options_;
    } catch (const UsageError& error) {
      result.err = Usage(error.message);
      result.exit_code = kExitUsage;
    } catch (const CLI::CallForHelp&) {
      const CLI::App* chosen = Chosen();
      result.out = chosen == &app_ ? app_.help() : chosen->help("voxelctl");
    } catch (const CLI::CallForVersion& version) {
      result.out = absl::StrCat(version.what(), "\n");
    } catch (const CLI::Error& error) {
      result.err = Usage(EscapeForTerminal(error.what()));
      result.exit_code = kExitUsage;
    }
    return result;
  }

 private:
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

  void AddGallery() {
    CLI::App* c = Add("gallery",
                      "Draws an example of every shape, one after another, and puts what a display "
                      "shows of each\ninto one picture. What voxelctl put up before goes.");
    c->add_option("OUT.png", gallery_.file,
                  "Where the picture goes; an old one is replaced when the new one is whole");
    c->add_option("--each", gallery_.each,
                  "A folder for a small picture of each shape too, named as the shape is")
        ->type_name("DIR");
    c->add_option("--display", gallery_.display, "Which display (default: the first)")
        ->type_name("NAME");
  }

  void AddSnapshot() {
    CLI::App* c = Add("snapshot", kSnapshotAbout);
    c->add_option("OUT.png", snapshot_.file,
                  "Where the picture goes; an old one is replaced when the new one is whole");
    c->add_option("--display", snapshot_.display, "Which display (default: the first)")
        ->type_name("NAME");
    c->add_option("--size", size_, "Size of the picture, 64x64 to 8192x8192")
        ->type_name("WxH")
        ->capture_default_str();
    AddNumber(c, "--azimuth", &snapshot_.azimuth_degrees, -3600, 3600,
              "Degrees that the viewer has walked to the right from the front", "DEG");
    AddNumber(c, "--elevation", &snapshot_.elevation_degrees, -89, 89,
              "Degrees that the viewer stands above the middle, -89 to 89", "DEG");
    c->add_flag("--slices", snapshot_.slices,
                "A contact sheet of all slices instead, as large as they make it");
    AddNumber(c, "--timeout", &snapshot_.timeout_s, 0.01, 60,
              "Seconds to wait for a volume, up to 60", "S");
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
    CLI::App* c = Add("clear", "Takes down what voxelctl put up: its layer and test patterns");
    c->add_option("--layer", clear_.layer, "This layer instead, whoever owns it")
        ->type_name("NAME");
    c->add_flag("--all", clear_.all, "Every layer of every owner, and test patterns");
  }

  void AddPattern() {
    CLI::App* c = Add("pattern", kPatternAbout);
    c->add_option("NAME", pattern_name_, "The pattern, none, or list");
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
    c->add_option("ACTION", profile_action_, "check or list");
    c->add_option("PROFILE", profile_.profile, "Of check: a path, or the name of one installed");
  }

  // CLI11 says nothing useful about a command that is not there.
  void CheckCommand(const std::vector<std::string>& arguments) const {
    if (arguments.empty())
      throw UsageError{absl::StrCat("a command is expected: ", absl::StrJoin(names_, ", "))};
    for (size_t i = 0; i < arguments.size(); ++i) {
      const std::string& word = arguments[i];
      if (IsServerOption(word)) {
        ++i;
      } else if (!absl::StartsWith(word, "-") || word == "-") {
        if (std::find(names_.begin(), names_.end(), word) != names_.end()) return;
        throw UsageError{absl::StrCat("\"", EscapeForTerminal(word), "\" is no command",
                                      Suggestion(word, names_))};
      } else if (word == "--help" || word == "-h" || word == "--version") {
        return;
      }
    }
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
    std::vector<std::string> known;
    for (const CLI::App* app : {Chosen(), &app_}) {
      for (const CLI::Option* option : app->get_options()) {
        for (const std::string& name : option->get_lnames())
          known.push_back(absl::StrCat("--", name));
      }
    }
    std::sort(known.begin(), known.end());
    known.erase(std::unique(known.begin(), known.end()), known.end());
    const std::string name = extra.substr(0, extra.find('='));
    throw UsageError{
        absl::StrCat(EscapeForTerminal(name), " is no option here", Suggestion(name, known))};
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
    TakePlain(name == "snapshot"   ? &snapshot_.file
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
    if (name == "snapshot") return FillInSnapshot();
    if (name == "gallery") {
      if (gallery_.file.empty()) throw UsageError{"gallery wants the name of a file, OUT.png"};
      CheckPictureName(gallery_.file);
      options_.command = gallery_;
      return;
    }
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
    if (name == "displays") options_.command = DisplaysOptions();
    if (name == "entities") options_.command = entities_;
    if (name == "watch") options_.command = watch_;
    if (name == "stats") {
      options_.command = stats_;
    }
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

  // The only positional argument of a command, null if it has none.
  void TakePlain(std::string* argument) {
    if (plain_.empty()) return;
    if (argument == nullptr || !argument->empty() || plain_.size() > 1) {
      throw UsageError{
          absl::StrCat("\"", EscapeForTerminal(plain_.back()), "\" is one argument too many")};
    }
    *argument = plain_.front();
  }

  void FillInSnapshot() {
    if (snapshot_.file.empty()) throw UsageError{"snapshot wants the name of a file, OUT.png"};
    CheckPictureName(snapshot_.file);
    for (const char* option : {"--size", "--azimuth", "--elevation"}) {
      if (snapshot_.slices && Chosen()->count(option) > 0) {
        throw UsageError{absl::StrCat(option,
                                      " does not go with --slices: a contact sheet has no "
                                      "viewer, and its size follows from the slices")};
      }
    }
    const std::vector<std::string> sides = absl::StrSplit(size_, absl::ByAnyChar("xX"));
    if (sides.size() != 2 || !absl::SimpleAtoi(sides[0], &snapshot_.width) ||
        !absl::SimpleAtoi(sides[1], &snapshot_.height)) {
      throw UsageError{absl::StrCat("--size is ", EscapeForTerminal(size_),
                                    "; WIDTHxHEIGHT is expected, such as 1200x1000")};
    }
    CheckRange("the width in --size", snapshot_.width, 64, 8192);
    CheckRange("the height in --size", snapshot_.height, 64, 8192);
    options_.command = snapshot_;
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
  std::vector<std::string> names_;
  std::vector<std::string> plain_;  // arguments after --
  Options options_;
  DrawOptions draw_;
  GalleryOptions gallery_;
  SnapshotOptions snapshot_;
  StatsOptions stats_;
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
  InputArguments input_texts_;
  PipeArguments pipe_texts_;
  PlayArguments play_texts_;
  std::string profile_action_;
  std::string size_ = "1200x1000", pattern_name_;
};

}  // namespace

ParsedCommandLine ParseCommandLine(const std::vector<std::string>& arguments) {
  return Parser().Parse(arguments);
}

}  // namespace voxeld::voxelctl
