// Items of drawables that fill space: blocks of tiles, in the box that may hold the drawable.
#pragma once

#include "gpu/primitives/grid.h"
#include "gpu/primitives/source.h"

namespace voxeld::gpu {

// Divides `box`, the part of the volume that may hold the drawable, into blocks of `tiles` tiles
// along an edge.
inline void SetBlocks(const Box3& box, int32_t tiles, Solid& solid, ImplicitPlace& place) {
  solid.bounds = box;
  place.edge = tiles * kTileSize;
  for (int a = 0; a < 3; ++a) {
    place.first[a] = box.lo[a] / place.edge;
    place.blocks[a] = IsEmpty(box) ? 0 : (box.hi[a] + place.edge - 1) / place.edge - place.first[a];
  }
}

VOXELD_HD inline uint32_t CountBlocks(const Source& source) {
  const int32_t* n = source.implicit.blocks;
  if (!source.solid.drawable) return 0;
  return static_cast<uint32_t>(n[0]) * static_cast<uint32_t>(n[1]) * static_cast<uint32_t>(n[2]);
}

// Returns the voxels of an item.
VOXELD_HD inline Box3 BlockOf(const Source& source, uint32_t i) {
  const ImplicitPlace& place = source.implicit;
  const uint32_t nx = static_cast<uint32_t>(place.blocks[0]),
                 ny = static_cast<uint32_t>(place.blocks[1]);
  const uint32_t at[3] = {i % nx, i / nx % ny, i / nx / ny};
  Box3 box;
  for (int a = 0; a < 3; ++a) {
    box.lo[a] = (place.first[a] + static_cast<int32_t>(at[a])) * place.edge;
    box.hi[a] = box.lo[a] + place.edge;
  }
  return Intersect(box, source.solid.bounds);
}

// Returns the voxels of the volume that lie in or around a box of the geometry's coordinates, with
// a margin of two voxels on each side.
inline Box3 VoxelsAround(const double low[3], const double high[3], const Affine& map,
                         const TileGrid& grid, double more) {
  const Box3 all{{0, 0, 0}, {grid.voxels[0], grid.voxels[1], grid.voxels[2]}};
  Box3 box;
  for (int a = 0; a < 3; ++a) {
    double least = map.m[a * 4 + 3], most = least;
    for (int b = 0; b < 3; ++b) {
      const double p = map.m[a * 4 + b] * low[b], q = map.m[a * 4 + b] * high[b];
      least += p < q ? p : q;
      most += p < q ? q : p;
    }
    constexpr double kFar = 1073741824.0;
    box.lo[a] = static_cast<int32_t>(FloorToInt(Clamp(least - more, -kFar, kFar))) - 2;
    box.hi[a] = static_cast<int32_t>(FloorToInt(Clamp(most + more, -kFar, kFar))) + 3;
  }
  return Intersect(all, box);
}

}  // namespace voxeld::gpu
