// The general method: a surface P, bounded by Φ, in any colours: expressions of the shape's own
// coordinates (gpu/implicit/field.h says which voxels that means). The paper's "arbitrary 3D primitive
// Γ is a surface P bounded by a closed curve Φ".
//
// Its items are blocks of 2×2×2 tiles. What intervals say to be empty is not looked at, so that time
// follows the surface.
#pragma once

#include "gpu/implicit/field.h"
#include "gpu/implicit/tile.h"
#include "gpu/primitives/grid.h"
#include "gpu/primitives/source.h"

namespace voxeld::gpu {

struct Implicit {
  static constexpr PrimitiveKind kKind = PrimitiveKind::kImplicit;
  static constexpr int32_t kBlock = 2 * kTileSize;  // voxels along an edge of an item

  // Where it is looked for: `map` takes the geometry's coordinates to voxel space.
  static void Place(const GeometryRecord& g, const Affine& map, const TileGrid& grid, Solid& solid,
                    ImplicitPlace& place) {
    solid = Solid::Of(map, /*keep_thin=*/false);
    const double det = Determinant(map);
    const double scale = CubeRoot(det < 0 ? -det : det);
    place.voxel = static_cast<float>(1.0 / scale);
    place.half = static_cast<float>(RadiusOf(g, map)) * 0.00390625f;
    Box3 box{{0, 0, 0}, {grid.voxels[0], grid.voxels[1], grid.voxels[2]}};
    if (g.params[6] != 0) box = Intersect(box, BoundsOf(g, map));
    solid.bounds = box;
    for (int a = 0; a < 3; ++a) {
      place.first[a] = box.lo[a] / kBlock;
      place.blocks[a] = IsEmpty(box) ? 0 : (box.hi[a] + kBlock - 1) / kBlock - place.first[a];
    }
  }

  VOXELD_HD static uint32_t Count(const Source& source) {
    const int32_t* n = source.implicit.blocks;
    if (!source.solid.drawable) return 0;
    return static_cast<uint32_t>(n[0]) * static_cast<uint32_t>(n[1]) * static_cast<uint32_t>(n[2]);
  }

  // The voxels of an item.
  VOXELD_HD static Box3 BlockOf(const Source& source, uint32_t i) {
    const ImplicitPlace& place = source.implicit;
    const uint32_t nx = static_cast<uint32_t>(place.blocks[0]),
                   ny = static_cast<uint32_t>(place.blocks[1]);
    const uint32_t at[3] = {i % nx, i / nx % ny, i / nx / ny};
    Box3 box;
    for (int a = 0; a < 3; ++a) {
      box.lo[a] = (place.first[a] + static_cast<int32_t>(at[a])) * kBlock;
      box.hi[a] = box.lo[a] + kBlock;
    }
    return Intersect(box, source.solid.bounds);
  }

  template <class Emit>
  VOXELD_HD static void EmitTiles(const Source& source, uint32_t i, const TileGrid& grid,
                                  Emit&& emit) {
    const Box3 block = BlockOf(source, i);
    if (IsEmpty(block)) return;
    const implicit::Field field(source);
    const implicit::BoxState state = field.StateOf(block);
    if (state.none) return;
    EmitTilesOfBox(block, grid, [&](uint32_t tile) {
      const Box3 part = Intersect(block, grid.VoxelsOf(tile));
      if (state.all || !field.StateOf(part).none) emit(tile);
    });
  }

  // On the host, of a box of a tile at most; the device has its own way to the same voxels.
  template <class Emit>
  static void EmitVoxels(const Source& source, uint32_t, const Box3& box, Emit&& emit) {
    const Box3 part = Intersect(box, source.solid.bounds);
    if (IsEmpty(part)) return;
    const implicit::Field field(source);
    implicit::TileField(field, source, part).EmitVoxels(emit);
  }

 private:
  // Of the domain's corners, with room for rounding.
  static Box3 BoundsOf(const GeometryRecord& g, const Affine& map) {
    Box3 box;
    for (int a = 0; a < 3; ++a) {
      double low = map.m[a * 4 + 3], high = low;
      for (int b = 0; b < 3; ++b) {
        const double m = map.m[a * 4 + b];
        const double p = m * static_cast<double>(g.params[b]),
                     q = m * static_cast<double>(g.params[3 + b]);
        low += p < q ? p : q;
        high += p < q ? q : p;
      }
      constexpr double kFar = 1073741824.0;
      box.lo[a] = static_cast<int32_t>(FloorToInt(Clamp(low, -kFar, kFar))) - 2;
      box.hi[a] = static_cast<int32_t>(FloorToInt(Clamp(high, -kFar, kFar))) + 3;
    }
    return box;
  }
};

}  // namespace voxeld::gpu
