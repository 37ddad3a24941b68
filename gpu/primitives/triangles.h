// Triangles, indexed or not: three corners each. They are one voxel wide by their rule
// (triangle.h); with a thickness, voxels within half of it are covered as well (thick_triangle.h).
#pragma once

#include "gpu/primitives/grid.h"
#include "gpu/primitives/source.h"
#include "gpu/primitives/thick_triangle.h"
#include "gpu/primitives/triangle.h"

namespace voxeld::gpu {

// Returns whether the triangle, or the points within `radius` units of it, may meet a box of
// voxels: separating axes in double, with a margin for rounding.
VOXELD_HD inline bool MayMeet(const Triangle& t, const Box3& box, int64_t radius = 0) {
  const double room = static_cast<double>(radius) + 2;
  double half[3], p[3][3], e[3][3];
  for (int a = 0; a < 3; ++a) {
    half[a] = (box.hi[a] - box.lo[a]) * 128.0 + room;
    const int64_t centre = (static_cast<int64_t>(box.lo[a]) + box.hi[a]) * kHalfVoxel;
    for (int i = 0; i < 3; ++i) p[i][a] = static_cast<double>(t.v[i][a] - centre);
  }
  for (int i = 0; i < 3; ++i) {
    for (int a = 0; a < 3; ++a) e[i][a] = p[(i + 1) % 3][a] - p[i][a];
  }
  double plane = 0, reach = 0;
  for (int a = 0; a < 3; ++a) {
    const int b = (a + 1) % 3, c = (a + 2) % 3;
    const double n = e[0][b] * e[1][c] - e[0][c] * e[1][b];
    plane += n * p[0][a];
    reach += Abs(n) * half[a];
    for (int i = 0; i < 3; ++i) {
      const double u = -e[i][c], w = e[i][b];
      const int k = (i + 2) % 3;
      const double edge = u * p[i][b] + w * p[i][c], third = u * p[k][b] + w * p[k][c];
      const double r = Abs(u) * half[b] + Abs(w) * half[c];
      if (Min(edge, third) > r || Max(edge, third) < -r) return false;
    }
  }
  return Abs(plane) <= reach;
}

struct Triangles {
  static constexpr PrimitiveKind kKind = PrimitiveKind::kTriangles;

  VOXELD_HD static uint32_t Count(const Source& source) { return source.corners() / 3; }

  VOXELD_HD static Triangle ItemOf(const Source& source, uint32_t i) {
    Triangle t;
    for (uint32_t corner = 0; corner < 3; ++corner) {
      const uint32_t vertex = source.VertexOf(i * 3 + corner);
      t.v[corner] = source.Vertex(vertex);
      t.color[corner] = source.ColorOf(vertex);
    }
    t.rule = source.record->rule;
    if (source.IsTextured()) {
      for (uint32_t corner = 0; corner < 3; ++corner) {
        source.PlaceOnTexture(source.VertexOf(i * 3 + corner), t.texture.at[corner]);
      }
      t.texture.texels = source.texels();
      t.texture.width = source.record->texture_width;
      t.texture.height = source.record->texture_height;
      t.texture.ChooseLevel(t.v);
    }
    return t;
  }

  template <class Emit>
  VOXELD_HD static void EmitTiles(const Source& source, uint32_t i, const TileGrid& grid,
                                  Emit&& emit) {
    const Triangle t = ItemOf(source, i);
    const Box3 bounds = BoundsOf(t, source.radius);
    const Box3 tiles = grid.TilesOf(bounds);
    const int32_t x = tiles.hi[0] - tiles.lo[0], y = tiles.hi[1] - tiles.lo[1],
                  z = tiles.hi[2] - tiles.lo[2];
    // For two tiles or fewer, testing does not pay off.
    if (static_cast<int64_t>(x) * y * z <= 2) return EmitTilesOfBox(bounds, grid, emit);
    EmitTilesOfBox(bounds, grid, [&](uint32_t tile) {
      if (MayMeet(t, grid.VoxelsOf(tile), source.radius)) emit(tile);
    });
  }

  template <class Emit>
  VOXELD_HD static void EmitVoxels(const Source& source, uint32_t i, const Box3& box, Emit&& emit) {
    const Triangle t = ItemOf(source, i);
    EmitTriangle(t, box, emit);
    if (source.radius > 0) EmitThick(t, source.radius, box, emit);
  }
};

}  // namespace voxeld::gpu
