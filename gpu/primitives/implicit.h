// The general method: a surface P, bounded by Φ, in any colours, all given as expressions of the
// shape's own coordinates (gpu/implicit/field.h defines the voxels). The paper's "arbitrary 3D
// primitive Γ is a surface P bounded by a closed curve Φ".
//
// Its items are blocks of tiles. Regions that intervals prove to be empty are skipped, so the time
// is proportional to the surface.
//
// Guarantee: wherever P has different signs, in double precision, at the centres of neighbouring
// voxels, one of the two is covered, at any thickness and whatever regions intervals skip. Every
// built-in shape that is drawn by this method matches its own expression to within 10⁻⁴ voxel, rims
// of closed curves to within 0.02. Box, Sphere and Cylinder have methods of their own: they are the
// same solids, and their surfaces are nowhere farther than a voxel from the expression's.
#pragma once

#include <vector>

#include "gpu/implicit/field.h"
#include "gpu/implicit/hoist.h"
#include "gpu/implicit/tile.h"
#include "gpu/primitives/blocks.h"
#include "gpu/primitives/grid.h"
#include "gpu/primitives/source.h"

namespace voxeld::gpu {

struct Implicit {
  static constexpr PrimitiveKind kKind = PrimitiveKind::kImplicit;
  // The values for a tile (ImplicitPlace::reach) that are not a reach, which is the greatest value
  // that Field::ReachIn may return.
  static constexpr float kNothing = -1, kEverything = -2;

  // Sets the place of the shape. `map` takes the geometry's coordinates to voxel space. Items are
  // blocks of `tiles` tiles along an edge. Returns the words for `place.hoisted`.
  static std::vector<uint32_t> Place(const GeometryRecord& g, const uint32_t* program,
                                     const Affine& map, const TileGrid& grid, int32_t tiles,
                                     Solid& solid, ImplicitPlace& place) {
    solid = Solid::Of(map, /*keep_thin=*/false);
    const double det = Determinant(map);
    place.voxel = static_cast<float>(1.0 / CubeRoot(det < 0 ? -det : det));
    place.half = static_cast<float>(RadiusOf(g, map)) * 0.00390625f;
    SetBlocks(BoundsOf(g, map, grid, place.half), tiles, solid, place);
    uint32_t depends[3] = {};
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) depends[a] |= solid.inverse[a][b] != 0 ? 1u << b : 0;
    }
    return implicit::Hoist({program}, depends);
  }

  VOXELD_HD static uint32_t Count(const Source& source) { return CountBlocks(source); }

  template <class Emit>
  VOXELD_HD static void EmitTiles(const Source& source, uint32_t i, const TileGrid& grid,
                                  Emit&& emit) {
    const Box3 block = BlockOf(source, i);
    if (IsEmpty(block)) return;
    if (const float* const reach = source.implicit.reach; reach != nullptr) {
      if (reach[i] != kNothing) emit(grid.TileOf(block.lo[0], block.lo[1], block.lo[2]));
      return;
    }
#if defined(__CUDA_ARCH__)
    emit(grid.TileOf(block.lo[0], block.lo[1], block.lo[2]));  // the device's items are tiles
#else
    if (source.implicit.edge == kTileSize) {
      emit(grid.TileOf(block.lo[0], block.lo[1], block.lo[2]));
    } else {
      EmitTilesOfBlock(source, block, grid, emit);
    }
#endif
  }

  // Returns what is known about a tile, as an item. Requires: `box` is not empty.
  VOXELD_HD static float ReachOf(const implicit::Field& field, const Box3& box) {
    const implicit::BoxState state = field.StateOf(box);
    if (state.none) return kNothing;
    if (state.all) return kEverything;
    return field.solid() || field.half() == 0 ? 0 : field.ReachIn(box);
  }

  // On the host, for a box of at most a tile; the device computes the same voxels in another way.
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

  // Returns the bounds of the domain, with a margin for half a shell, for shapes that are drawn
  // thicker than they are, and for rounding.
  static Box3 BoundsOf(const GeometryRecord& g, const Affine& map, const TileGrid& grid,
                       float half) {
    if (g.params[6] == 0) {
      return {{0, 0, 0}, {grid.voxels[0], grid.voxels[1], grid.voxels[2]}};
    }
    double low[3], high[3];
    for (int a = 0; a < 3; ++a) {
      low[a] = static_cast<double>(g.params[a]);
      high[a] = static_cast<double>(g.params[3 + a]);
    }
    return VoxelsAround(low, high, map, grid, static_cast<double>(half));
  }
};

}  // namespace voxeld::gpu
