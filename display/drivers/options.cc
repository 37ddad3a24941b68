#include "display/drivers/options.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "display/geometry/footprint.h"

namespace voxeld::display {
namespace {

constexpr int32_t kMostPixels = 16384;
constexpr double kMostNumber = 1e6;
constexpr uint64_t kMostVolumeBytes = uint64_t{1} << 30;

Geometry ReadPlanar(OptionReader& reader, double pitch) {
  PlanarStack planar;
  planar.normal = static_cast<PlanarStack::Normal>(reader.Choice("normal", {"z", "y"}, 0));
  planar.positions_mm = reader.Numbers("positions_mm");
  const bool listed = !planar.positions_mm.empty();
  const double slice_pitch = reader.Number("slice_pitch_mm", pitch, 1e-6, kMostNumber);
  const auto count = static_cast<int32_t>(
      std::min<size_t>(planar.positions_mm.size(), static_cast<size_t>(kMostPixels)));
  const std::vector<int32_t> size =
      reader.Size("size", {128, 128, listed ? count : 128}, listed ? 2 : 3, 3);
  planar.width_px = size[0];
  planar.height_px = size[1];
  planar.pitch_u_mm = planar.pitch_v_mm = pitch;
  planar.thickness_mm = slice_pitch;
  if (listed) {
    if (reader.has("slice_pitch_mm")) {
      reader.Refuse("slice_pitch_mm", "left out where positions_mm are listed");
    }
    if (size.size() == 3 && static_cast<size_t>(size[2]) != planar.positions_mm.size()) {
      reader.Refuse("size", absl::StrCat("of ", planar.positions_mm.size(),
                                         " slices, as many as positions_mm, or WxH"));
    }
    if (std::adjacent_find(planar.positions_mm.begin(), planar.positions_mm.end(),
                           std::greater_equal<>()) != planar.positions_mm.end()) {
      reader.Refuse("positions_mm", "strictly ascending");
    }
  } else {
    const double middle = (size[2] - 1) / 2.0;
    for (int32_t s = 0; s < size[2]; ++s) {
      planar.positions_mm.push_back((s - middle) * slice_pitch);
    }
  }
  planar.mirror_u = reader.Flag("mirror_u", false);
  planar.mirror_v = reader.Flag("mirror_v", false);
  return Geometry{.shape = std::move(planar), .grid = {}};
}

Geometry ReadRotor(OptionReader& reader, double pitch) {
  Rotor rotor;
  const std::vector<int32_t> size = reader.Size("size", {128, 128}, 2, 2);
  rotor.width_px = size[0];
  rotor.height_px = size[1];
  rotor.slices_per_turn = static_cast<int32_t>(reader.Integer("slices", 360, 1, kMostPixels));
  rotor.clockwise = reader.Flag("clockwise", false);
  std::vector<double> eccentricity = reader.Numbers("eccentricity");
  if (eccentricity.empty()) eccentricity.push_back(0);
  if (eccentricity.size() > 16) {
    reader.Refuse("eccentricity", "a list of 1 to 16 panels");
    eccentricity.resize(16);
  }
  const size_t panels = eccentricity.size();
  const auto list = [&](const std::string& key) {
    std::vector<double> values = reader.Numbers(key);
    if (!values.empty() && values.size() != panels) {
      reader.Refuse(key, absl::StrCat("a list of ", panels, ", as eccentricity has panels"));
    }
    values.resize(panels);
    return values;
  };
  const std::vector<double> phase = list("panel_phase"), shift_u = list("shift_u"),
                            shift_v = list("shift_v");
  const bool mirror_u = reader.Flag("mirror_u", false), mirror_v = reader.Flag("mirror_v", false);
  for (size_t p = 0; p < panels; ++p) {
    if (!(phase[p] >= 0 && phase[p] < 1)) reader.Refuse("panel_phase", "turns from 0 to below 1");
    rotor.panels.push_back({.pitch_u_mm = pitch,
                            .pitch_v_mm = pitch,
                            .eccentricity_mm = eccentricity[p] * pitch,
                            .shift_u_mm = shift_u[p] * pitch,
                            .shift_v_mm = shift_v[p] * pitch,
                            .phase_turns = phase[p],
                            .mirror_u = mirror_u,
                            .mirror_v = mirror_v});
  }
  return Geometry{.shape = std::move(rotor), .grid = {}};
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
  const bool rotor = reader.Choice("geometry", {"planar", "rotor"}, 0) == 1;
  info.geometry = rotor ? ReadRotor(reader, pitch) : ReadPlanar(reader, pitch);
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

  info.tone = MakeTone(gamma, brightness, dither, sampling);
  layout.slices = SliceCount(info.geometry);
  if (const auto* planar = std::get_if<PlanarStack>(&info.geometry.shape)) {
    layout.width = planar->width_px;
    layout.height = planar->height_px;
  } else {
    layout.width = std::get<Rotor>(info.geometry.shape).width_px;
    layout.height = std::get<Rotor>(info.geometry.shape).height_px;
  }
  if (layout.bytes() > kMostVolumeBytes) {
    return absl::InvalidArgumentError(absl::StrCat(
        "display \"", options.name, "\": a volume of ", layout.slices, " slices of ", layout.width,
        "x", layout.height, " pixels in ", layout.sub_frames, " sub-frames has ", layout.bytes(),
        " bytes; at most ", kMostVolumeBytes, " are possible"));
  }
  info.geometry.grid = DefaultGrid(info.geometry);
  const absl::Status valid = ValidateGeometry(info.geometry);
  if (!valid.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat("display \"", options.name, "\": ", valid.message()));
  }
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
