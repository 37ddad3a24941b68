#include "gpu/curves/cut_need.h"

#include <algorithm>

namespace voxeld::gpu {
namespace curves {
namespace {

constexpr int kSide = 4;

double Twist(const Point& a, const Point& b, const Point& c, const Point& d) {
  double square = 0;
  for (int i = 0; i < 3; ++i) {
    const double t = (a.at[i] - b.at[i]) - (c.at[i] - d.at[i]);
    square += t * t;
  }
  return std::sqrt(square);
}

}  // namespace

double SecondDifference(const Point& a, const Point& b, const Point& c) {
  double square = 0;
  for (int i = 0; i < 3; ++i) {
    const double d = (a.at[i] - b.at[i]) + (c.at[i] - b.at[i]);
    square += d * d;
  }
  return std::sqrt(square);
}

double SquareOfParts(const Point p[4]) {
  const double bend =
      std::max(SecondDifference(p[0], p[1], p[2]), SecondDifference(p[1], p[2], p[3]));
  return 0.75 * bend / kCurveError;
}

double SquareOfPatchParts(const Point p[kSide * kSide]) {
  double along_u = 0, along_v = 0, twist = 0;
  for (int i = 0; i < kSide; ++i) {
    for (int k = 0; k + 2 < kSide; ++k) {
      const Point* row = p + i * kSide + k;
      along_u = std::max(along_u, SecondDifference(row[0], row[1], row[2]));
      const Point* column = p + k * kSide + i;
      along_v = std::max(along_v, SecondDifference(column[0], column[kSide], column[2 * kSide]));
    }
  }
  for (int v = 0; v + 1 < kSide; ++v) {
    for (int u = 0; u + 1 < kSide; ++u) {
      const Point* at = p + v * kSide + u;
      twist = std::max(twist, Twist(at[0], at[1], at[kSide], at[kSide + 1]));
    }
  }
  return (6 * along_u + 18 * twist + 6 * along_v) / (8 * kPatchError);
}

}  // namespace curves

CutNeed CutNeed::Of(const GeometryRecord& g, std::span<const float> positions) {
  CutNeed need{.kind = g.kind};
  const bool patches = g.kind == PrimitiveKind::kPatches;
  const size_t points = patches ? 16 : 4;
  const size_t step = patches ? 16 : g.topology == Topology::kStrip ? 3 : 4;
  for (size_t first = 0; (first + points) * 3 <= positions.size(); first += step) {
    curves::Point p[16];
    for (size_t i = 0; i < points; ++i) {
      for (size_t a = 0; a < 3; ++a)
        p[i].at[a] = static_cast<double>(positions[(first + i) * 3 + a]);
    }
    ++need.count;
    if (patches) {
      need.parts = std::max(need.parts, std::sqrt(curves::SquareOfPatchParts(p)));
    } else {
      need.parts += std::sqrt(curves::SquareOfParts(p));
    }
  }
  return need;
}

double CutNeed::Pieces(double stretch) const {
  const double all = parts * std::sqrt(stretch);
  if (kind != PrimitiveKind::kPatches) return count + all;
  const double line = std::max(1.0, std::ceil(all)) + 1;
  return count * line * line;
}

bool CutNeed::IsMet(double stretch) const {
  const bool fine =
      kind != PrimitiveKind::kPatches || parts * std::sqrt(stretch) <= kMostPatchPieces;
  return fine && Pieces(stretch) <= static_cast<double>(Most(kind));
}

// Returns the lesser of two norms, neither of which is less than the greatest stretch.
double StretchOf(const Affine& map) {
  double squares = 0, row = 0, column = 0;
  for (int r = 0; r < 3; ++r) {
    double along = 0, across = 0;
    for (int c = 0; c < 3; ++c) {
      squares += map.m[r * 4 + c] * map.m[r * 4 + c];
      along += std::fabs(map.m[r * 4 + c]);
      across += std::fabs(map.m[c * 4 + r]);
    }
    row = std::max(row, along);
    column = std::max(column, across);
  }
  return std::sqrt(std::min(squares, row * column));
}

}  // namespace voxeld::gpu
