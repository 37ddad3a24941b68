// Computes how finely curves and curved patches have to be cut, and whether the limits allow as
// many pieces. It uses a geometry alone and is valid for any map.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>

#include "gpu/affine.h"
#include "gpu/delta.h"

namespace voxeld::gpu {

// The greatest distance, in voxels, of a point of a curve from its segments, and of a patch from
// its triangles. Snapping to a unit comes on top.
inline constexpr double kCurveError = 0.125;
inline constexpr double kPatchError = 0.25;
// The limit for a patch along each of its sides, whatever its error.
inline constexpr int32_t kMostPatchPieces = 512;
// The limit for a geometry, whatever its error: when this many segments have been made, each
// further span becomes one segment; patches are cut so that the vertices do not exceed this, unless
// the four corners of each patch already do.
inline constexpr size_t kMostCurveSegments = 1u << 20;
inline constexpr size_t kMostPatchVertices = 1u << 20;

namespace curves {

struct Point {
  double at[3] = {};
};

// Returns |a − 2b + c|.
double SecondDifference(const Point& a, const Point& b, const Point& c);

// Returns, for a span's 4 points, the square of the number of equal parts that keeps the error
// within kCurveError. (The distance of n equal parts from the curve is at most max|B″|/(8n²), and
// |B″| is at most 6 times the greater of the two second differences of its control points.)
double SquareOfParts(const Point p[4]);
// The same for a patch's 16 points, along either side. (The distance of a patch from n × n squares
// of two triangles each is at most (|Suu| + 2|Suv| + |Svv|)/(8n²), with 6, 9 and 6 times the
// greatest differences of its control points.)
double SquareOfPatchParts(const Point p[16]);

}  // namespace curves

// An upper bound of what a geometry needs to be cut within its error. Parts outside the volume need
// less.
struct CutNeed {
  PrimitiveKind kind = PrimitiveKind::kCurves;
  double count = 0;  // spans, or patches
  // For curves: the parts beyond one per span, over all spans. For patches: the parts along each
  // side, for the patch that needs most.
  double parts = 0;

  // Requires: `g` IsCurved, and `positions` has the length that it states.
  static CutNeed Of(const GeometryRecord& g, std::span<const float> positions);

  // Returns the number of segments, or vertices, under a map that makes no distance more than
  // `stretch` times as long.
  double Pieces(double stretch) const;
  static size_t Most(PrimitiveKind kind) {
    return kind == PrimitiveKind::kPatches ? kMostPatchVertices : kMostCurveSegments;
  }
  // Returns whether the limits allow that many.
  bool IsMet(double stretch) const;
};

// Returns a factor by which, at most, the map makes distances longer.
double StretchOf(const Affine& map);

}  // namespace voxeld::gpu
