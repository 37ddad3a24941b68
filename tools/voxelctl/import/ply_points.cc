#include "tools/voxelctl/import/ply_points.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

namespace voxeld::voxelctl {
namespace {

static_assert(std::endian::native == std::endian::little, "values are read in place");

// Hands out the values of a file's body one by one, whichever way they are written.
class Values {
 public:
  Values(absl::string_view body, PlyHeader::Format format) : rest_(body), format_(format) {}

  // False at the end of the data, or where there is no number.
  bool Next(PlyType type, double* value) {
    return format_ == PlyHeader::Format::kAscii ? NextWord(value) : NextBinary(type, value);
  }

 private:
  bool NextWord(double* value) {
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
  double Take() {
    char bytes[sizeof(T)];
    std::memcpy(bytes, rest_.data(), sizeof(T));
    if (format_ == PlyHeader::Format::kBinaryBigEndian) std::reverse(bytes, bytes + sizeof(T));
    T value;
    std::memcpy(&value, bytes, sizeof(T));
    return static_cast<double>(value);
  }

  bool NextBinary(PlyType type, double* value) {
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

  absl::string_view rest_;
  PlyHeader::Format format_;
};

// Where a property's value goes: 0 to 2 position, 3 to 5 normal, 6 to 8 colour; −1 nowhere.
int Slot(absl::string_view name) {
  static constexpr absl::string_view kNames[9] = {"x",  "y",   "z",     "nx",  "ny",
                                                  "nz", "red", "green", "blue"};
  if (absl::StartsWith(name, "diffuse_")) name.remove_prefix(8);
  for (int i = 0; i < 9; ++i) {
    if (name == kNames[i]) return i;
  }
  if (name == "r") return 6;
  if (name == "g") return 7;
  if (name == "b") return 8;
  return -1;
}

double FullScale(PlyType type) {
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

uint8_t Channel(double value, double full_scale) {
  const double scaled = value / full_scale * 255 + 0.5;
  return static_cast<uint8_t>(std::isfinite(scaled) ? std::clamp(scaled, 0.0, 255.0) : 0.0);
}

// Reads one entry; `slots` and `scales` may be null for elements that are passed over.
bool ReadEntry(const PlyElement& element, const std::vector<int>& slots, Values* values,
               double (&out)[9]) {
  for (size_t p = 0; p < element.properties.size(); ++p) {
    const PlyProperty& property = element.properties[p];
    double value = 0;
    if (!values->Next(property.is_list ? property.count_type : property.type, &value)) return false;
    if (property.is_list) {
      // A count that is too great ends with the data, after at most a file's length.
      double ignored = 0;
      for (double i = 0; i < value; ++i) {
        if (!values->Next(property.type, &ignored)) return false;
      }
    } else if (!slots.empty() && slots[p] >= 0) {
      out[slots[p]] = value;
    }
  }
  return true;
}

Point3 UnitOrZero(double x, double y, double z) {
  const double length = std::sqrt(x * x + y * y + z * z);
  if (!(length > 1e-12) || !std::isfinite(length)) return {};
  return {x / length, y / length, z / length};
}

}  // namespace

absl::StatusOr<Model> ReadPlyPoints(const SourceFile& file, const PlyHeader& header) {
  Values values(absl::string_view(file.bytes).substr(header.body), header.format);
  const PlyElement* vertex = header.Find("vertex");
  double entry[9] = {};
  for (const PlyElement& element : header.elements) {
    if (&element == vertex) break;
    for (uint64_t i = 0; i < element.count; ++i) {
      if (element.properties.empty()) break;
      if (!ReadEntry(element, {}, &values, entry)) {
        return FileError(file, absl::StrCat("element ", i, " before the vertices is cut off"),
                         "the file is truncated or damaged");
      }
    }
  }

  std::vector<int> slots;
  bool has[9] = {};
  double scale[9] = {1, 1, 1, 1, 1, 1, 1, 1, 1};
  for (const PlyProperty& property : vertex->properties) {
    int slot = property.is_list ? -1 : Slot(property.name);
    if (slot >= 0 && has[slot]) slot = -1;
    slots.push_back(slot);
    if (slot < 0) continue;
    has[slot] = true;
    if (slot >= 6) scale[slot] = FullScale(property.type);
  }
  const bool normals = has[3] && has[4] && has[5];
  const bool colors = has[6] && has[7] && has[8];

  Part part;
  part.kind = Kind::kPoints;
  part.positions.reserve(vertex->count);
  if (normals) part.normals.reserve(vertex->count);
  if (colors) part.colors.reserve(vertex->count);
  for (uint64_t i = 0; i < vertex->count; ++i) {
    if (!ReadEntry(*vertex, slots, &values, entry)) {
      return FileError(
          file, absl::StrCat("vertex ", i, " of ", vertex->count, " is cut off or no number"),
          "the file is truncated or damaged");
    }
    if (!std::isfinite(entry[0]) || !std::isfinite(entry[1]) || !std::isfinite(entry[2])) {
      return FileError(
          file, absl::StrCat("vertex ", i, " is (", entry[0], ", ", entry[1], ", ", entry[2], ")"),
          "coordinates must be finite");
    }
    part.positions.push_back({entry[0], entry[1], entry[2]});
    if (normals) part.normals.push_back(UnitOrZero(entry[3], entry[4], entry[5]));
    if (colors) {
      part.colors.push_back(
          {Channel(entry[6], scale[6]), Channel(entry[7], scale[7]), Channel(entry[8], scale[8])});
    }
  }
  Model model;
  model.path = file.path;
  model.format = "PLY points";
  model.up = Up::kZ;
  model.lit_already = colors;
  model.parts.push_back(std::move(part));
  return model;
}

}  // namespace voxeld::voxelctl
