// Curves and curved patches, cut into segments and triangles where they are drawn: in voxel space,
// so that the error is one of voxels whatever the transform: an eighth of one (cut_need.h). On the
// host, in IEEE double, in the order written there; every engine draws what comes out.
//
// Guarantee: segments are within an eighth of a voxel (kCurveError) of the curve, triangles within
// a quarter (kPatchError) of the patch, and they meet; so a thick curve is what lies within half
// its thickness of the curve, and a thin one goes along it, but for an eighth of a voxel, without
// gaps (EUCLIDEAN may have some) or beads.
#pragma once

#include <cstdint>
#include <vector>

#include "gpu/affine.h"
#include "gpu/curves/cut_need.h"
#include "gpu/delta.h"
#include "gpu/derived_bytes.h"
#include "gpu/primitives/fixed.h"
#include "gpu/primitives/grid.h"

namespace voxeld::gpu {

// As a source's arrays, of kSegments or kTriangles.
struct Cut {
  GeometryRecord record;
  std::vector<Int3> vertices;  // mapped and snapped
  std::vector<uint32_t> indices, colors;

  uint64_t bytes() const {
    return HeapBytes(sizeof(*this)) + HeapBytes(vertices.capacity() * sizeof(Int3)) +
           HeapBytes(indices.capacity() * sizeof(uint32_t)) +
           HeapBytes(colors.capacity() * sizeof(uint32_t));
  }
};

// `g`: IsCurved. `map` takes its coordinates to the voxels of `grid`. What lies outside of it is
// not cut finely. Of curves a list of segments, two vertices each; of patches triangles, indexed.
Cut CutCurved(const GeometryView& g, const Affine& map, const TileGrid& grid);

namespace curves {

// Whether the hull of control points is out of reach: all of it past one face of the volume,
// widened by `room` voxels.
bool IsOutside(const Point* points, int count, const TileGrid& grid, double room);
std::vector<Point> MapPoints(const GeometryView& g, const Affine& map);
Int3 SnapOf(const Point& p);
inline Point Mix(const Point& a, const Point& b, double t) {
  Point m;
  for (int i = 0; i < 3; ++i) m.at[i] = a.at[i] + (b.at[i] - a.at[i]) * t;
  return m;
}
// The point of a cubic Bézier at `t`, by de Casteljau; at 0 and 1 its ends.
Point PointOn(const Point p[4], double t);

void CutCurves(const GeometryView& g, const std::vector<Point>& points, const TileGrid& grid,
               double room, Cut& cut);
void CutPatches(const GeometryView& g, const std::vector<Point>& points, const TileGrid& grid,
                double room, Cut& cut);

}  // namespace curves
}  // namespace voxeld::gpu
