#include "gpu/assemble/tile_clip.h"

#include <cstddef>

namespace voxeld::gpu {
namespace {

// In the order in which the tile of `box` lies in memory.
void UncoverOutside(const VoxelHalfSpace& half_space, const TileGrid& grid, const Box3& box,
                    uint32_t* words) {
  int axis[3];  // from the fastest
  for (int a = 0; a < 3; ++a) axis[grid.shift[a] / kTileBits] = a;
  const auto size = [&](int n) { return box.hi[axis[n]] - box.lo[axis[n]]; };
  const int64_t step = 2 * half_space.normal[axis[0]];
  int32_t voxel[3] = {box.lo[0], box.lo[1], box.lo[2]};
  for (int32_t k = 0; k < size(2); ++k) {
    for (int32_t j = 0; j < size(1); ++j) {
      voxel[axis[1]] = box.lo[axis[1]] + j;
      voxel[axis[2]] = box.lo[axis[2]] + k;
      int64_t value = ClipValue(half_space, voxel[0], voxel[1], voxel[2]);
      uint32_t* row = words + (static_cast<size_t>(k) * kTileSize + static_cast<size_t>(j)) *
                                  static_cast<size_t>(kTileSize);
      for (int32_t i = 0; i < size(0); ++i, value += step) {
        if (value < 0) row[i] = 0;
      }
    }
  }
}

void UncoverOutside(const VoxelCylinder& cylinder, const TileGrid& grid, const Box3& box,
                    uint32_t* words) {
  for (int32_t z = box.lo[2]; z < box.hi[2]; ++z) {
    for (int32_t y = box.lo[1]; y < box.hi[1]; ++y) {
      for (int32_t x = box.lo[0]; x < box.hi[0]; ++x) {
        uint32_t& word = words[grid.IndexInTile(x, y, z)];
        if (word != 0 && !IsInside(cylinder, x, y, z)) word = 0;
      }
    }
  }
}

}  // namespace

TileClip::TileClip(const VoxelClip& clip, const Box3& box) {
  for (uint32_t i = 0; i < clip.count; ++i) {
    const ClipSide side = SideOf(clip.half_spaces[i], box);
    if (side == ClipSide::kOutside) outside_ = true;
    if (side == ClipSide::kCut) half_spaces_[half_space_count_++] = &clip.half_spaces[i];
  }
  for (uint32_t i = 0; i < clip.cylinder_count; ++i) {
    const ClipSide side = SideOf(clip.cylinders[i], box);
    if (side == ClipSide::kOutside) outside_ = true;
    if (side == ClipSide::kCut) cylinders_[cylinder_count_++] = &clip.cylinders[i];
  }
}

void TileClip::Uncover(const TileGrid& grid, const Box3& box, uint32_t* words) const {
  for (uint32_t i = 0; i < half_space_count_; ++i) {
    UncoverOutside(*half_spaces_[i], grid, box, words);
  }
  for (uint32_t i = 0; i < cylinder_count_; ++i) {
    UncoverOutside(*cylinders_[i], grid, box, words);
  }
}

}  // namespace voxeld::gpu
