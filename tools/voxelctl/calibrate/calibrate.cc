#include "tools/voxelctl/calibrate/calibrate.h"

#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "common/text/printable.h"
#include "daemon/config/display_config.h"
#include "daemon/config/display_view.h"
#include "display/geometry/corrector.h"
#include "display/profiles/profile.h"
#include "display/usb/libusb/libusb_bus.h"
#include "tools/voxelctl/ask/asker.h"
#include "tools/voxelctl/calibrate/trial.h"

namespace voxeld::voxelctl {
namespace {

using daemon::TestPattern;
using OptionMap = std::map<std::string, std::string>;

constexpr sync::TimeNs kShowLimit = 10 * sync::kSecond;

// Inverts a flag, or a flag per panel.
void Flip(OptionMap& options, const std::string& key) {
  std::string& value = options[key];
  std::vector<std::string> flags = absl::StrSplit(value.empty() ? "false" : value, ';');
  for (std::string& flag : flags) flag = flag == "true" ? "false" : "true";
  value = absl::StrJoin(flags, ";");
}

// Returns the `count` numbers of a list option.
std::vector<double> Numbers(const OptionMap& options, const std::string& key, size_t count) {
  std::vector<double> numbers;
  if (const auto it = options.find(key); it != options.end()) {
    for (const absl::string_view item : absl::StrSplit(it->second, ';')) {
      double number = 0;
      if (absl::SimpleAtod(item, &number)) numbers.push_back(number);
    }
  }
  numbers.resize(count, numbers.size() == 1 ? numbers.front() : 0);
  return numbers;
}

std::string ListText(const std::vector<double>& numbers) {
  return absl::StrJoin(numbers, ";", [](std::string* out, double number) {
    absl::StrAppendFormat(out, "%.6g", number);
  });
}

class Walk {
 public:
  Walk(daemon::DisplayConfig display, std::istream& in, Console& console)
      : display_(std::move(display)), asker_(in, console), console_(console) {}

  absl::Status Run() {
    if (absl::Status status = Try(TestPattern::kAxes); !status.ok()) return status;
    for (const auto step : {&Walk::Orientation, &Walk::Eccentricity, &Walk::Keystone}) {
      if (absl::Status status = (this->*step)(); !status.ok()) return status;
      if (asker_.ended()) {
        return absl::FailedPreconditionError(
            "the answers ended before the questions; nothing was written");
      }
    }
    return absl::OkStatus();
  }
  const OptionMap& options() const { return display_.options; }
  bool changed() const { return changed_; }

 private:
  // Shows the display with its current options.
  absl::Status Try(TestPattern pattern) {
    trial_ = nullptr;  // a device has only one host
    absl::StatusOr<std::unique_ptr<Trial>> trial =
        Trial::Start(display_, {clock_, [this] { return Usb(); }}, pattern, kShowLimit);
    if (!trial.ok()) return trial.status();
    trial_ = *std::move(trial);
    return absl::OkStatus();
  }

  // Changes the options and shows the result. If no display can be made of them, restores them and
  // returns the reason.
  absl::Status Change(TestPattern pattern, const OptionMap& changed) {
    const OptionMap before = std::exchange(display_.options, changed);
    const absl::Status status = Try(pattern);
    if (status.ok()) {
      changed_ = true;
      return status;
    }
    console_.Say(absl::StrCat("  that will not do: ", EscapeForTerminal(status.message())));
    display_.options = before;
    return Try(pattern);
  }

  absl::StatusOr<display::UsbBus*> Usb() {
    if (usb_ == nullptr) {
      absl::StatusOr<std::unique_ptr<display::LibusbBus>> made = display::LibusbBus::Make(clock_);
      if (!made.ok()) return made.status();
      usb_ = *std::move(made);
    }
    return usb_.get();
  }

  template <typename Shape>
  const Shape* As() const {
    return std::get_if<Shape>(&trial_->info().geometry.shape);
  }

  // Returns what can be flipped or rotated, and which option does it.
  std::vector<Choice> Turns() const {
    std::vector<Choice> turns = {{"ok", "that is what is seen"}};
    if (As<display::Lattice>() != nullptr) {
      // The positions of other displays' lights come from their list.
      if (display_.driver != "fadecandy" && display_.driver != "network") return turns;
      for (const char* axis : {"x", "y", "z"}) {
        turns.push_back({absl::StrCat("flip-", axis), absl::StrCat("the other way along ", axis)});
      }
      return turns;
    }
    turns.push_back({"mirror-u", "each picture's left and right"});
    turns.push_back({"mirror-v", "each picture's top and bottom"});
    if (const auto* planar = As<display::PlanarStack>()) {
      if (planar->strokes == 1)
        turns.push_back({"reverse", "the first slice is where the last one is thought to be"});
    } else {
      turns.push_back({"direction", "it turns the other way"});
      turns.push_back({"quarter", "red is where green should be: a quarter of a turn on"});
    }
    return turns;
  }

  OptionMap Turned(const std::string& word) const {
    OptionMap options = display_.options;
    if (absl::StartsWith(word, "flip-")) {
      std::vector<std::string> axes = absl::StrSplit(options["flip"], ';', absl::SkipEmpty());
      const std::string axis = word.substr(5);
      if (std::erase(axes, axis) == 0) axes.push_back(axis);
      options["flip"] = absl::StrJoin(axes, ";");
      if (axes.empty()) options.erase("flip");
    } else if (word == "mirror-u" || word == "mirror-v") {
      Flip(options, word == "mirror-u" ? "mirror_u" : "mirror_v");
    } else if (word == "direction") {
      Flip(options, "clockwise");
    } else if (word == "reverse") {
      if (const auto it = options.find("positions_mm"); it != options.end()) {
        std::vector<std::string> positions = absl::StrSplit(it->second, ';');
        std::reverse(positions.begin(), positions.end());
        it->second = absl::StrJoin(positions, ";");
      } else {
        options["strokes"] = options["strokes"] == "down" ? "up" : "down";
      }
    } else if (word == "quarter") {
      const auto* rotor = As<display::Rotor>();
      const std::string key = rotor != nullptr ? "panel_phase" : "phase";
      std::vector<double> phases =
          Numbers(options, key, rotor != nullptr ? rotor->panels.size() : 1);
      for (double& phase : phases) phase = phase >= 0.75 ? phase - 0.75 : phase + 0.25;
      options[key] = ListText(phases);
    }
    return options;
  }

  absl::Status Orientation() {
    console_.Say(
        "Stand in front of the display. Three lines begin in its middle: red goes to the right, "
        "green away from "
        "you, blue up.");
    while (true) {
      const std::string word = asker_.Choose("Is that what is seen? Else what is wrong?", Turns());
      if (word == "ok" || asker_.ended()) return absl::OkStatus();
      if (absl::Status status = Change(TestPattern::kAxes, Turned(word)); !status.ok())
        return status;
    }
  }

  absl::Status Eccentricity() {
    const auto* rotor = As<display::Rotor>();
    if (rotor == nullptr) return absl::OkStatus();
    const size_t panels = rotor->panels.size();
    const double pitch = display_.options.contains("pitch_mm")
                             ? Numbers(display_.options, "pitch_mm", 1).front()
                             : 1;
    if (absl::Status status = trial_->Show(TestPattern::kPosts); !status.ok()) return status;
    console_.Say(
        "Twelve upright posts stand in a cross. A panel that is not as far from the axis as it is "
        "thought to be "
        "draws each of them twice, apart by double the error.");
    while (true) {
      const std::vector<double> now = Numbers(display_.options, "eccentricity", panels);
      const std::string answer = asker_.Ask(
          absl::StrCat(
              "Eccentricity is ", ListText(now), " (in pitches of ", pitch,
              " mm). ok when every post is one, or a panel and by how many millimetres to move it, "
              "such as `1 +0.2`?"),
          "ok", [&](const std::string& text) -> absl::StatusOr<std::string> {
            const std::vector<std::string> words = absl::StrSplit(text, ' ', absl::SkipEmpty());
            size_t panel = 0;
            double by = 0;
            if (text == "ok") return text;
            if (words.size() == 2 && absl::SimpleAtoi(words[0], &panel) && panel >= 1 &&
                panel <= panels && absl::SimpleAtod(words[1], &by)) {
              return text;
            }
            return absl::InvalidArgumentError(
                absl::StrCat("ok, or a panel from 1 to ", panels, " and millimetres"));
          });
      if (answer == "ok" || asker_.ended()) return absl::OkStatus();
      const std::vector<std::string> words = absl::StrSplit(answer, ' ', absl::SkipEmpty());
      std::vector<double> moved = now;
      size_t panel = 0;
      double by = 0;
      if (absl::SimpleAtoi(words[0], &panel) && absl::SimpleAtod(words[1], &by)) {
        moved[panel - 1] += by / pitch;
      }
      OptionMap options = display_.options;
      options["eccentricity"] = ListText(moved);
      if (absl::Status status = Change(TestPattern::kPosts, options); !status.ok()) return status;
    }
  }

  absl::Status Keystone() {
    const std::optional<display::PicturePlace> half = display::HalfPicture(trial_->info().geometry);
    if (!half.has_value()) return absl::OkStatus();
    const auto given = display_.options.find("keystone_mm");
    if (given != display_.options.end() &&
        std::count(given->second.begin(), given->second.end(), ';') > 7) {
      console_.Say("Its keystone is given for each slice: that is left as it is.");
      return absl::OkStatus();
    }
    if (absl::Status status = trial_->Show(TestPattern::kFrames); !status.ok()) return status;
    console_.Say(
        "Three lying rectangles with their diagonals, at the bottom, in the middle and at the top. "
        "A projector that "
        "does not look straight at the screen makes them crooked.");
    static constexpr const char* kCorners[] = {"left front", "right front", "right back",
                                               "left back"};
    while (true) {
      const std::string what =
          asker_.Choose("Are their sides straight, their corners square?",
                        {{"ok", "they are"},
                         {"measure", "where the four corners of the projected picture truly are"},
                         {"none", "as if there were no keystone"}});
      if (what == "ok" || asker_.ended()) return absl::OkStatus();
      OptionMap options = display_.options;
      options.erase("keystone_mm");
      if (what == "measure") {
        const double at[4][2] = {
            {-half->u, -half->v}, {half->u, -half->v}, {half->u, half->v}, {-half->u, half->v}};
        const std::vector<double> now = Numbers(display_.options, "keystone_mm", 8);
        const bool known = display_.options.contains("keystone_mm");
        std::vector<std::string> corners;
        for (size_t corner = 0; corner < 4; ++corner) {
          for (size_t axis = 0; axis < 2; ++axis) {
            const double where = known ? now[corner * 2 + axis] : at[corner][axis];
            corners.push_back(
                asker_.Number(absl::StrCat("The ", kCorners[corner], " corner: millimetres to the ",
                                           axis == 0 ? "right of" : "back of", " the middle?"),
                              absl::StrFormat("%.6g", where), -1e5, 1e5, false));
          }
        }
        options["keystone_mm"] = absl::StrJoin(corners, ";");
      }
      if (asker_.ended()) return absl::OkStatus();
      if (absl::Status status = Change(TestPattern::kFrames, options); !status.ok()) return status;
    }
  }

  daemon::DisplayConfig display_;
  Asker asker_;
  Console& console_;
  sync::SystemClock clock_;
  std::unique_ptr<display::LibusbBus> usb_;  // outlives the trial, whose display may use it
  std::unique_ptr<Trial> trial_;
  bool changed_ = false;
};

std::string Quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c;
  }
  return quoted + "\"";
}

// Returns the options of the display's profile merged with the given ones.
absl::StatusOr<daemon::DisplayConfig> ReadDisplay(const std::string& text,
                                                  display::Profile* profile) {
  const std::string first = text.substr(0, text.find(','));
  absl::StatusOr<daemon::DisplayConfig> display = daemon::ParseDisplayOption(
      absl::StrContains(first, '=') ? text : absl::StrCat(first, "=", text));
  if (!display.ok()) return display;
  // Checks it as the daemon does, including whether profile and driver match.
  if (const auto split = daemon::SplitDisplayOptions(*display); !split.ok()) return split.status();
  if (const auto named = display->options.extract("profile")) {
    absl::StatusOr<display::Profile> loaded = display::LoadProfile(named.mapped());
    if (!loaded.ok()) return loaded.status();
    *profile = *std::move(loaded);
    display->options.insert(profile->options.begin(), profile->options.end());
  }
  return display;
}

}  // namespace

absl::Status Calibrate(const CalibrateOptions& options, std::istream& in, Console& console) {
  if (std::filesystem::exists(options.file)) {
    return absl::AlreadyExistsError(absl::StrCat(EscapeForTerminal(options.file),
                                                 " is there already; give the name of a new file"));
  }
  const std::filesystem::path folder = std::filesystem::absolute(options.file).parent_path();
  if (access(folder.c_str(), W_OK) != 0) {
    return absl::InvalidArgumentError(absl::StrCat(EscapeForTerminal(options.file),
                                                   " cannot be written; give a file in a folder "
                                                   "that is there and yours"));
  }
  display::Profile profile;
  absl::StatusOr<daemon::DisplayConfig> display = ReadDisplay(options.display, &profile);
  if (!display.ok()) return display.status();
  const std::string driver = display->driver, name = display->name;
  // From here on, the device's own calibration is ignored.
  if (driver == "voxlink") display->options["calibrated"] = "true";
  Walk walk(*std::move(display), in, console);
  if (absl::Status status = walk.Run(); !status.ok()) return status;

  std::ofstream file(options.file, std::ios::binary);
  if (!profile.title.empty()) file << "title = " << Quoted(profile.title) << "\n";
  if (!profile.driver.empty()) file << "driver = " << Quoted(profile.driver) << "\n";
  for (const auto& [key, value] : walk.options()) file << key << " = " << Quoted(value) << "\n";
  file.close();
  if (!file) {
    return absl::UnavailableError(
        absl::StrCat(EscapeForTerminal(options.file), " cannot be written"));
  }
  console.Say(absl::StrCat("\n", walk.changed() ? "" : "nothing had to be changed; ",
                           "written: ", EscapeForTerminal(options.file), "\n  voxeld --display ",
                           name, "=", driver, ",profile=", EscapeForTerminal(options.file)));
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
