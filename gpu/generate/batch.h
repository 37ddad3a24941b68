// The input of a generator: segments, a sampling, and the format of the voxels.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <ranges>
#include <span>
#include <variant>

#include "gpu/generate/segment.h"

namespace voxeld::gpu::generate {

// End points in voxels; the voxel of p is ⌊p⌋. Real coordinates are rounded to the nearest 2⁻¹⁶,
// halves up.
template <typename T>
struct Segment {
  std::array<T, 3> start = {}, end = {};
};

// A view of the caller's segments, which are not copied.
class Batch {
 public:
  // Segments of int32_t, float or double.
  template <std::ranges::contiguous_range Range>
  Batch(const Range& segments)  // NOLINT: converts, as a span does
      : segments_(std::span<const std::ranges::range_value_t<Range>>(segments)) {}

  size_t size() const {
    return std::visit([](const auto& s) { return s.size(); }, segments_);
  }
  // Calls `visit` with the span.
  template <typename Visit>
  auto With(Visit&& visit) const {
    return std::visit(visit, segments_);
  }

 private:
  std::variant<std::span<const Segment<int32_t>>, std::span<const Segment<float>>,
               std::span<const Segment<double>>>
      segments_;
};

// Rounds to the nearest unit, halves up; both steps are exact. NaN stays NaN.
inline double RoundedUnits(double voxels) {
  const double units = voxels * static_cast<double>(kUnits);
  const double whole = std::floor(units);
  return units - whole >= 0.5 ? whole + 1 : whole;
}
inline int64_t ToUnits(int32_t voxels) { return static_cast<int64_t>(voxels) * kUnits; }
inline int64_t ToUnits(double voxels) { return static_cast<int64_t>(RoundedUnits(voxels)); }
inline int64_t ToUnits(float voxels) { return ToUnits(static_cast<double>(voxels)); }

template <typename T>
FixedSegment ToFixed(const Segment<T>& segment) {
  FixedSegment g;
  for (size_t a = 0; a < 3; ++a) {
    g.s[a] = ToUnits(segment.start[a]);
    g.e[a] = ToUnits(segment.end[a]);
  }
  return g;
}

// The format of a voxel, in the machine's byte order, x first.
enum class Output : uint8_t {
  kI32x3,   // 12 bytes
  kF32x3,   // 12 bytes; coordinates within ±2²⁴
  kI16x3,   // 6 bytes
  kPacked,  // 4 bytes: x in bits 0 to 10, y in 11 to 21, z in 22 to 31; none negative
};

constexpr size_t BytesOf(Output output) {
  switch (output) {
    case Output::kI32x3:
    case Output::kF32x3:
      return 12;
    case Output::kI16x3:
      return 6;
    case Output::kPacked:
      return 4;
  }
  return 0;
}

struct Format {
  Sampling sampling = Sampling::kEuclidean;
  Output output = Output::kI32x3;
};

}  // namespace voxeld::gpu::generate
