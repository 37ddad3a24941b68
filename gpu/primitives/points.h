// Points: the voxel ⌊P⌋ of each; with a thickness also the ball around P, a ball that fades, or a
// cube.
//
// Or cells, the elements of sparse voxels. Each point names a cell of the lattice of whole numbers
// in the geometry's own coordinates: the one that it lies in, whose middle is P. Besides the voxel
// of P, all voxels are covered whose centres' coordinates (Solid::Canonical) lie in the cell, its
// lower sides included. Cells side by side leave no gaps, whatever the transform: a voxel's centre
// lies in one of them. If cells are rotated and small, the voxel of a middle may have its own
// centre in the next cell; then it belongs to both.
//
// Guarantee: a thick point covers the voxels whose centres lie within half its thickness, and its
// own voxel; cells side by side are the solid box that they fill, without gaps and without voxels
// beside it.
#pragma once

#include "gpu/primitives/capsule.h"
#include "gpu/primitives/grid.h"
#include "gpu/primitives/source.h"

namespace voxeld::gpu {

struct Points {
  static constexpr PrimitiveKind kKind = PrimitiveKind::kPoints;

  // Returns the colour, faded from full at the middle to 0 at the radius, in proportion to the
  // square of the distance. Requires: `square` ≤ `whole`, the square of the radius.
  VOXELD_HD static uint32_t Faded(uint32_t rgb, double square, double whole) {
    const uint32_t left = static_cast<uint32_t>(FloorToInt((whole - square) * 255.0 / whole));
    return Tinted(rgb, left << 16 | left << 8 | left);
  }

  VOXELD_HD static uint32_t Count(const Source& source) { return source.corners(); }

  // Sets the fields that a source of cells needs besides its positions.
  VOXELD_HD static void PlaceCells(const Affine& map, Source& source) {
    source.map = map;
    source.solid = Solid::Of(map, /*keep_thin=*/false);
    double reach = 0;  // from the middle along the axes, in voxels
    for (int a = 0; a < 3; ++a) {
      const double* const row = &map.m[a * 4];
      reach = Max(reach, ((Abs(row[0]) + Abs(row[1])) + Abs(row[2])) / 2);
    }
    source.radius = source.solid.drawable ? Max<int64_t>(1, Snap(reach)) : 0;
  }

  VOXELD_HD static Line ItemOf(const Source& source, uint32_t i) {
    const uint32_t vertex = source.VertexOf(i);
    const uint32_t rgb = source.ColorOf(vertex);
    if (source.record->splat != Splat::kCell) {
      const Int3 at = source.Vertex(vertex);
      return {at, at, rgb, rgb};
    }
    double cell[3];
    CellOf(source, vertex, cell);
    const Point3d middle = Map(source.map, cell[0] + 0.5, cell[1] + 0.5, cell[2] + 0.5);
    Int3 at;
    at[0] = Snap(middle.x);
    at[1] = Snap(middle.y);
    at[2] = Snap(middle.z);
    return {at, at, rgb, rgb};
  }

  template <class Emit>
  VOXELD_HD static void EmitTiles(const Source& source, uint32_t i, const TileGrid& grid,
                                  Emit&& emit) {
    const Line point = ItemOf(source, i);
    if (source.radius > 0) return EmitTilesOfLine(point, source.radius, grid, emit);
    const Box3 volume{{0, 0, 0}, {grid.voxels[0], grid.voxels[1], grid.voxels[2]}};
    EmitVoxelOf(point.s, 0, volume,
                [&](int32_t x, int32_t y, int32_t z, uint32_t) { emit(grid.TileOf(x, y, z)); });
  }

  template <class Emit>
  VOXELD_HD static void EmitVoxels(const Source& source, uint32_t i, const Box3& box, Emit&& emit) {
    const Line point = ItemOf(source, i);
    EmitVoxelOf(point.s, point.color_s, box, emit);
    if (source.radius == 0) return;
    const Splat splat = source.record->splat;
    if (splat == Splat::kCell)
      return EmitCell(source, i, BoundsOf(point, source.radius), box, emit);
    if (splat == Splat::kBall) return EmitCapsule(Capsule::Of(point, source.radius), box, emit);
    EmitSplat(point, source.radius, splat, box, emit);
  }

 private:
  // Computes a vertex' cell, in whole numbers; coordinates are clamped to 2³⁰.
  VOXELD_HD static void CellOf(const Source& source, uint32_t vertex, double cell[3]) {
    for (int a = 0; a < 3; ++a) {
      constexpr double kMost = 1073741824.0;
      const double at = static_cast<double>(
          source.positions[static_cast<size_t>(vertex) * 3 + static_cast<size_t>(a)]);
      cell[a] = static_cast<double>(FloorToInt(Clamp(at, -kMost, kMost)));
    }
  }

  template <class Emit>
  VOXELD_HD static void EmitCell(const Source& source, uint32_t i, const Box3& bounds,
                                 const Box3& box, Emit&& emit) {
    const uint32_t vertex = source.VertexOf(i);
    const uint32_t rgb = source.ColorOf(vertex);
    double cell[3];
    CellOf(source, vertex, cell);
    const Box3 near = Intersect(bounds, box);
    const Solid& s = source.solid;
    for (int32_t z = near.lo[2]; z < near.hi[2]; ++z) {
      const float dz = s.Distance(2, z);
      for (int32_t y = near.lo[1]; y < near.hi[1]; ++y) {
        const float dy = s.Distance(1, y);
        for (int32_t x = near.lo[0]; x < near.hi[0]; ++x) {
          float q[3];
          s.Canonical(s.Distance(0, x), dy, dz, q);
          bool inside = true;
          for (int a = 0; a < 3; ++a) {
            const double at = static_cast<double>(q[a]);
            inside = inside && at >= cell[a] && at < cell[a] + 1;
          }
          if (inside) emit(x, y, z, rgb);
        }
      }
    }
  }

  // Emits voxels whose centres are within the radius: in any direction, or along each axis.
  template <class Emit>
  VOXELD_HD static void EmitSplat(const Line& point, int64_t radius, Splat splat, const Box3& box,
                                  Emit&& emit) {
    const Box3 near = Intersect(BoundsOf(point, radius), box);
    const double whole = static_cast<double>(radius) * static_cast<double>(radius);
    for (int32_t z = near.lo[2]; z < near.hi[2]; ++z) {
      const int64_t dz = z * kUnitsPerVoxel + kHalfVoxel - point.s[2];
      for (int32_t y = near.lo[1]; y < near.hi[1]; ++y) {
        const int64_t dy = y * kUnitsPerVoxel + kHalfVoxel - point.s[1];
        for (int32_t x = near.lo[0]; x < near.hi[0]; ++x) {
          const int64_t dx = x * kUnitsPerVoxel + kHalfVoxel - point.s[0];
          if (splat == Splat::kCube) {
            if (Max(Max(Abs(dx), Abs(dy)), Abs(dz)) <= radius) emit(x, y, z, point.color_s);
            continue;
          }
          const double w[3] = {static_cast<double>(dx), static_cast<double>(dy),
                               static_cast<double>(dz)};
          const double square = (w[0] * w[0] + w[1] * w[1]) + w[2] * w[2];
          if (square > whole) continue;
          const uint32_t rgb = Faded(point.color_s, square, whole);
          // A voxel that has faded to black is not covered.
          if (rgb != 0) emit(x, y, z, rgb);
        }
      }
    }
  }
};

}  // namespace voxeld::gpu
