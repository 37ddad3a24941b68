// Decides whether a display's pixels are voxels, so that tiles can be packed as they are drawn: a
// planar stack along z at the grid's own resolution, where each pixel is one voxel, in the grid's x
// and y.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "display/api/slice_frame.h"
#include "display/geometry/footprint.h"

namespace voxeld::gpu::cuda {

struct PackedPlan {
  std::vector<int32_t> slice_of_z;  // by z of the grid: −begin; −1: none of the owned slices
  int32_t y0 = 0, y_step = 1;       // pixel v is the voxel y0 + y_step·v
  // Parts of the grid along z, [z_begin, z_end) voxels, with their slices, [begin, end) as above:
  // one after the other if slices are in the order of z or its reverse, otherwise a single group of
  // all. They lie at multiples of `kGroupGrain` voxels.
  struct Group {
    int32_t z_end = 0;
    int32_t begin = 0, end = 0;
  };
  std::vector<Group> groups;
  // The same as PackedView::least; empty unless the format has bit planes.
  std::vector<uint32_t> least;

  static constexpr int32_t kGroupGrain = 16;
  static constexpr int32_t kMostGroups = 8;

  // Returns the plan of slices [begin, end), with at most `most_groups` groups; nullopt if pixels
  // are not voxels, or if the tone of bit planes is not monotonic.
  static std::optional<PackedPlan> Of(const display::FootprintTable& table,
                                      const display::VoxelGrid& grid,
                                      const display::FrameLayout& layout, const display::Tone& tone,
                                      int32_t begin, int32_t end, int32_t most_groups);
};

}  // namespace voxeld::gpu::cuda
