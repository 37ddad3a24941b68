// The voxels of a drawable that the CPU draws for the device (DrawnBy::kCpu).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "gpu/affine.h"
#include "gpu/assemble/scene.h"
#include "gpu/cpu/executor.h"
#include "gpu/primitives/grid.h"

namespace voxeld::gpu::cuda {

// The voxels by tile: item i of the drawable is the part that it covers of tiles[i], the voxels
// [begin[i], begin[i+1]). A voxel is its index in the tile, from bit 32 on, and its word.
struct CpuVoxels {
  std::vector<uint32_t> tiles;
  std::vector<uint64_t> begin = {0};
  std::vector<uint64_t> voxels;
  bool singular = false;
};

// `view` maps the scene to voxel space. Tiles with owned[tile] = 0 are left out.
CpuVoxels DrawOnCpu(const Drawable& drawable, const Affine& view, const TileGrid& grid,
                    std::span<const uint8_t> owned, Executor& executor);

}  // namespace voxeld::gpu::cuda
