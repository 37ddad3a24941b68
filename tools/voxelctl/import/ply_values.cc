#include "tools/voxelctl/import/ply_values.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "tools/voxelctl/import/surface_builder.h"

namespace voxeld::voxelctl {
namespace {

static_assert(std::endian::native == std::endian::little, "values are read in place");

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

// Reads one property of one entry. A list is passed over, and its value is its length: a count that is too great ends
// with the data, after at most a file's length.
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
  const absl::string_view word = rest_.substr(0, end);
  rest_.remove_prefix(end);
  const std::optional<double> number = NumberOfWord(word);
  if (number) *value = *number;
  return number.has_value();
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

PointColumns PlyColumns(const PlyElement& element) {
  std::vector<std::string> names;
  for (const PlyProperty& property : element.properties)
    names.push_back(property.is_list ? "" : property.name);
  return PointColumnsByName(names);
}

PlyColors::PlyColors(const PlyElement& element, const PointColumns& columns) {
  for (size_t p = 0; p < columns.size(); ++p) {
    if (!columns[p] || !IsColor(*columns[p])) continue;
    found_ = true;
    const PlyType type = element.properties[p].type;
    const size_t channel =
        static_cast<size_t>(*columns[p]) - static_cast<size_t>(PointColumn::kRed);
    full_scale_[channel] = LargestOf(type);
    scales_[channel] = IsFloating(type)    ? Scale::kFractions
                       : PlySize(type) > 1 ? Scale::kWholeNumbers
                                           : Scale::kOfType;
    is_known_ &= scales_[channel] == Scale::kOfType;
  }
}

void PlyColors::Reserve(size_t entries) {
  is_known_ ? colors_.reserve(entries) : numbers_.reserve(3 * entries);
}

void PlyColors::Add(const PointRow& row) {
  const size_t red = static_cast<size_t>(PointColumn::kRed);
  const double channels[3] = {row[red], row[red + 1], row[red + 2]};
  if (is_known_) {
    AddColor(channels);
    return;
  }
  for (int c = 0; c < 3; ++c) {
    numbers_.push_back(static_cast<float>(channels[c]));
    if (scales_[c] == Scale::kOfType || !std::isfinite(channels[c])) continue;
    double& most = scales_[c] == Scale::kWholeNumbers ? most_whole_ : most_fraction_;
    most = std::max(most, channels[c]);
  }
}

void PlyColors::AddColor(const double (&channels)[3]) {
  const std::optional<Rgb> color = ColorOfChannels(
      channels[0] / full_scale_[0], channels[1] / full_scale_[1], channels[2] / full_scale_[2]);
  if (!color) unknown_.push_back(static_cast<uint32_t>(colors_.size()));
  colors_.push_back(color.value_or(kUnknownColor));
}

std::vector<Rgb> PlyColors::Finish(std::vector<uint32_t>* unknown) && {
  for (int c = 0; c < 3; ++c) {
    if (scales_[c] == Scale::kFractions && most_fraction_ > 1) full_scale_[c] = 255;
    if (scales_[c] != Scale::kWholeNumbers) continue;
    if (most_whole_ <= 65535) full_scale_[c] = std::min(full_scale_[c], 65535.0);
    if (most_whole_ <= 255) full_scale_[c] = 255;
  }
  if (!is_known_) colors_.reserve(numbers_.size() / 3);
  for (size_t i = 0; i + 2 < numbers_.size(); i += 3)
    AddColor({numbers_[i], numbers_[i + 1], numbers_[i + 2]});
  *unknown = std::move(unknown_);
  return std::move(colors_);
}

absl::StatusOr<PlyVertices> ReadPlyVertices(const SourceFile& file, const PlyElement& vertex,
                                            bool attributes, bool may_be_grey, PlyValues* values) {
  const PointLayout layout = PointLayout::Of(PlyColumns(vertex), may_be_grey);
  PlyColors colors(vertex, layout.shown);
  const size_t count = vertex.properties.size();
  const bool normals = layout.Has(PointColumn::kNormalX);
  const bool intensities = layout.Has(PointColumn::kIntensity);

  PlyVertices out;
  std::vector<size_t> numbers;  // the properties that are attributes
  for (const size_t p : layout.attributes) {
    const PlyProperty& property = vertex.properties[p];
    if (property.is_list || !attributes) continue;
    numbers.push_back(p);
    out.attributes.push_back({property.name, {}});
    out.attributes.back().values.reserve(vertex.count);
  }
  for (const size_t p : layout.others)
    out.others += attributes && !vertex.properties[p].is_list ? 0 : 1;
  out.positions.reserve(vertex.count);
  if (normals) out.normals.reserve(vertex.count);
  if (intensities) out.intensities.reserve(vertex.count);
  if (colors.found()) colors.Reserve(vertex.count);
  PointRow row = {};
  for (uint64_t i = 0; i < vertex.count; ++i) {
    for (size_t p = 0, number = 0; p < count; ++p) {
      double value = 0;
      if (!ReadProperty(vertex.properties[p], values, &value))
        return CutOff(file, "vertex", i, vertex.count);
      if (layout.shown[p]) row[static_cast<size_t>(*layout.shown[p])] = value;
      if (number < numbers.size() && numbers[number] == p)
        out.attributes[number++].values.push_back(value);
    }
    out.positions.push_back({row[0], row[1], row[2]});
    if (normals) out.normals.push_back(UnitOrZero({row[3], row[4], row[5]}));
    if (intensities) {
      out.intensities.push_back(
          static_cast<float>(row[static_cast<size_t>(PointColumn::kIntensity)]));
    }
    if (colors.found()) colors.Add(row);
  }
  out.colors = std::move(colors).Finish(&out.unknown);
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
