#include "tools/bench/frame/line_set.h"

#include <algorithm>
#include <cstdlib>
#include <utility>

namespace voxeld::bench::frame {
namespace {

constexpr int64_t kUnits = 256;  // units per voxel

}  // namespace

uint32_t RandomColor(std::mt19937_64& random) {
  const auto color = static_cast<uint32_t>(random() >> 40);
  return color == 0 ? 1 : color;
}

// The range is half-open.
LineSet::Units LineSet::Between(Units lo, Units hi) {
  return lo + static_cast<Units>(random_() % static_cast<uint64_t>(hi - lo));
}

void LineSet::Add(const Units (&ends)[2][3]) {
  Units steps = 0;
  for (int a = 0; a < 3; ++a) {
    steps = std::max(steps, std::abs(ends[1][a] / kUnits - ends[0][a] / kUnits));
  }
  const uint32_t color = RandomColor(random_);
  for (const auto& end : ends) {
    for (const Units at : end) content_.positions.push_back(static_cast<float>(at) / kUnits);
    content_.colors.push_back(color);
  }
  voxels_ += static_cast<uint64_t>(steps) + 1;
}

void LineSet::AddUniform(const Extent& extent) {
  Units ends[2][3];
  for (auto& end : ends) {
    for (int a = 0; a < 3; ++a) end[a] = Between(extent.lo[a] * kUnits, extent.hi[a] * kUnits);
  }
  Add(ends);
}

void LineSet::AddOfLength(const Extent& extent, int32_t voxels) {
  int axes[3], count = 0;
  for (int a = 0; a < 3; ++a) {
    if (extent.hi[a] - extent.lo[a] >= voxels) axes[count++] = a;
  }
  const int major = axes[random_() % static_cast<uint64_t>(count)];
  const Units steps = (voxels - 1) * kUnits;
  Units ends[2][3];
  for (int a = 0; a < 3; ++a) {
    const Units lo = extent.lo[a] * kUnits, hi = extent.hi[a] * kUnits;
    if (a == major) {
      ends[0][a] = Between(lo, hi - steps);
      ends[1][a] = ends[0][a] + steps;
    } else {
      ends[0][a] = Between(lo, hi);
      ends[1][a] = Between(std::max(lo, ends[0][a] - steps), std::min(hi, ends[0][a] + steps + 1));
    }
  }
  if ((random_() & 1) != 0) std::swap(ends[0], ends[1]);
  Add(ends);
}

Content LineSet::Take() {
  content_.record.kind = gpu::PrimitiveKind::kSegments;
  content_.record.sampling = gpu::LineSampling::kThin;
  content_.record.color_mode = gpu::ColorMode::kPerVertex;
  voxels_ = 0;
  return std::exchange(content_, {});
}

}  // namespace voxeld::bench::frame
