// The grid of tiles in which a volume is assembled, and the tiles that a line may touch.
#pragma once

#include "gpu/primitives/fixed.h"
#include "gpu/primitives/line.h"

namespace voxeld::gpu {

inline constexpr uint32_t kTileBits = 4;
inline constexpr int32_t kTileSize = 1 << kTileBits;
inline constexpr int32_t kTileVoxels = kTileSize * kTileSize * kTileSize;

// Whether an engine draws a tile. If the engine of an earlier rank also draws it, its lit voxels
// are counted there.
enum TileOwner : uint8_t { kNotOwned = 0, kOwned = 1, kOwnedAndCountedElsewhere = 2 };

struct TileGrid {
  int32_t voxels[3] = {};  // the volume; its last tiles may extend beyond it
  int32_t tiles[3] = {};
  // The layout of a tile's memory: a coordinate of an axis counts 2^shift words. Loops along an
  // axis are fastest if that axis comes first.
  uint32_t shift[3] = {};

  VOXELD_HD static TileGrid Of(int32_t nx, int32_t ny, int32_t nz, int fastest_axis = 0) {
    TileGrid g;
    uint32_t next = kTileBits;
    for (int a = 0; a < 3; ++a) {
      g.shift[a] = a == fastest_axis ? 0 : next;
      if (a != fastest_axis) next += kTileBits;
    }
    const int32_t n[3] = {nx, ny, nz};
    for (int a = 0; a < 3; ++a) {
      g.voxels[a] = n[a];
      g.tiles[a] = (n[a] + kTileSize - 1) / kTileSize;
    }
    return g;
  }
  VOXELD_HD uint32_t count() const {
    return static_cast<uint32_t>(tiles[0]) * static_cast<uint32_t>(tiles[1]) *
           static_cast<uint32_t>(tiles[2]);
  }
  VOXELD_HD uint32_t Index(int32_t i, int32_t j, int32_t k) const {
    return (static_cast<uint32_t>(k) * static_cast<uint32_t>(tiles[1]) + static_cast<uint32_t>(j)) *
               static_cast<uint32_t>(tiles[0]) +
           static_cast<uint32_t>(i);
  }
  VOXELD_HD void Coordinates(uint32_t tile, int32_t ijk[3]) const {
    ijk[0] = static_cast<int32_t>(tile % static_cast<uint32_t>(tiles[0]));
    tile /= static_cast<uint32_t>(tiles[0]);
    ijk[1] = static_cast<int32_t>(tile % static_cast<uint32_t>(tiles[1]));
    ijk[2] = static_cast<int32_t>(tile / static_cast<uint32_t>(tiles[1]));
  }
  // Returns the index of a voxel in its tile's memory.
  VOXELD_HD uint32_t IndexInTile(int32_t x, int32_t y, int32_t z) const {
    constexpr uint32_t kMask = kTileSize - 1;
    return (static_cast<uint32_t>(x) & kMask) << shift[0] |
           (static_cast<uint32_t>(y) & kMask) << shift[1] |
           (static_cast<uint32_t>(z) & kMask) << shift[2];
  }
  VOXELD_HD uint32_t TileOf(int32_t x, int32_t y, int32_t z) const {
    return Index(x / kTileSize, y / kTileSize, z / kTileSize);
  }
  // Returns the tile's voxels inside the volume.
  VOXELD_HD Box3 VoxelsOf(uint32_t tile) const {
    int32_t ijk[3];
    Coordinates(tile, ijk);
    Box3 b;
    for (int a = 0; a < 3; ++a) {
      b.lo[a] = ijk[a] * kTileSize;
      b.hi[a] = Min(voxels[a], b.lo[a] + kTileSize);
    }
    return b;
  }
  // Returns the tiles, half-open, that a box of voxels touches.
  VOXELD_HD Box3 TilesOf(const Box3& box) const {
    Box3 t;
    for (int a = 0; a < 3; ++a) {
      t.lo[a] = Clamp(box.lo[a], 0, voxels[a]) / kTileSize;
      t.hi[a] = (Clamp(box.hi[a], 0, voxels[a]) + kTileSize - 1) / kTileSize;
      if (box.hi[a] <= box.lo[a]) t.hi[a] = t.lo[a];
    }
    return t;
  }
};

// Calls `emit` for every tile that `box` touches.
template <class Emit>
VOXELD_HD void EmitTilesOfBox(const Box3& box, const TileGrid& grid, Emit&& emit) {
  const Box3 t = grid.TilesOf(box);
  for (int32_t k = t.lo[2]; k < t.hi[2]; ++k) {
    for (int32_t j = t.lo[1]; j < t.hi[1]; ++j) {
      for (int32_t i = t.lo[0]; i < t.hi[0]; ++i) emit(grid.Index(i, j, k));
    }
  }
}

// Returns how far voxels reach beyond the axis of a line, or of the capsule of `radius` units
// around it: the radius, half a voxel from a cell to its centre, and a margin for rounding.
VOXELD_HD inline double ReachOf(int64_t radius) {
  return radius > 0 ? static_cast<double>(radius) + kHalfVoxel + 2 : 2;
}
// Returns a box that holds these voxels.
VOXELD_HD inline Box3 BoundsOf(const Line& line, int64_t radius) {
  const double reach = ReachOf(radius);
  Box3 box;
  for (int a = 0; a < 3; ++a) {
    const double s = static_cast<double>(line.s[a]), e = static_cast<double>(line.e[a]);
    box.lo[a] = ToVoxel32(FloorToInt((Min(s, e) - reach) / 256.0));
    box.hi[a] = ToVoxel32(FloorToInt((Max(s, e) + reach) / 256.0) + 1);
  }
  return box;
}

// Calls `emit` for every tile that a voxel of the line, or of the capsule of `radius` units around
// it, may lie in, and few others: it goes slab by slab along the axis in which the line is longest.
template <class Emit>
VOXELD_HD void EmitTilesOfLine(const Line& line, int64_t radius, const TileGrid& grid,
                               Emit&& emit) {
  const double reach = ReachOf(radius);
  double s[3], e[3];
  int major = 0;
  for (int a = 0; a < 3; ++a) {
    s[a] = static_cast<double>(line.s[a]);
    e[a] = static_cast<double>(line.e[a]);
    if (Abs(line.e[a] - line.s[a]) > Abs(line.e[major] - line.s[major])) major = a;
  }
  const Box3 box = BoundsOf(line, radius);
  const Box3 all = grid.TilesOf(box);
  const double length = e[major] - s[major];
  for (int32_t slab = all.lo[major]; slab < all.hi[major]; ++slab) {
    // The part of the line's axis from which this slab is in reach.
    double t0 = 0, t1 = 1;
    if (length != 0) {
      const double near = slab * 4096.0 - reach - s[major];
      const double far = (slab + 1) * 4096.0 + reach - s[major];
      t0 = Clamp((length > 0 ? near : far) / length, 0.0, 1.0);
      t1 = Clamp((length > 0 ? far : near) / length, 0.0, 1.0);
    }
    Box3 part = box;
    part.lo[major] = slab * kTileSize;
    part.hi[major] = Min((slab + 1) * kTileSize, grid.voxels[major]);
    for (int a = 0; a < 3; ++a) {
      if (a == major) continue;
      const double p = s[a] + (e[a] - s[a]) * t0, q = s[a] + (e[a] - s[a]) * t1;
      part.lo[a] = Max(box.lo[a], ToVoxel32(FloorToInt((Min(p, q) - reach) / 256.0)));
      part.hi[a] = Min(box.hi[a], ToVoxel32(FloorToInt((Max(p, q) + reach) / 256.0) + 1));
    }
    EmitTilesOfBox(part, grid, emit);
  }
}

}  // namespace voxeld::gpu
