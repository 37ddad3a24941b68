// A drawable in voxel space, as flat arrays: every primitive reads its items from them.
#pragma once

#include <cstring>

#include "gpu/primitives/fixed.h"
#include "gpu/primitives/solid.h"
#include "gpu/records.h"
#include "gpu/word.h"

namespace voxeld::gpu {

VOXELD_HD inline Int3 SnapPoint(const Affine& map, const float* p) {
  const Point3d q =
      Map(map, static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2]));
  Int3 r;
  r[0] = Snap(q.x);
  r[1] = Snap(q.y);
  r[2] = Snap(q.z);
  return r;
}

// The place of an implicit shape (implicit.h).
struct ImplicitPlace {
  float voxel = 0;  // the edge of a voxel in the shape's units
  float half = 0;   // half the surface's thickness, voxels; 0: one voxel wide
  // Items: blocks of `edge` voxels.
  int32_t edge = 0, first[3] = {}, blocks[3] = {};
  const uint32_t* hoisted = nullptr;  // implicit/hoisted.h
  // The known state of each item, which must be a tile (implicit.h); null: computed when needed.
  const float* reach = nullptr;
  // On a device, the covered voxels of each item, as rows (cuda/covered_types.h); null: computed
  // when needed.
  const uint16_t* rows = nullptr;
};

struct Source {
  const GeometryRecord* record = nullptr;
  // record->vertex_count vertices, mapped and snapped; null: computed from `positions` and `map`
  // when needed.
  const Int3* vertices = nullptr;
  const float* positions = nullptr;
  Affine map;                         // the geometry's coordinates → voxel space
  const uint32_t* indices = nullptr;  // record->index_count
  const uint32_t* colors = nullptr;   // ColorCount(*record)
  uint32_t tint = 0x00FFFFFF;         // DrawableRecord
  int64_t radius = 0;                 // of points, segments and triangles, units; 0: one voxel
  Solid solid;                        // kBox, kSphere, kCylinder, kImplicit; for kFilled the bounds
  ImplicitPlace implicit;  // kImplicit, whose program is `indices`; for kFilled the blocks
  const uint32_t* inside = nullptr;  // kFilled: InsideRows (filled.h); null: computed each time
  // For each item, which must be a tile, whether anything in it is inside; null: computed from
  // `inside`.
  const uint8_t* inside_tiles = nullptr;

  // Corners are the vertices that indices name or, without indices, the vertices in order.
  VOXELD_HD uint32_t corners() const {
    return record->index_count != 0 ? record->index_count : record->vertex_count;
  }
  VOXELD_HD uint32_t VertexOf(uint32_t corner) const {
    return record->index_count != 0 ? indices[corner] : corner;
  }
  VOXELD_HD Int3 Vertex(uint32_t vertex) const {
    return vertices != nullptr ? vertices[vertex]
                               : SnapPoint(map, positions + static_cast<size_t>(vertex) * 3);
  }
  VOXELD_HD uint32_t ColorOf(uint32_t vertex) const {
    return Tinted(record->color_mode == ColorMode::kPerVertex ? colors[vertex] : record->color,
                  tint);
  }
  VOXELD_HD bool IsTextured() const { return record->texture_width != 0; }
  // Reads a vertex' place. Requires: a texture.
  VOXELD_HD void PlaceOnTexture(uint32_t vertex, float place[2]) const {
    std::memcpy(place, places() + static_cast<size_t>(vertex) * 2, 2 * sizeof(float));
  }
  VOXELD_HD const uint32_t* texels() const {
    return places() + static_cast<size_t>(record->vertex_count) * 2;
  }
  VOXELD_HD uint32_t UniformColor() const { return Tinted(record->color, tint); }

 private:
  VOXELD_HD const uint32_t* places() const {
    return record->color_mode == ColorMode::kPerVertex ? colors + record->vertex_count : colors;
  }
};

// Returns the cube root of x ≥ 0 in IEEE double: a guess from the exponent, then Newton's steps.
VOXELD_HD inline double CubeRoot(double x) {
  if (!(x > 0)) return 0;
  if (x > 1e300) return 1e100;
  uint64_t bits;
  std::memcpy(&bits, &x, sizeof(bits));
  bits = bits / 3 + 0x2A9F7893782DA1CEull;
  double y;
  std::memcpy(&y, &bits, sizeof(y));
  for (int i = 0; i < 6; ++i) y = y - (y * y * y - x) / (3.0 * (y * y));
  return y;
}

// Returns half the thickness, in units. `map`: from the geometry's coordinates to voxel space.
VOXELD_HD inline int64_t RadiusOf(const GeometryRecord& g, const Affine& map) {
  double thickness = static_cast<double>(g.thickness);
  if (g.thickness_unit == ThicknessUnit::kUnits) {
    const double det = Determinant(map);
    thickness = thickness * CubeRoot(det < 0 ? -det : det);
  }
  return Max<int64_t>(0, Snap(thickness / 2.0));
}

}  // namespace voxeld::gpu
