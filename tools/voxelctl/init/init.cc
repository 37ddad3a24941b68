#include "tools/voxelctl/init/init.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "common/text/printable.h"
#include "display/drivers/options.h"
#include "display/drivers/registry.h"
#include "display/profiles/profile.h"
#include "display/sync/clock.h"
#include "tools/voxelctl/ask/asker.h"

namespace voxeld::voxelctl {
namespace {

// The lines of the profile.
class Profile {
 public:
  void Text(const std::string& key, const std::string& value) {
    lines_.push_back(absl::StrCat(key, " = \"", value, "\""));
  }
  void Value(const std::string& key, const std::string& value) {
    lines_.push_back(absl::StrCat(key, " = ", value));
  }
  std::string text() const { return absl::StrCat(absl::StrJoin(lines_, "\n"), "\n"); }

 private:
  std::vector<std::string> lines_;
};

void AskDriver(Asker& asker, Profile& profile, bool& network) {
  const std::string link = asker.Choose("What are the lights connected to?",
                                        {{"fadecandy", "Fadecandy boards on USB"},
                                         {"ddp", "a controller on the network: WLED, Falcon, …"},
                                         {"e131", "a controller that takes sACN (E1.31)"},
                                         {"artnet", "a controller that takes Art-Net"},
                                         {"opc", "a server that takes Open Pixel Control"}});
  network = link != "fadecandy";
  profile.Text("driver", network ? "network" : "fadecandy");
  if (!network) {
    profile.Value("boards", asker.Number("How many boards?", "1", 1, 64, true));
    return;
  }
  profile.Text("protocol", link);
  profile.Text(
      "address",
      asker.Ask("Its address, in numbers, with a port if it is not the usual one?", "",
                [](const std::string& answer) -> absl::StatusOr<std::string> {
                  // The driver checks the address more closely at the end.
                  for (const char c : answer) {
                    const bool fits = absl::ascii_isxdigit(static_cast<unsigned char>(c)) ||
                                      c == '.' || c == ':' || c == '[' || c == ']';
                    if (!fits)
                      return absl::InvalidArgumentError("192.168.1.20, or 192.168.1.20:4048");
                  }
                  if (!answer.empty()) return answer;
                  return absl::InvalidArgumentError("192.168.1.20, or 192.168.1.20:4048");
                }));
  if (link == "e131")
    profile.Value("universe", asker.Number("Its first universe?", "1", 1, 63999, true));
  if (link == "artnet") {
    profile.Value("universe",
                  asker.Number("Its first universe, counted from 0?", "0", 0, 32767, true));
  }
  const std::string order = asker.Choose("In which order do the lights take their colours?",
                                         {{"rgb", "red, green, blue"},
                                          {"grb", "green, red, blue: most WS2812"},
                                          {"brg", "blue, red, green"},
                                          {"rbg", "red, blue, green"},
                                          {"gbr", "green, blue, red"},
                                          {"bgr", "blue, green, red"}});
  profile.Text("color_order", order);
}

// Returns the axis that a word such as "left-right" describes.
char AxisOf(const std::string& word) {
  return word == "left-right" ? 'x' : word == "front-back" ? 'y' : 'z';
}

void AskWiring(Asker& asker, Profile& profile, bool network) {
  const std::string wide = asker.Number("Width: lights from left to right?", "8", 1, 16384, true);
  const std::string deep = asker.Number("Depth: lights from front to back?", "8", 1, 16384, true);
  const std::string high = asker.Number("Height: lights from bottom to top?", "8", 1, 16384, true);
  profile.Text("cube", absl::StrCat(wide, "x", deep, "x", high));
  profile.Value("pitch_mm",
                asker.Number("Millimetres from light to light?", "25", 1e-3, 1e5, false));

  const std::string corner =
      asker.Choose("Start corner: where is the first light, as seen from the front?",
                   {{"front-bottom-left", ""},
                    {"front-bottom-right", ""},
                    {"front-top-left", ""},
                    {"front-top-right", ""},
                    {"back-bottom-left", ""},
                    {"back-bottom-right", ""},
                    {"back-top-left", ""},
                    {"back-top-right", ""}});
  std::vector<std::string> flips;
  if (absl::EndsWith(corner, "right")) flips.emplace_back("x");
  if (absl::StartsWith(corner, "back")) flips.emplace_back("y");
  if (absl::StrContains(corner, "top")) flips.emplace_back("z");
  if (!flips.empty()) profile.Text("flip", absl::StrJoin(flips, ";"));

  const std::vector<Choice> directions = {
      {"left-right", "horizontal"}, {"front-back", "into the depth"}, {"up-down", "vertical"}};
  const std::string strand = asker.Choose("Direction: how does a strand run?", directions);
  std::vector<Choice> others;
  for (const Choice& direction : directions) {
    if (direction.word != strand) others.push_back(direction);
  }
  const std::string next = asker.Choose("In which direction is the next strand?", others);
  std::string order = {AxisOf(strand), AxisOf(next)};
  for (const char axis : {'x', 'y', 'z'}) {
    if (order.find(axis) == std::string::npos) order += axis;
  }
  profile.Text("order", order);

  const std::string zigzag = asker.Choose(
      "Strand style?",
      {{"no-zig-zag", "every strand begins on the side of the first light"},
       {"zig-zag", "every second strand of a layer runs back"},
       {"continuous",
        "zig-zag, and every layer begins where the one before ended: the chain never jumps"}});
  profile.Text("serpentine", zigzag == "zig-zag"      ? "rows"
                             : zigzag == "continuous" ? "rows_and_slices"
                                                      : "none");
  if (!network) {
    profile.Value("per_strip",
                  asker.Number("Lights on each of a board's outputs?", "64", 1, 64, true));
    return;
  }
  const std::string strip = asker.Ask(
      "Pixels from the start of one output to that of the next, or none if the chain is one?",
      "none", [](const std::string& answer) -> absl::StatusOr<std::string> {
        int value = 0;
        if (answer == "none" ||
            (absl::SimpleAtoi(answer, &value) && value >= 1 && value <= 100000)) {
          return answer;
        }
        return absl::InvalidArgumentError(
            "a number from 1 to 100000, such as 170 for a universe, or none");
      });
  if (strip == "none" || asker.ended()) return;
  profile.Value("strip", strip);
  profile.Value("per_strip", asker.Number("Lights on each output?", strip, 1, 100000, true));
}

// Checks whether a display can be made of it, as the daemon would.
absl::Status Try(const std::string& file) {
  const absl::StatusOr<display::Profile> profile = display::ReadProfile(file);
  if (!profile.ok()) return profile.status();
  sync::SystemClock clock;
  const absl::Status made =
      display::CreateDisplay({"lattice", profile->driver, profile->options}, clock).status();
  // USB boards are not looked for here.
  return absl::IsUnavailable(made) ? absl::OkStatus() : made;
}

}  // namespace

absl::Status Init(const InitOptions& options, std::istream& in, Console& console) {
  std::error_code error;
  if (std::filesystem::exists(options.file, error)) {
    return absl::AlreadyExistsError(absl::StrCat(
        EscapeForTerminal(options.file), " is there already; give another name, or remove it"));
  }
  Asker asker(in, console);
  Profile profile;
  console.Say("Enter takes what stands in brackets; the beginning of a word is enough.");
  profile.Text("title", "An LED lattice");
  bool network = false;
  AskDriver(asker, profile, network);
  AskWiring(asker, profile, network);
  if (asker.ended()) {
    return absl::FailedPreconditionError(
        "the answers ended before the questions; nothing was written");
  }
  std::ofstream file(options.file, std::ios::binary);
  file << profile.text();
  file.close();
  if (!file)
    return absl::UnavailableError(
        absl::StrCat(EscapeForTerminal(options.file), " cannot be written"));
  if (const absl::Status made = Try(options.file); !made.ok()) {
    return absl::InvalidArgumentError(absl::StrCat(
        EscapeForTerminal(options.file),
        " is written, but no display can be made of it: ", EscapeForTerminal(made.message())));
  }
  const std::string driver = network ? "network" : "fadecandy";
  console.Say(absl::StrCat(
      "\nwritten: ", EscapeForTerminal(options.file), "\n  voxeld --display lattice=", driver,
      ",profile=", EscapeForTerminal(options.file),
      "\n  voxelctl pattern corners   # each corner in its own colour: is each where it belongs?"));
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
