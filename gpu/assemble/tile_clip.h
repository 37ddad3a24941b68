// What a layer is cut to (gpu/clip.h), in one tile.
#pragma once

#include <cstdint>

#include "gpu/clip.h"
#include "gpu/primitives/grid.h"

namespace voxeld::gpu {

// What cuts the tile of a box.
class TileClip {
 public:
  // The clip outlives it.
  TileClip(const VoxelClip& clip, const Box3& box);

  // All of the tile lies outside of one part of the clip.
  bool outside() const { return outside_; }
  // Uncovers what lies outside: words of the tile become 0.
  void Uncover(const TileGrid& grid, const Box3& box, uint32_t* words) const;

 private:
  bool outside_ = false;
  uint32_t half_space_count_ = 0, cylinder_count_ = 0;
  const VoxelHalfSpace* half_spaces_[kMaxHalfSpaces];
  const VoxelCylinder* cylinders_[kMaxClipCylinders];
};

}  // namespace voxeld::gpu
