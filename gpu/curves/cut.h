// Cuts curves and curved patches into segments and triangles for drawing. It works in voxel space,
// so that the error is an eighth of a voxel whatever the transform (cut_need.h), on the host, in
// IEEE double, in the order of operations written there. Every engine draws the resulting pieces.
//
// Guarantee: segments are within an eighth of a voxel (kCurveError) of the curve, triangles are
// within a quarter (kPatchError) of the patch, and adjacent pieces meet. So a thick curve covers
// the points within half its thickness of the curve, and a thin one follows it, to within an eighth
// of a voxel, without gaps (EUCLIDEAN may have some) or beads.
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

// The arrays of a source, of kSegments or kTriangles.
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

// Requires: `g` IsCurved. `map` takes its coordinates to the voxels of `grid`. Parts outside the
// grid are not cut finely. Returns, for curves, a list of segments with two vertices each; for
// patches, indexed triangles.
Cut CutCurved(const GeometryView& g, const Affine& map, const TileGrid& grid);

namespace curves {

// Returns whether the hull of the control points is out of reach: all of it is past one face of the
// volume, widened by `room` voxels.
bool IsOutside(const Point* points, int count, const TileGrid& grid, double room);
std::vector<Point> MapPoints(const GeometryView& g, const Affine& map);
Int3 SnapOf(const Point& p);
inline Point Mix(const Point& a, const Point& b, double t) {
  Point m;
  for (int i = 0; i < 3; ++i) m.at[i] = a.at[i] + (b.at[i] - a.at[i]) * t;
  return m;
}
// Returns the point of a cubic Bézier at `t`, by de Casteljau; at 0 and 1 the end points.
Point PointOn(const Point p[4], double t);

void CutCurves(const GeometryView& g, const std::vector<Point>& points, const TileGrid& grid,
               double room, Cut& cut);
void CutPatches(const GeometryView& g, const std::vector<Point>& points, const TileGrid& grid,
                double room, Cut& cut);

}  // namespace curves
}  // namespace voxeld::gpu
