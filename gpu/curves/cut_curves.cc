// Cuts cubic Béziers into segments.
#include <algorithm>
#include <cmath>

#include "gpu/curves/cut.h"
#include "gpu/curves/mix_colors.h"

namespace voxeld::gpu::curves {
namespace {

constexpr int kMostHalvings = 40;

class Cutter {
 public:
  Cutter(const TileGrid& grid, double room, Cut& cut) : grid_(grid), room_(room), cut_(cut) {}

  // Adds the span; its colours run from `from` to `to` of the way between `colors`, both in 0 to 1.
  void Add(const Point p[4], double from, double to, const uint32_t* colors, int halvings) {
    const double square = SquareOfParts(p);
    if (!(square > 1) || IsOutside(p, 4, grid_, room_)) {
      Segment(p[0], p[3], from, to, colors);
      return;
    }
    // Equal parts suit a span that stays near the volume. Any other is halved, so that only the
    // parts near the volume are cut finely.
    if (halvings < kMostHalvings && !IsNear(p)) {
      Point left[4], right[4];
      Halve(p, left, right);
      const double middle = (from + to) / 2;
      Add(left, from, middle, colors, halvings + 1);
      Add(right, middle, to, colors, halvings + 1);
      return;
    }
    const auto left = static_cast<double>(kMostCurveSegments -
                                          std::min(kMostCurveSegments, cut_.vertices.size() / 2));
    const int parts =
        static_cast<int>(std::ceil(std::clamp(std::sqrt(square), 1.0, std::max(left, 1.0))));
    Point at = p[0];
    for (int i = 1; i <= parts; ++i) {
      const Point next = i == parts ? p[3] : PointOn(p, static_cast<double>(i) / parts);
      Segment(at, next, from + (to - from) * (i - 1) / parts, from + (to - from) * i / parts,
              colors);
      at = next;
    }
  }

 private:
  // Returns whether all control points are within the volume, or no farther from it than its width.
  bool IsNear(const Point p[4]) const {
    for (int a = 0; a < 3; ++a) {
      const double beyond = grid_.voxels[a] + room_;
      for (int i = 0; i < 4; ++i) {
        if (!(p[i].at[a] > -beyond && p[i].at[a] < grid_.voxels[a] + beyond)) return false;
      }
    }
    return true;
  }

  static void Halve(const Point p[4], Point left[4], Point right[4]) {
    const Point a = Mix(p[0], p[1], 0.5), b = Mix(p[1], p[2], 0.5), c = Mix(p[2], p[3], 0.5);
    const Point ab = Mix(a, b, 0.5), bc = Mix(b, c, 0.5), middle = Mix(ab, bc, 0.5);
    left[0] = p[0], left[1] = a, left[2] = ab, left[3] = middle;
    right[0] = middle, right[1] = bc, right[2] = c, right[3] = p[3];
  }

  void Segment(const Point& a, const Point& b, double from, double to, const uint32_t* colors) {
    cut_.vertices.push_back(SnapOf(a));
    cut_.vertices.push_back(SnapOf(b));
    if (colors == nullptr) return;
    cut_.colors.push_back(MixColors(colors[0], colors[1], from));
    cut_.colors.push_back(MixColors(colors[0], colors[1], to));
  }

  const TileGrid& grid_;
  const double room_;
  Cut& cut_;
};

}  // namespace

void CutCurves(const GeometryView& g, const std::vector<Point>& points, const TileGrid& grid,
               double room, Cut& cut) {
  cut.record.kind = PrimitiveKind::kSegments;
  cut.record.topology = Topology::kList;
  const size_t step = g.record.topology == Topology::kStrip ? 3 : 4;
  Cutter cutter(grid, room, cut);
  for (size_t first = 0; first + 4 <= points.size(); first += step) {
    const uint32_t ends[2] = {g.colors.empty() ? 0 : g.colors[first],
                              g.colors.empty() ? 0 : g.colors[first + 3]};
    cutter.Add(&points[first], 0, 1, g.colors.empty() ? nullptr : ends, 0);
  }
}

}  // namespace voxeld::gpu::curves
