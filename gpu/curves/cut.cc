#include "gpu/curves/cut.h"

#include <cmath>

#include "gpu/primitives/source.h"

namespace voxeld::gpu {
namespace curves {

bool IsOutside(const Point* points, int count, const TileGrid& grid, double room) {
  for (int a = 0; a < 3; ++a) {
    bool below = true, above = true;
    for (int i = 0; i < count; ++i) {
      below = below && points[i].at[a] < -room;
      above = above && points[i].at[a] > grid.voxels[a] + room;
    }
    if (below || above) return true;
  }
  return false;
}

std::vector<Point> MapPoints(const GeometryView& g, const Affine& map) {
  std::vector<Point> points(g.record.vertex_count);
  for (size_t i = 0; i < points.size(); ++i) {
    const float* p = &g.positions[i * 3];
    const Point3d q =
        Map(map, static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2]));
    points[i] = {{q.x, q.y, q.z}};
  }
  return points;
}

Int3 SnapOf(const Point& p) {
  Int3 r;
  for (int a = 0; a < 3; ++a) r[a] = Snap(p.at[a]);
  return r;
}

Point PointOn(const Point p[4], double t) {
  const Point a = Mix(p[0], p[1], t), b = Mix(p[1], p[2], t), c = Mix(p[2], p[3], t);
  return Mix(Mix(a, b, t), Mix(b, c, t), t);
}

}  // namespace curves

Cut CutCurved(const GeometryView& g, const Affine& map, const TileGrid& grid) {
  Cut cut;
  cut.record = g.record;
  // A line extends by its radius and a voxel beyond its centre line.
  const double room = static_cast<double>(RadiusOf(g.record, map)) / kUnitsPerVoxel + 2;
  const std::vector<curves::Point> points = curves::MapPoints(g, map);
  if (g.record.kind == PrimitiveKind::kPatches) {
    curves::CutPatches(g, points, grid, room, cut);
  } else {
    curves::CutCurves(g, points, grid, room, cut);
  }
  cut.record.vertex_count = static_cast<uint32_t>(cut.vertices.size());
  cut.record.index_count = static_cast<uint32_t>(cut.indices.size());
  return cut;
}

}  // namespace voxeld::gpu
