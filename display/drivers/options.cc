#include "display/drivers/options.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <tuple>
#include <utility>
#include <variant>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "common/text/printable.h"
#include "common/text/suggest.h"
#include "display/drivers/geometry_options.h"
#include "display/geometry/footprint.h"

namespace voxeld::display {
namespace {

constexpr int32_t kMostPixels = 16384;
constexpr double kMostLength = 1e6;
constexpr uint64_t kMostVolumeBytes = uint64_t{1} << 30;
constexpr size_t kMostCurve = 256;

// Reads three numbers from `least` to `most`, or one for all.
std::array<double, 3> ReadThree(OptionReader& reader, const std::string& key, double fallback,
                                double least, double most) {
  std::array<double, 3> three = {fallback, fallback, fallback};
  const std::vector<double> values = reader.Numbers(key);
  if (values.empty()) return three;
  const bool right =
      (values.size() == 1 || values.size() == 3) &&
      std::all_of(values.begin(), values.end(), [&](double v) { return v >= least && v <= most; });
  if (!right) {
    reader.Refuse(key, absl::StrCat("a number from ", least, " to ", most, ", or three"));
    return three;
  }
  for (size_t i = 0; i < 3; ++i) three[i] = values[values.size() == 1 ? 0 : i];
  return three;
}

std::vector<double> ReadCurve(OptionReader& reader, const std::string& key) {
  std::vector<double> curve = reader.Numbers(key);
  if (curve.empty()) return curve;
  if (curve.size() < 2 || curve.size() > kMostCurve || curve.front() != 0 || curve.back() > 1 ||
      !std::is_sorted(curve.begin(), curve.end())) {
    reader.Refuse(key, absl::StrCat("2 to ", kMostCurve, " ascending numbers from 0 to at most 1"));
    return {};
  }
  return curve;
}

// Interpolates evenly spaced values at `at` (0 to 1).
double AlongCurve(const std::vector<double>& values, double at) {
  const double place = at * static_cast<double>(values.size() - 1);
  const size_t i = std::min(static_cast<size_t>(place), values.size() - 2);
  const double share = place - static_cast<double>(i);
  return values[i] + (values[i + 1] - values[i]) * share;
}

std::optional<Vec3> ReadVoxelPitch(OptionReader& reader) {
  if (!reader.has("voxel_mm")) return std::nullopt;
  const std::array<double, 3> pitch = ReadThree(reader, "voxel_mm", 1, 1e-6, kMostLength);
  return Vec3{pitch[0], pitch[1], pitch[2]};
}

// Returns the smallest grid of that pitch around the same middle.
VoxelGrid WithPitch(const VoxelGrid& grid, const Vec3& pitch) {
  VoxelGrid out;
  out.pitch_mm = pitch;
  const auto along = [](int32_t n, double old_pitch, double old_origin, double new_pitch,
                        int32_t& count, double& origin) {
    const double extent = n * old_pitch;
    count = static_cast<int32_t>(std::min(1e6, std::ceil(extent / new_pitch - 1e-6)));
    origin = old_origin + (extent - count * new_pitch) / 2;
  };
  along(grid.nx, grid.pitch_mm.x, grid.origin_mm.x, pitch.x, out.nx, out.origin_mm.x);
  along(grid.ny, grid.pitch_mm.y, grid.origin_mm.y, pitch.y, out.ny, out.origin_mm.y);
  along(grid.nz, grid.pitch_mm.z, grid.origin_mm.z, pitch.z, out.nz, out.origin_mm.z);
  return out;
}

}  // namespace

const std::string* OptionReader::Find(const std::string& key) {
  known_.insert(key);
  const auto it = options_.options.find(key);
  return it == options_.options.end() ? nullptr : &it->second;
}

void OptionReader::Refuse(const std::string& key, std::string_view right) {
  if (!status_.ok()) return;
  const auto it = options_.options.find(key);
  status_ = absl::InvalidArgumentError(
      absl::StrCat("display \"", options_.name, "\": ", key, " is \"",
                   it == options_.options.end() ? "" : EscapeQuoted(it->second), "\"; it must be ",
                   std::string(right)));
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

size_t OptionReader::Choice(const std::string& key, std::span<const std::string_view> choices,
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
    if (!absl::SimpleAtod(part, &value) || !(std::abs(value) <= kMostLength)) {
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
        absl::StrCat("display \"", options_.name, "\": unknown option ", EscapeQuoted(key), " (\"",
                     EscapeQuoted(value), "\")",
                     Suggestion(key, std::vector<std::string>(known_.begin(), known_.end()))));
  }
  return absl::OkStatus();
}

absl::StatusOr<DisplayInfo> ReadDisplayInfo(const DisplayOptions& options, OptionReader& reader) {
  DisplayInfo info;
  info.name = options.name;
  info.driver = options.driver;
  const double pitch = reader.Number("pitch_mm", 1, 1e-6, kMostLength);
  info.geometry = ReadGeometry(reader, pitch);
  FrameLayout& layout = info.layout;
  layout.format = static_cast<PixelFormat>(
      reader.Choice("format", {"rgb888", "rgb332", "bitplanes", "hub75", "planes24"}, 0));
  layout.bits = static_cast<int32_t>(reader.Integer("bits", 0, 1, 8));
  layout.sub_frames = static_cast<int32_t>(reader.Integer("sub_frames", 1, 1, 64));
  info.volumes_per_second = reader.Number("rate", 30, 0.5, 10'000);
  info.tone = MakeTone(ReadTone(reader));
  const std::optional<Vec3> voxel_mm = ReadVoxelPitch(reader);
  const absl::Status status = reader.Finish();
  if (!status.ok()) return status;

  const auto refused = [&](const absl::Status& why) {
    return absl::InvalidArgumentError(
        absl::StrCat("display \"", options.name, "\": ", why.message()));
  };
  if (const absl::Status valid = ValidateShape(info.geometry); !valid.ok()) return refused(valid);
  layout.slices = SliceCount(info.geometry);
  std::tie(layout.width, layout.height) =
      std::visit([](const auto& shape) { return std::pair(shape.width_px, shape.height_px); },
                 info.geometry.shape);
  if (const absl::Status valid = ValidateFormat(layout); !valid.ok()) return refused(valid);
  if (layout.bytes() > kMostVolumeBytes) {
    return absl::InvalidArgumentError(absl::StrCat(
        "display \"", options.name, "\": a volume of ", layout.slices, " slices of ", layout.width,
        "x", layout.height, " pixels in ", layout.sub_frames, " sub-frames has ", layout.bytes(),
        " bytes; at most ", kMostVolumeBytes, " are possible"));
  }
  info.geometry.grid = DefaultGrid(info.geometry);
  if (voxel_mm) info.geometry.grid = WithPitch(info.geometry.grid, *voxel_mm);
  if (const absl::Status valid = ValidateGeometry(info.geometry); !valid.ok())
    return refused(valid);
  return info;
}

ToneOptions ReadTone(OptionReader& reader) {
  ToneOptions tone;
  tone.gamma = ReadThree(reader, "gamma", 1, 0.1, 10);
  tone.white = ReadThree(reader, "white", 1, 1e-3, 1);
  tone.brightness = reader.Number("brightness", 1, 1e-3, 1);
  const char* const curves[] = {"curve_red", "curve_green", "curve_blue"};
  for (size_t i = 0; i < 3; ++i) tone.curves[i] = ReadCurve(reader, curves[i]);
  tone.dither = static_cast<Dither>(reader.Choice("dither", {"none", "ordered", "blue"}, 1));
  tone.sampling = static_cast<Sampling>(reader.Choice("sampling", {"max", "weighted"}, 0));
  tone.density = static_cast<Density>(reader.Choice("density", {"full", "even"}, 0));
  return tone;
}

Tone MakeTone(const ToneOptions& options) {
  Tone tone;
  tone.dither = options.dither;
  tone.sampling = options.sampling;
  tone.density = options.density;
  for (size_t channel = 0; channel < 3; ++channel) {
    Tone::Curve& curve = tone.lut[channel];
    const double full = 65535 * options.white[channel] * options.brightness;
    for (size_t c = 1; c < curve.size(); ++c) {
      const double at = static_cast<double>(c) / 255;
      const double share = options.curves[channel].empty()
                               ? std::pow(at, options.gamma[channel])
                               : AlongCurve(options.curves[channel], at);
      curve[c] = static_cast<uint16_t>(std::clamp(std::lround(full * share), 1L, 65535L));
    }
  }
  return tone;
}

}  // namespace voxeld::display
