#include "daemon/config/display_view.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/text/suggest.h"
#include "display/profiles/profile.h"

namespace voxeld::daemon {
namespace {

constexpr std::pair<const char*, ViewOptions::Mode> kModes[] = {
    {"fit", ViewOptions::Mode::kFit},
    {"millimetres", ViewOptions::Mode::kMillimetres},
    {"voxels", ViewOptions::Mode::kVoxels}};

constexpr int kMostWatts = 1'000'000;

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

absl::StatusOr<std::vector<int>> ParseGpus(const std::string& text) {
  constexpr int kMost = 1023;
  std::vector<int> gpus;
  for (const absl::string_view item : absl::StrSplit(text, ';')) {
    int gpu = 0;
    if (!absl::SimpleAtoi(item, &gpu) || gpu < 0 || gpu > kMost) {
      return absl::InvalidArgumentError(absl::StrCat(
          "gpus is \"", text, "\"; give numbers of GPUs from 0 to ", kMost, ", such as 0;1"));
    }
    if (std::find(gpus.begin(), gpus.end(), gpu) != gpus.end()) {
      return absl::InvalidArgumentError(
          absl::StrCat("gpus is \"", text, "\", which has ", gpu, " twice; give each GPU once"));
    }
    gpus.push_back(gpu);
  }
  return gpus;
}

}  // namespace

absl::Status CheckGpus(const std::vector<int>& gpus, gpu::EngineKind kind, int32_t slices) {
  if (gpus.empty()) return absl::OkStatus();
  if (kind == gpu::EngineKind::kCpu) {
    return absl::InvalidArgumentError(
        "gpus is given, and the engine is cpu; leave gpus out, or let engine be auto or cuda");
  }
  if (gpus.size() > static_cast<size_t>(slices)) {
    return absl::InvalidArgumentError(absl::StrCat("gpus names ", gpus.size(),
                                                   " GPUs, and the display has ", slices,
                                                   " slices; give at most a GPU for each slice"));
  }
  return absl::OkStatus();
}

absl::StatusOr<DisplayOptions> SplitDisplayOptions(const DisplayConfig& display) {
  DisplayOptions split;
  split.driver = display.options;
  if (const auto named = split.driver.extract("profile")) {
    const absl::StatusOr<display::Profile> profile = display::LoadProfile(named.mapped());
    if (!profile.ok()) return profile.status();
    if (!profile->driver.empty() && profile->driver != display.driver) {
      return absl::InvalidArgumentError(
          absl::StrCat("driver is ", display.driver, ", but the profile ", named.mapped(),
                       " is for ", profile->driver, "; give that one, or another profile"));
    }
    // Options of the display take precedence over those of the profile.
    split.driver.insert(profile->options.begin(), profile->options.end());
  }
  if (const auto view = split.driver.extract("view")) {
    const absl::StatusOr<ViewOptions::Mode> mode = ParseMode(view.mapped());
    if (!mode.ok()) return mode.status();
    split.setup.view.mode = *mode;
  }
  if (const auto box = split.driver.extract("view_box")) {
    const auto parsed = ParseBox(box.mapped());
    if (!parsed.ok()) return parsed.status();
    split.setup.view.box = *parsed;
  }
  if (const auto genlock = split.driver.extract("genlock")) {
    split.setup.genlock = genlock.mapped();
    if (split.setup.genlock.empty()) {
      return absl::InvalidArgumentError(
          "genlock is \"\"; give the name of a group, or leave it out");
    }
  }
  for (const auto& [name, watts] : {std::pair("power_limit", &split.setup.power_limit_w),
                                    std::pair("power_full", &split.setup.power_full_w)}) {
    const auto text = split.driver.extract(name);
    if (text.empty()) continue;
    if (!absl::SimpleAtod(text.mapped(), watts) || !(*watts >= 0 && *watts <= kMostWatts)) {
      return absl::InvalidArgumentError(absl::StrCat(
          name, " is \"", text.mapped(), "\"; give watts, from 0 (none) to ", kMostWatts));
    }
  }
  if (const auto gpus = split.driver.extract("gpus")) {
    absl::StatusOr<std::vector<int>> parsed = ParseGpus(gpus.mapped());
    if (!parsed.ok()) return parsed.status();
    split.gpus = *std::move(parsed);
  }
  return split;
}

}  // namespace voxeld::daemon
