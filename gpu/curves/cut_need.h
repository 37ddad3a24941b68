// How finely curves and curved patches have to be cut, and whether there are pieces enough: known
// of a geometry by itself, for any map.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>

#include "gpu/affine.h"
#include "gpu/delta.h"

namespace voxeld::gpu {

// No point of a curve is farther from its segments than this, nor of a patch from its triangles,
// voxels; snapping to a unit comes on top.
inline constexpr double kCurveError = 0.125;
inline constexpr double kPatchError = 0.25;
// Of a patch along each of its sides, whatever its error.
inline constexpr int32_t kMostPatchPieces = 512;
// Of a geometry, whatever its error: when so many segments have been made, each further span is
// one; patches are cut so that there are no more vertices, unless the four corners of each are more.
inline constexpr size_t kMostCurveSegments = 1u << 20;
inline constexpr size_t kMostPatchVertices = 1u << 20;

namespace curves {

struct Point {
  double at[3] = {};
};

// |a − 2b + c|.
double SecondDifference(const Point& a, const Point& b, const Point& c);

// Of a span's 4 points: the square of how many even parts are within the error. (A piece of n even
// parts is no farther from the curve than max|B″|/(8n²), and |B″| is at most 6 times the greater of
// the two second differences of its control points.)
double SquareOfParts(const Point p[4]);
// The same of a patch's 16 points, along either side. (Cut into n × n squares of two triangles each
// it is no farther from them than (|Suu| + 2|Suv| + |Svv|)/(8n²), with 6, 9 and 6 times the
// greatest differences of its control points.)
double SquareOfPatchParts(const Point p[16]);

}  // namespace curves

// What a geometry takes to be cut within its error, at most: what lies outside of the volume takes
// less.
struct CutNeed {
  PrimitiveKind kind = PrimitiveKind::kCurves;
  double count = 0;  // spans, or patches
  // Beyond one each, of all spans; of a patch along each side, of the one that takes most.
  double parts = 0;

  // `positions` as `g`, which IsCurved, states.
  static CutNeed Of(const GeometryRecord& g, std::span<const float> positions);

  // Under a map that makes no distance more than `stretch` times as long: segments, or vertices.
  double Pieces(double stretch) const;
  static size_t Most(PrimitiveKind kind) {
    return kind == PrimitiveKind::kPatches ? kMostPatchVertices : kMostCurveSegments;
  }
  // Whether that many are made.
  bool IsMet(double stretch) const;
};

// No distance becomes longer by more.
double StretchOf(const Affine& map);

}  // namespace voxeld::gpu
