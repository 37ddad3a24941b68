#include "tools/voxelctl/import/ply_values.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "tools/voxelctl/import/surface_builder.h"

namespace voxeld::voxelctl {
namespace {

static_assert(std::endian::native == std::endian::little, "values are read in place");

absl::string_view WithoutPrefix(absl::string_view name) {
  if (absl::StartsWith(name, "diffuse_")) name.remove_prefix(8);
  return name;
}

int ChannelByName(absl::string_view name) {
  name = WithoutPrefix(name);
  if (name == "red" || name == "r") return 0;
  if (name == "green" || name == "g") return 1;
  if (name == "blue" || name == "b") return 2;
  return -1;
}

// Returns 0 to 2 for a coordinate; 3 to 5 for one of the normal; −1 for neither.
int CoordinateByName(absl::string_view name) {
  static constexpr absl::string_view kCoordinates[6] = {"x", "y", "z", "nx", "ny", "nz"};
  for (int i = 0; i < 6; ++i) {
    if (name == kCoordinates[i]) return i;
  }
  return -1;
}

bool IsFloating(PlyType type) { return type == PlyType::kF32 || type == PlyType::kF64; }

double LargestOf(PlyType type) {
  switch (type) {
    case PlyType::kI8:
      return std::numeric_limits<int8_t>::max();
    case PlyType::kU8:
      return std::numeric_limits<uint8_t>::max();
    case PlyType::kI16:
      return std::numeric_limits<int16_t>::max();
    case PlyType::kU16:
      return std::numeric_limits<uint16_t>::max();
    case PlyType::kI32:
      return std::numeric_limits<int32_t>::max();
    case PlyType::kU32:
      return std::numeric_limits<uint32_t>::max();
    case PlyType::kF32:
    case PlyType::kF64:
      return 1;
  }
  return 1;
}

uint8_t PlyChannel(double value, double full_scale) {
  const double scaled = value / full_scale * 255 + 0.5;
  return static_cast<uint8_t>(std::isfinite(scaled) ? std::clamp(scaled, 0.0, 255.0) : 0.0);
}

// Reads one property of one entry. A list is skipped, and its value is its length: a count that is
// too large ends with the data, after at most a file's length.
bool ReadProperty(const PlyProperty& property, PlyValues* values, double* value) {
  if (!values->Next(property.is_list ? property.count_type : property.type, value)) return false;
  if (!property.is_list) return true;
  double ignored = 0;
  for (double i = 0; i < *value; ++i) {
    if (!values->Next(property.type, &ignored)) return false;
  }
  return true;
}

absl::Status CutOff(const SourceFile& file, absl::string_view what, uint64_t number,
                    uint64_t count) {
  return FileError(file, absl::StrCat(what, " ", number, " of ", count, " is cut off or no number"),
                   "the file is truncated or damaged");
}

}  // namespace

bool PlyValues::Next(PlyType type, double* value) {
  return format_ == PlyHeader::Format::kAscii ? NextWord(value) : NextBinary(type, value);
}

bool PlyValues::NextWord(double* value) {
  const size_t begin = rest_.find_first_not_of(" \t\r\n");
  if (begin == absl::string_view::npos) return false;
  rest_.remove_prefix(begin);
  const size_t end = std::min(rest_.find_first_of(" \t\r\n"), rest_.size());
  absl::string_view word = rest_.substr(0, end);
  rest_.remove_prefix(end);
  if (absl::StartsWith(word, "+")) word.remove_prefix(1);
  const auto result = std::from_chars(word.data(), word.data() + word.size(), *value);
  return result.ec == std::errc() && result.ptr == word.data() + word.size();
}

template <typename T>
double PlyValues::Take() {
  char bytes[sizeof(T)];
  std::memcpy(bytes, rest_.data(), sizeof(T));
  if (format_ == PlyHeader::Format::kBinaryBigEndian) std::reverse(bytes, bytes + sizeof(T));
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return static_cast<double>(value);
}

bool PlyValues::NextBinary(PlyType type, double* value) {
  const size_t size = PlySize(type);
  if (rest_.size() < size) return false;
  switch (type) {
    case PlyType::kI8:
      *value = Take<int8_t>();
      break;
    case PlyType::kU8:
      *value = Take<uint8_t>();
      break;
    case PlyType::kI16:
      *value = Take<int16_t>();
      break;
    case PlyType::kU16:
      *value = Take<uint16_t>();
      break;
    case PlyType::kI32:
      *value = Take<int32_t>();
      break;
    case PlyType::kU32:
      *value = Take<uint32_t>();
      break;
    case PlyType::kF32:
      *value = Take<float>();
      break;
    case PlyType::kF64:
      *value = Take<double>();
      break;
  }
  rest_.remove_prefix(size);
  return true;
}

PlyColors::PlyColors(const PlyElement& element) {
  for (size_t p = 0; p < element.properties.size(); ++p) {
    const PlyProperty& property = element.properties[p];
    const int channel = property.is_list ? -1 : ChannelByName(property.name);
    if (channel < 0 || at_[channel] >= 0) continue;
    at_[channel] = static_cast<int>(p);
    full_scale_[channel] = LargestOf(property.type);
    scales_[channel] = IsFloating(property.type)    ? Scale::kFractions
                       : PlySize(property.type) > 1 ? Scale::kWholeNumbers
                                                    : Scale::kOfType;
    is_known_ &= scales_[channel] == Scale::kOfType;
  }
}

int PlyColors::ChannelOf(size_t property) const {
  for (int channel = 0; channel < 3; ++channel) {
    if (at_[channel] == static_cast<int>(property)) return channel;
  }
  return -1;
}

void PlyColors::Reserve(size_t entries) {
  is_known_ ? colors_.reserve(entries) : numbers_.reserve(3 * entries);
}

void PlyColors::Add(const double (&channels)[3]) {
  if (is_known_) {
    colors_.push_back(ColorOf(channels));
    return;
  }
  for (int c = 0; c < 3; ++c) {
    numbers_.push_back(static_cast<float>(channels[c]));
    if (scales_[c] == Scale::kOfType || !std::isfinite(channels[c])) continue;
    double& most = scales_[c] == Scale::kWholeNumbers ? most_whole_ : most_fraction_;
    most = std::max(most, channels[c]);
  }
}

Rgb PlyColors::ColorOf(const double (&channels)[3]) const {
  return {PlyChannel(channels[0], full_scale_[0]), PlyChannel(channels[1], full_scale_[1]),
          PlyChannel(channels[2], full_scale_[2])};
}

std::vector<Rgb> PlyColors::Finish() && {
  if (is_known_) return std::move(colors_);
  for (int c = 0; c < 3; ++c) {
    if (scales_[c] == Scale::kFractions && most_fraction_ > 1) full_scale_[c] = 255;
    if (scales_[c] != Scale::kWholeNumbers) continue;
    if (most_whole_ <= 65535) full_scale_[c] = std::min(full_scale_[c], 65535.0);
    if (most_whole_ <= 255) full_scale_[c] = 255;
  }
  colors_.reserve(numbers_.size() / 3);
  for (size_t i = 0; i + 2 < numbers_.size(); i += 3)
    colors_.push_back(ColorOf({numbers_[i], numbers_[i + 1], numbers_[i + 2]}));
  return std::move(colors_);
}

absl::StatusOr<PlyVertices> ReadPlyVertices(const SourceFile& file, const PlyElement& vertex,
                                            bool attributes, PlyValues* values) {
  PlyColors colors(vertex);
  const size_t count = vertex.properties.size();
  std::vector<int> coordinates(count, -1);
  bool has[6] = {};
  for (size_t p = 0; p < count; ++p) {
    const int coordinate =
        vertex.properties[p].is_list ? -1 : CoordinateByName(vertex.properties[p].name);
    if (coordinate < 0 || has[coordinate]) continue;
    coordinates[p] = coordinate;
    has[coordinate] = true;
  }
  const bool normals = has[3] && has[4] && has[5];

  PlyVertices out;
  std::vector<size_t> numbers;  // indices of the properties that are attributes
  for (size_t p = 0; p < count; ++p) {
    const PlyProperty& property = vertex.properties[p];
    // A single channel or half of a normal is treated as any other number.
    if ((colors.found() && colors.ChannelOf(p) >= 0) ||
        (coordinates[p] >= 0 && (coordinates[p] < 3 || normals))) {
      continue;
    }
    if (property.is_list || !attributes) {
      ++out.others;
      continue;
    }
    numbers.push_back(p);
    out.attributes.push_back({property.name, {}});
    out.attributes.back().values.reserve(vertex.count);
  }
  out.positions.reserve(vertex.count);
  if (normals) out.normals.reserve(vertex.count);
  if (colors.found()) colors.Reserve(vertex.count);
  for (uint64_t i = 0; i < vertex.count; ++i) {
    double at[6] = {}, color[3] = {};
    for (size_t p = 0, number = 0; p < count; ++p) {
      double value = 0;
      if (!ReadProperty(vertex.properties[p], values, &value))
        return CutOff(file, "vertex", i, vertex.count);
      if (coordinates[p] >= 0) at[coordinates[p]] = value;
      if (number < numbers.size() && numbers[number] == p)
        out.attributes[number++].values.push_back(value);
      if (const int channel = colors.ChannelOf(p); channel >= 0) color[channel] = value;
    }
    out.positions.push_back({at[0], at[1], at[2]});
    if (normals) out.normals.push_back(UnitOrZero({at[3], at[4], at[5]}));
    if (colors.found()) colors.Add(color);
  }
  out.colors = std::move(colors).Finish();
  return out;
}

absl::Status SkipPlyElement(const SourceFile& file, const PlyElement& element, PlyValues* values) {
  if (element.properties.empty()) return absl::OkStatus();
  for (uint64_t i = 0; i < element.count; ++i) {
    for (const PlyProperty& property : element.properties) {
      double ignored = 0;
      if (!ReadProperty(property, values, &ignored)) {
        return CutOff(file, EscapeForTerminal(element.name), i, element.count);
      }
    }
  }
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
