#include "display/drivers/options.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>
#include <variant>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "display/drivers/geometry_options.h"
#include "display/geometry/footprint.h"

namespace voxeld::display {
namespace {

constexpr int32_t kMostPixels = 16384;
constexpr double kMostNumber = 1e6;
constexpr uint64_t kMostVolumeBytes = uint64_t{1} << 30;

}  // namespace

const std::string* OptionReader::Find(const std::string& key) {
  known_.insert(key);
  const auto it = options_.options.find(key);
  return it == options_.options.end() ? nullptr : &it->second;
}

void OptionReader::Refuse(const std::string& key, std::string_view right) {
  if (!status_.ok()) return;
  const auto it = options_.options.find(key);
  status_ = absl::InvalidArgumentError(absl::StrCat(
      "display \"", options_.name, "\": ", key, " is \"",
      it == options_.options.end() ? "" : it->second, "\"; it must be ", std::string(right)));
}

std::string OptionReader::Text(const std::string& key, const std::string& fallback) {
  const std::string* text = Find(key);
  return text == nullptr ? fallback : *text;
}

int64_t OptionReader::Integer(const std::string& key, int64_t fallback, int64_t least,
                              int64_t most) {
  const std::string* text = Find(key);
  if (text == nullptr) return fallback;
  int64_t value = 0;
  if (absl::SimpleAtoi(*text, &value) && value >= least && value <= most) return value;
  Refuse(key, absl::StrCat("a whole number from ", least, " to ", most));
  return fallback;
}

double OptionReader::Number(const std::string& key, double fallback, double least, double most) {
  const std::string* text = Find(key);
  if (text == nullptr) return fallback;
  double value = 0;
  if (absl::SimpleAtod(*text, &value) && value >= least && value <= most) return value;
  Refuse(key, absl::StrCat("a number from ", least, " to ", most));
  return fallback;
}

bool OptionReader::Flag(const std::string& key, bool fallback) {
  return Choice(key, {"false", "true"}, fallback ? 1 : 0) == 1;
}

std::vector<bool> OptionReader::Flags(const std::string& key, size_t count) {
  std::vector<bool> flags(count, false);
  const std::string* text = Find(key);
  if (text == nullptr) return flags;
  const std::vector<std::string> parts = absl::StrSplit(*text, ';');
  if (parts.size() != 1 && parts.size() != count) {
    Refuse(key, absl::StrCat("true or false, once or ", count, " times"));
    return flags;
  }
  for (size_t i = 0; i < count; ++i) {
    const std::string& part = parts[parts.size() == 1 ? 0 : i];
    if (part != "true" && part != "false") Refuse(key, "true or false");
    flags[i] = part == "true";
  }
  return flags;
}

size_t OptionReader::Choice(const std::string& key, std::initializer_list<std::string_view> choices,
                            size_t fallback) {
  const std::string* text = Find(key);
  if (text == nullptr) return fallback;
  const auto it = std::find(choices.begin(), choices.end(), *text);
  if (it != choices.end()) return static_cast<size_t>(it - choices.begin());
  Refuse(key, absl::StrCat(
                  "one of ",
                  absl::StrJoin(std::vector<std::string>(choices.begin(), choices.end()), ", ")));
  return fallback;
}

std::vector<double> OptionReader::Numbers(const std::string& key) {
  const std::string* text = Find(key);
  std::vector<double> values;
  if (text == nullptr) return values;
  for (const std::string& part : std::vector<std::string>(absl::StrSplit(*text, ';'))) {
    double value = 0;
    if (!absl::SimpleAtod(part, &value) || !(std::abs(value) <= kMostNumber)) {
      Refuse(key, "numbers with ';' between them");
      return {};
    }
    values.push_back(value);
  }
  return values;
}

std::vector<int32_t> OptionReader::Size(const std::string& key, std::vector<int32_t> fallback,
                                        size_t least, size_t most) {
  const std::string* text = Find(key);
  if (text == nullptr) return fallback;
  const std::vector<std::string> parts = absl::StrSplit(*text, 'x');
  std::vector<int32_t> size;
  for (const std::string& part : parts) {
    int32_t value = 0;
    if (!absl::SimpleAtoi(part, &value) || value < 1 || value > kMostPixels) break;
    size.push_back(value);
  }
  if (size.size() == parts.size() && size.size() >= least && size.size() <= most) return size;
  Refuse(key, absl::StrCat(most == 2    ? "WxH"
                           : least == 2 ? "WxH or WxHxS"
                                        : "WxHxS",
                           ", each from 1 to ", kMostPixels));
  return fallback;
}

absl::Status OptionReader::Finish() const {
  if (!status_.ok()) return status_;
  for (const auto& [key, value] : options_.options) {
    if (known_.contains(key)) continue;
    return absl::InvalidArgumentError(
        absl::StrCat("display \"", options_.name, "\": there is no option ", key, " (\"", value,
                     "\") here; there are ", absl::StrJoin(known_, ", ")));
  }
  return absl::OkStatus();
}

absl::StatusOr<DisplayInfo> ReadDisplayInfo(const DisplayOptions& options, OptionReader& reader) {
  DisplayInfo info;
  info.name = options.name;
  info.driver = options.driver;
  const double pitch = reader.Number("pitch_mm", 1, 1e-6, kMostNumber);
  info.geometry = ReadGeometry(reader, pitch);
  FrameLayout& layout = info.layout;
  layout.format =
      static_cast<PixelFormat>(reader.Choice("format", {"rgb888", "rgb332", "bitplanes3"}, 0));
  layout.sub_frames = static_cast<int32_t>(reader.Integer("sub_frames", 1, 1, 64));
  info.volumes_per_second = reader.Number("rate", 30, 0.5, 10'000);
  const double gamma = reader.Number("gamma", 1, 0.1, 10);
  const double brightness = reader.Number("brightness", 1, 1e-3, 1);
  const auto dither = static_cast<Dither>(reader.Choice("dither", {"none", "ordered"}, 1));
  const auto sampling = static_cast<Sampling>(reader.Choice("sampling", {"max", "weighted"}, 0));
  const absl::Status status = reader.Finish();
  if (!status.ok()) return status;

  const auto refused = [&](const absl::Status& why) {
    return absl::InvalidArgumentError(
        absl::StrCat("display \"", options.name, "\": ", why.message()));
  };
  if (const absl::Status valid = ValidateShape(info.geometry); !valid.ok()) return refused(valid);
  info.tone = MakeTone(gamma, brightness, dither, sampling);
  layout.slices = SliceCount(info.geometry);
  std::tie(layout.width, layout.height) =
      std::visit([](const auto& shape) { return std::pair(shape.width_px, shape.height_px); },
                 info.geometry.shape);
  if (layout.bytes() > kMostVolumeBytes) {
    return absl::InvalidArgumentError(absl::StrCat(
        "display \"", options.name, "\": a volume of ", layout.slices, " slices of ", layout.width,
        "x", layout.height, " pixels in ", layout.sub_frames, " sub-frames has ", layout.bytes(),
        " bytes; at most ", kMostVolumeBytes, " are possible"));
  }
  info.geometry.grid = DefaultGrid(info.geometry);
  if (const absl::Status valid = ValidateGeometry(info.geometry); !valid.ok())
    return refused(valid);
  return info;
}

Tone MakeTone(double gamma, double brightness, Dither dither, Sampling sampling) {
  Tone tone;
  tone.dither = dither;
  tone.sampling = sampling;
  for (size_t c = 1; c < tone.lut.size(); ++c) {
    const double light = 65535 * brightness * std::pow(static_cast<double>(c) / 255, gamma);
    tone.lut[c] = static_cast<uint16_t>(std::clamp(std::lround(light), 1L, 65535L));
  }
  return tone;
}

}  // namespace voxeld::display
