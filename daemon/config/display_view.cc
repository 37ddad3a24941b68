#include "daemon/config/display_view.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "daemon/suggest/suggest.h"

namespace voxeld::daemon {
namespace {

constexpr std::pair<const char*, ViewOptions::Mode> kModes[] = {
    {"fit", ViewOptions::Mode::kFit},
    {"millimetres", ViewOptions::Mode::kMillimetres},
    {"voxels", ViewOptions::Mode::kVoxels}};

absl::StatusOr<ViewOptions::Mode> ParseMode(const std::string& text) {
  std::vector<std::string> known;
  for (const auto& [name, mode] : kModes) {
    if (text == name) return mode;
    known.emplace_back(name);
  }
  return absl::InvalidArgumentError(
      absl::StrCat("view is \"", text, "\"", Suggestion(text, known)));
}

absl::StatusOr<std::pair<display::Vec3, display::Vec3>> ParseBox(const std::string& text) {
  std::vector<double> numbers;
  for (const absl::string_view item : absl::StrSplit(text, ';')) {
    double number = 0;
    if (!absl::SimpleAtod(item, &number)) break;
    numbers.push_back(number);
  }
  if (numbers.size() != 6 || std::count(text.begin(), text.end(), ';') != 5) {
    return absl::InvalidArgumentError(
        absl::StrCat("view_box is \"", text, "\"; give six numbers x0;y0;z0;x1;y1;z1"));
  }
  return std::pair(display::Vec3{numbers[0], numbers[1], numbers[2]},
                   display::Vec3{numbers[3], numbers[4], numbers[5]});
}

}  // namespace

absl::StatusOr<DisplayOptions> SplitDisplayOptions(const DisplayConfig& display) {
  DisplayOptions split;
  split.driver = display.options;
  if (const auto view = split.driver.extract("view")) {
    const absl::StatusOr<ViewOptions::Mode> mode = ParseMode(view.mapped());
    if (!mode.ok()) return mode.status();
    split.view.mode = *mode;
  }
  if (const auto box = split.driver.extract("view_box")) {
    const auto parsed = ParseBox(box.mapped());
    if (!parsed.ok()) return parsed.status();
    split.view.box = *parsed;
  }
  return split;
}

}  // namespace voxeld::daemon
