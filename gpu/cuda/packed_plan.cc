#include "gpu/cuda/packed_plan.h"

#include <algorithm>
#include <iterator>

#include "gpu/slice/quantize.h"
#include "gpu/word.h"

namespace voxeld::gpu::cuda {
namespace {

// One bit each says which slice images of a slice differ.
constexpr int32_t kMostSubFrames = 32;

bool PutLeast(const display::FrameLayout& layout, const display::Tone& tone,
              std::vector<uint32_t>& least) {
  if (layout.format != display::PixelFormat::kBitPlanes) return true;
  const display::Tone::Curve& curve = tone.lut[0];
  if (tone.lut[1] != curve || tone.lut[2] != curve) return false;
  if (!std::is_sorted(curve.begin(), curve.end())) return false;
  const uint32_t sub_frames = static_cast<uint32_t>(layout.sub_frames);
  for (uint32_t sub = 0; sub < sub_frames; ++sub) {
    for (uint32_t v = 0; v < 8; ++v) {
      for (uint32_t u = 0; u < 8; ++u) {
        const uint32_t threshold = Threshold(tone.dither, u, v, sub, sub_frames);
        uint32_t level = 0;
        while (level < 256 && Quantize(curve[level], 2, threshold) == 0) ++level;
        least.push_back(level < 256 ? Spread3(level) : 1u << 24);
      }
    }
  }
  return true;
}

bool HasPackedForm(const display::FrameLayout& layout) {
  if (layout.format == display::PixelFormat::kBitPlanes) return layout.bits_per_channel() == 1;
  return layout.format == display::PixelFormat::kRgb888 ||
         layout.format == display::PixelFormat::kRgb332;
}

std::vector<PackedPlan::Group> GroupsOf(const std::vector<int32_t>& slice_of_z, int32_t slices,
                                        int32_t most) {
  const int32_t nz = static_cast<int32_t>(slice_of_z.size());
  std::vector<int32_t> owned;
  std::copy_if(slice_of_z.begin(), slice_of_z.end(), std::back_inserter(owned),
               [](int32_t s) { return s >= 0; });
  const bool up = std::is_sorted(owned.begin(), owned.end());
  const bool down = std::is_sorted(owned.rbegin(), owned.rend());
  if (!up && !down) return {{nz, 0, slices}};
  std::vector<PackedPlan::Group> groups;
  constexpr int32_t kGrain = PackedPlan::kGroupGrain;
  const int32_t planes = (nz + kGrain - 1) / kGrain;
  int32_t z = 0;
  for (int32_t g = 0; g < most; ++g) {
    const int32_t z_end = std::min(nz, (g + 1) * planes / most * kGrain);
    PackedPlan::Group group{z_end, 0, 0};
    for (; z < z_end; ++z) {
      const int32_t s = slice_of_z[static_cast<size_t>(z)];
      if (s < 0) continue;
      const bool first = group.end == 0;
      group.begin = first ? s : std::min(group.begin, s);
      group.end = first ? s + 1 : std::max(group.end, s + 1);
    }
    if (group.end == 0 && z_end < nz) continue;  // the next one includes this part
    groups.push_back(group);
  }
  return groups;
}

}  // namespace

std::optional<PackedPlan> PackedPlan::Of(const display::FootprintTable& table,
                                         const display::VoxelGrid& grid,
                                         const display::FrameLayout& layout,
                                         const display::Tone& tone, int32_t begin, int32_t end,
                                         int32_t most_groups) {
  if (tone.sampling != display::Sampling::kMax || table.inner_sets != 1 ||
      table.inner_axis != display::Axis::kY || table.width > grid.nx ||
      layout.sub_frames > kMostSubFrames || !HasPackedForm(layout)) {
    return std::nullopt;
  }
  PackedPlan plan;
  plan.slice_of_z.assign(static_cast<size_t>(grid.nz), -1);
  std::vector<uint8_t> taken(plan.slice_of_z.size());
  for (int32_t s = 0; s < table.slices; ++s) {
    int32_t z = -1;
    for (int32_t u = 0; u < table.width; ++u) {
      const auto list = table.Outer(s, u);
      if (list.size() != 1 || list[0].x != u || list[0].y != 0 || (u > 0 && list[0].z != z)) {
        return std::nullopt;
      }
      z = list[0].z;
    }
    if (z < 0 || taken[static_cast<size_t>(z)]++ != 0) return std::nullopt;
    if (s >= begin && s < end) plan.slice_of_z[static_cast<size_t>(z)] = s - begin;
  }
  for (int32_t v = 0; v < table.height; ++v) {
    const auto list = table.Inner(0, v);
    if (list.size() != 1 || list[0].x != 0 || list[0].z != 0) return std::nullopt;
    if (v == 0) plan.y0 = list[0].y;
    if (v == 1) plan.y_step = list[0].y - plan.y0;
    if (list[0].y != plan.y0 + plan.y_step * v) return std::nullopt;
  }
  if (plan.y_step != 1 && plan.y_step != -1) return std::nullopt;
  if (!PutLeast(layout, tone, plan.least)) return std::nullopt;
  plan.groups = GroupsOf(plan.slice_of_z, end - begin, most_groups);
  return plan;
}

}  // namespace voxeld::gpu::cuda
