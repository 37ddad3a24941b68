// The general method: a surface P, bounded by Φ, in any colours: expressions of the shape's own
// coordinates (gpu/implicit/field.h says which voxels that means). The paper's "arbitrary 3D primitive
// Γ is a surface P bounded by a closed curve Φ".
//
// Its items are blocks of tiles. What intervals say to be empty is not looked at, so that time follows
// the surface.
#pragma once

#include <vector>

#include "gpu/implicit/field.h"
#include "gpu/implicit/hoist.h"
#include "gpu/implicit/tile.h"
#include "gpu/primitives/grid.h"
#include "gpu/primitives/source.h"

namespace voxeld::gpu {

struct Implicit {
  static constexpr PrimitiveKind kKind = PrimitiveKind::kImplicit;
  // What is known of a tile (ImplicitPlace::reach) where it is not a reach, the most that Field::ReachIn
  // may answer.
  static constexpr float kNothing = -1, kEverything = -2;

  // Where it is looked for: `map` takes the geometry's coordinates to voxel space. Items are blocks of
  // `tiles` tiles along an edge. What is to be put into `place.hoisted` it answers.
  static std::vector<uint32_t> Place(const GeometryRecord& g, const uint32_t* program,
                                     const Affine& map, const TileGrid& grid, int32_t tiles,
                                     Solid& solid, ImplicitPlace& place) {
    solid = Solid::Of(map, /*keep_thin=*/false);
    const double det = Determinant(map);
    place.voxel = static_cast<float>(1.0 / CubeRoot(det < 0 ? -det : det));
    place.half = static_cast<float>(RadiusOf(g, map)) * 0.00390625f;
    place.edge = tiles * kTileSize;
    Box3 box{{0, 0, 0}, {grid.voxels[0], grid.voxels[1], grid.voxels[2]}};
    if (g.params[6] != 0) box = Intersect(box, BoundsOf(g, map, place.half));
    solid.bounds = box;
    uint32_t depends[3] = {};
    for (int a = 0; a < 3; ++a) {
      place.first[a] = box.lo[a] / place.edge;
      place.blocks[a] =
          IsEmpty(box) ? 0 : (box.hi[a] + place.edge - 1) / place.edge - place.first[a];
      for (int b = 0; b < 3; ++b) depends[a] |= solid.inverse[a][b] != 0 ? 1u << b : 0;
    }
    return implicit::Hoist({program}, depends);
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
      box.lo[a] = (place.first[a] + static_cast<int32_t>(at[a])) * place.edge;
      box.hi[a] = box.lo[a] + place.edge;
    }
    return Intersect(box, source.solid.bounds);
  }

  template <class Emit>
  VOXELD_HD static void EmitTiles(const Source& source, uint32_t i, const TileGrid& grid,
                                  Emit&& emit) {
    const Box3 block = BlockOf(source, i);
    if (IsEmpty(block)) return;
    if (const float* const reach = source.implicit.reach; reach != nullptr) {
      if (reach[i] != kNothing) emit(grid.TileOf(block.lo[0], block.lo[1], block.lo[2]));
      return;
    }
    EmitTilesOfBlock(source, block, grid, emit);
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
  template <class Emit>
  static void EmitTilesOfBlock(const Source& source, const Box3& block, const TileGrid& grid,
                               Emit&& emit) {
    const implicit::Field field(source);
    const implicit::BoxState state = field.StateOf(block);
    if (state.none) return;
    EmitTilesOfBox(block, grid, [&](uint32_t tile) {
      const Box3 part = Intersect(block, grid.VoxelsOf(tile));
      if (state.all || !field.StateOf(part).none) emit(tile);
    });
  }

  // Of the domain's corners, with room for half a shell, what is drawn thicker than it is, and rounding.
  static Box3 BoundsOf(const GeometryRecord& g, const Affine& map, float half) {
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
      const double shell = static_cast<double>(half);
      box.lo[a] = static_cast<int32_t>(FloorToInt(Clamp(low - shell, -kFar, kFar))) - 2;
      box.hi[a] = static_cast<int32_t>(FloorToInt(Clamp(high + shell, -kFar, kFar))) + 3;
    }
    return box;
  }
};

}  // namespace voxeld::gpu
