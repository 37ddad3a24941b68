// Cuts bicubic Béziers into triangles: all patches of a geometry into the same number of parts
// along u and v, so that patches that share a side share its vertices.
#include <algorithm>
#include <cmath>

#include "gpu/curves/cut.h"
#include "gpu/curves/mix_colors.h"

namespace voxeld::gpu::curves {
namespace {

constexpr int kSide = 4;
constexpr int kPoints = kSide * kSide;

Point PointAt(const Point p[kPoints], double u, double v) {
  Point across[kSide];
  for (int i = 0; i < kSide; ++i) across[i] = PointOn(p + i * kSide, u);
  return PointOn(across, v);
}

}  // namespace

void CutPatches(const GeometryView& g, const std::vector<Point>& points, const TileGrid& grid,
                double room, Cut& cut) {
  cut.record.kind = PrimitiveKind::kTriangles;
  std::vector<size_t> near;
  double square = 0;
  for (size_t first = 0; first + kPoints <= points.size(); first += kPoints) {
    if (IsOutside(&points[first], kPoints, grid, room)) continue;
    near.push_back(first);
    square = std::max(square, SquareOfPatchParts(&points[first]));
  }
  if (near.empty()) return;
  const double most = std::floor(std::sqrt(static_cast<double>(kMostPatchVertices) /
                                           static_cast<double>(near.size()))) -
                      1;
  const int parts = static_cast<int>(
      std::clamp(std::ceil(std::sqrt(square)), 1.0, std::clamp(most, 1.0, 1.0 * kMostPatchPieces)));
  const uint32_t line = static_cast<uint32_t>(parts) + 1;
  for (const size_t first : near) {
    const uint32_t base = static_cast<uint32_t>(cut.vertices.size());
    for (uint32_t v = 0; v < line; ++v) {
      for (uint32_t u = 0; u < line; ++u) {
        const double tu = static_cast<double>(u) / parts, tv = static_cast<double>(v) / parts;
        cut.vertices.push_back(SnapOf(PointAt(&points[first], tu, tv)));
        if (g.colors.empty()) continue;
        const uint32_t* const c = &g.colors[first];
        cut.colors.push_back(MixColors(MixColors(c[0], c[3], tu), MixColors(c[12], c[15], tu), tv));
      }
    }
    for (uint32_t v = 0; v + 1 < line; ++v) {
      for (uint32_t u = 0; u + 1 < line; ++u) {
        const uint32_t at = base + v * line + u;
        for (const uint32_t i : {at, at + 1, at + line + 1, at, at + line + 1, at + line}) {
          cut.indices.push_back(i);
        }
      }
    }
  }
}

}  // namespace voxeld::gpu::curves
