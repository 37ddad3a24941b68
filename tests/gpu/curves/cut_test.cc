// Tests dividing curves and patches into straight pieces: their distance from the true ones,
// computed with Bernstein polynomials at many places; that ends meet; and what is not divided
// finely.
#include "gpu/curves/cut.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "gtest/gtest.h"

namespace voxeld::gpu {
namespace {

constexpr int32_t kSize = 256;
constexpr double kSnapped = 0.0034;  // half a unit along each axis, in voxels

using P = std::array<double, 3>;

GeometryView View(const std::vector<float>& positions, PrimitiveKind kind, Topology topology,
                  const std::vector<uint32_t>& colors = {}) {
  GeometryView view;
  view.record.kind = kind;
  view.record.topology = topology;
  view.record.vertex_count = static_cast<uint32_t>(positions.size() / 3);
  view.record.color_mode = colors.empty() ? ColorMode::kUniform : ColorMode::kPerVertex;
  view.positions = positions;
  view.colors = colors;
  return view;
}

std::vector<float> RandomPoints(std::mt19937& random, int count, double low, double high) {
  std::uniform_real_distribution<double> number(low, high);
  std::vector<float> points;
  for (int i = 0; i < count * 3; ++i) points.push_back(static_cast<float>(number(random)));
  return points;
}

double Weight(int i, double t) {
  const double chosen[4] = {1, 3, 3, 1};
  return chosen[i] * std::pow(t, i) * std::pow(1 - t, 3 - i);
}

P CurveAt(const float* p, double t) {
  P at = {};
  for (size_t i = 0; i < 4; ++i) {
    for (size_t a = 0; a < 3; ++a) {
      at[a] += Weight(static_cast<int>(i), t) * static_cast<double>(p[i * 3 + a]);
    }
  }
  return at;
}

P PatchAt(const float* p, double u, double v) {
  P at = {};
  for (size_t i = 0; i < 16; ++i) {
    const double w = Weight(static_cast<int>(i % 4), u) * Weight(static_cast<int>(i / 4), v);
    for (size_t a = 0; a < 3; ++a) at[a] += w * static_cast<double>(p[i * 3 + a]);
  }
  return at;
}

P Minus(const P& a, const P& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
double Dot(const P& a, const P& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

P Voxels(const Int3& p) {
  P at;
  for (size_t a = 0; a < 3; ++a) at[a] = static_cast<double>(p.v[a]) / 256;
  return at;
}

double SegmentDistance(const P& p, const P& a, const P& b) {
  const P d = Minus(b, a), w = Minus(p, a);
  const double length2 = Dot(d, d);
  const double t = length2 == 0 ? 0 : std::clamp(Dot(w, d) / length2, 0.0, 1.0);
  const P rest = {w[0] - t * d[0], w[1] - t * d[1], w[2] - t * d[2]};
  return std::sqrt(Dot(rest, rest));
}

double TriangleDistance(const P& p, const P& a, const P& b, const P& c) {
  double nearest =
      std::min({SegmentDistance(p, a, b), SegmentDistance(p, b, c), SegmentDistance(p, c, a)});
  const P u = Minus(b, a), v = Minus(c, a), w = Minus(p, a);
  const double uu = Dot(u, u), uv = Dot(u, v), vv = Dot(v, v), wu = Dot(w, u), wv = Dot(w, v);
  const double det = uu * vv - uv * uv;
  if (det <= 0) return nearest;
  const double s = (vv * wu - uv * wv) / det, t = (uu * wv - uv * wu) / det;
  if (s < 0 || t < 0 || s + t > 1) return nearest;
  const P rest = {w[0] - s * u[0] - t * v[0], w[1] - s * u[1] - t * v[1],
                  w[2] - s * u[2] - t * v[2]};
  return std::min(nearest, std::sqrt(Dot(rest, rest)));
}

TEST(CutCurves, SegmentsStayWithinTheStatedErrorAndMeet) {
  std::mt19937 random(1);
  double worst = 0;
  for (int round = 0; round < 60; ++round) {
    const std::vector<float> points = RandomPoints(random, 7, 0, kSize);
    const Cut cut = CutCurved(View(points, PrimitiveKind::kCurves, Topology::kStrip), Affine(),
                              TileGrid::Of(kSize, kSize, kSize));
    ASSERT_EQ(cut.record.kind, PrimitiveKind::kSegments);
    ASSERT_EQ(cut.record.topology, Topology::kList);
    ASSERT_EQ(cut.record.vertex_count, cut.vertices.size());
    for (size_t i = 2; i < cut.vertices.size(); i += 2) {
      ASSERT_EQ(Voxels(cut.vertices[i]), Voxels(cut.vertices[i - 1])) << "they meet";
    }
    for (int sample = 0; sample <= 600; ++sample) {
      const P p = CurveAt(&points[sample < 300 ? 0 : 9], sample % 300 / 300.0);
      double nearest = 1e9;
      for (size_t i = 0; i < cut.vertices.size(); i += 2) {
        nearest = std::min(
            nearest, SegmentDistance(p, Voxels(cut.vertices[i]), Voxels(cut.vertices[i + 1])));
      }
      worst = std::max(worst, nearest);
    }
  }
  EXPECT_LE(worst, kCurveError + kSnapped);
  EXPECT_GT(worst, kCurveError / 4) << "finer than necessary";
}

TEST(CutCurves, ErrorIsOfVoxelsWhateverTheTransform) {
  const std::vector<float> points = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
  const auto segments = [&](double scale) {
    Affine map;
    map.m[0] = map.m[5] = map.m[10] = scale;
    return CutCurved(View(points, PrimitiveKind::kCurves, Topology::kList), map,
                     TileGrid::Of(kSize, kSize, kSize))
               .vertices.size() /
           2;
  };
  EXPECT_EQ(segments(0.05), 1u);
  // |second difference| is the scale here: n = ⌈√(6·scale·√2)⌉.
  EXPECT_EQ(segments(1), 3u);
  EXPECT_EQ(segments(100), 30u);
}

TEST(CutCurves, WhatIsFarAwayCostsLittleAndWhatIsNearIsTheSame) {
  // It passes through the volume on its way between far ends.
  const std::vector<float> points = {-1e6f, -1e6f, 100, 0, 0, 100, 300, 200, 100, 1e6f, 1e6f, 100};
  const Cut cut = CutCurved(View(points, PrimitiveKind::kCurves, Topology::kList), Affine(),
                            TileGrid::Of(kSize, kSize, kSize));
  EXPECT_LT(cut.vertices.size(), 2000u);
  int inside = 0;
  for (int sample = 0; sample <= 2'000'000; ++sample) {
    const P p = CurveAt(points.data(), sample / 2e6);
    if (p[0] < 0 || p[1] < 0 || p[0] > kSize || p[1] > kSize) continue;
    ++inside;
    double nearest = 1e9;
    for (size_t i = 0; i < cut.vertices.size(); i += 2) {
      nearest = std::min(nearest,
                         SegmentDistance(p, Voxels(cut.vertices[i]), Voxels(cut.vertices[i + 1])));
    }
    ASSERT_LE(nearest, kCurveError + kSnapped);
  }
  EXPECT_GT(inside, 10);
  const std::vector<float> away = {-900, 0, 0, -800, 900, 0, -700, -900, 0, -600, 0, 0};
  EXPECT_EQ(CutCurved(View(away, PrimitiveKind::kCurves, Topology::kList), Affine(),
                      TileGrid::Of(kSize, kSize, kSize))
                .vertices.size(),
            2u);
}

TEST(CutCurves, FarHandlesBetweenNearEndsCostNoPrecision) {
  for (const float far : {3000.0f, 1e6f}) {
    const std::vector<float> points = {10, 100, 100, 10, far, 100, 240, -far, 100, 240, 150, 100};
    const Cut cut = CutCurved(View(points, PrimitiveKind::kCurves, Topology::kList), Affine(),
                              TileGrid::Of(kSize, kSize, kSize));
    EXPECT_LT(cut.vertices.size(), 20'000u);
    int inside = 0;
    double worst = 0;
    for (int sample = 0; sample <= 1'000'000; ++sample) {
      const P p = CurveAt(points.data(), sample / 1e6);
      if (p[1] < 0 || p[1] > kSize) continue;
      if (sample % 20 != 0 && far < 1e5f) continue;
      ++inside;
      double nearest = 1e9;
      for (size_t i = 0; i < cut.vertices.size(); i += 2) {
        nearest = std::min(
            nearest, SegmentDistance(p, Voxels(cut.vertices[i]), Voxels(cut.vertices[i + 1])));
      }
      worst = std::max(worst, nearest);
    }
    EXPECT_GT(inside, 50);
    EXPECT_LE(worst, kCurveError + kSnapped);
  }
}

TEST(CutCurves, ThereIsAnEndToThem) {
  std::vector<float> points;
  for (int i = 0; i < 20'000; ++i) {
    for (const float c :
         {0.0f, 0.0f, 0.0f, 400.0f, 400.0f, 0.0f, -200.0f, 400.0f, 0.0f, 200.0f, 0.0f, 0.0f}) {
      points.push_back(c);
    }
  }
  const Cut cut = CutCurved(View(points, PrimitiveKind::kCurves, Topology::kList), Affine(),
                            TileGrid::Of(kSize, kSize, kSize));
  EXPECT_LE(cut.vertices.size() / 2, kMostCurveSegments + 20'000);
}

TEST(CutCurves, ColorsRunFromJointToJoint) {
  const std::vector<float> points = {0, 0, 0, 60, 200, 0, 160, -200, 0, 220, 0, 0};
  const std::vector<uint32_t> colors = {0x000000, 0x123456, 0x654321, 0xFF8000};
  const Cut cut = CutCurved(View(points, PrimitiveKind::kCurves, Topology::kList, colors), Affine(),
                            TileGrid::Of(kSize, kSize, kSize));
  ASSERT_EQ(cut.colors.size(), cut.vertices.size());
  EXPECT_EQ(cut.colors.front(), 0x000000u);
  EXPECT_EQ(cut.colors.back(), 0xFF8000u);
  for (size_t i = 1; i < cut.colors.size(); ++i) EXPECT_GE(cut.colors[i], cut.colors[i - 1]);
}

TEST(CutPatches, TrianglesStayWithinTheStatedErrorAndNeighboursMeet) {
  std::mt19937 random(2);
  double worst = 0;
  for (int round = 0; round < 12; ++round) {
    std::vector<float> points = RandomPoints(random, 32, 60, 140);
    // The second begins where the first ends: its row v = 0 is the other's v = 1.
    for (size_t i = 0; i < 12; ++i) points[48 + i] = points[36 + i];
    const Cut cut = CutCurved(View(points, PrimitiveKind::kPatches, Topology::kList), Affine(),
                              TileGrid::Of(kSize, kSize, kSize));
    ASSERT_EQ(cut.record.kind, PrimitiveKind::kTriangles);
    ASSERT_EQ(cut.record.index_count, cut.indices.size());
    const size_t each = cut.vertices.size() / 2;
    const auto line = static_cast<size_t>(std::lround(std::sqrt(static_cast<double>(each))));
    for (size_t u = 0; u < line; ++u) {
      EXPECT_EQ(Voxels(cut.vertices[each + u]), Voxels(cut.vertices[each - line + u]));
    }
    for (int sample = 0; sample < 150; ++sample) {
      const double u = std::uniform_real_distribution<double>(0, 1)(random);
      const double v = std::uniform_real_distribution<double>(0, 1)(random);
      const P p = PatchAt(points.data(), u, v);
      double nearest = 1e9;
      for (size_t i = 0; i < cut.indices.size() / 2; i += 3) {
        const P a = Voxels(cut.vertices[cut.indices[i]]);
        if (std::abs(a[0] - p[0]) > 30 || std::abs(a[1] - p[1]) > 30) continue;
        nearest = std::min(nearest, TriangleDistance(p, a, Voxels(cut.vertices[cut.indices[i + 1]]),
                                                     Voxels(cut.vertices[cut.indices[i + 2]])));
      }
      worst = std::max(worst, nearest);
    }
  }
  EXPECT_LE(worst, kPatchError + kSnapped);
  EXPECT_GT(worst, kPatchError / 20) << "finer than necessary";
}

// Returns any rotation, stretch and shear that keeps places within 1 of the origin in the volume.
Affine RandomMap(std::mt19937& random) {
  std::uniform_real_distribution<double> number(-1, 1);
  const double scale = std::pow(2, 3 + 2 * number(random));
  Affine map;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) map.m[r * 4 + c] = scale * number(random);
    map.m[r * 4 + 3] = kSize / 2;
  }
  return map;
}

TEST(CutNeeds, HoldWhatCuttingTakesUnderAnyMap) {
  std::mt19937 random(4);
  double all_said = 0, all_made = 0;
  for (int round = 0; round < 200; ++round) {
    const bool patches = round % 2 == 1;
    const std::vector<float> points = RandomPoints(random, patches ? 32 : 40, -1, 1);
    const GeometryView view =
        View(points, patches ? PrimitiveKind::kPatches : PrimitiveKind::kCurves,
             round % 4 == 0 && !patches ? Topology::kStrip : Topology::kList);
    const Affine map = RandomMap(random);
    const CutNeed need = CutNeed::Of(view.record, points);
    const Cut cut = CutCurved(view, map, TileGrid::Of(kSize, kSize, kSize));
    const double made = static_cast<double>(cut.vertices.size()) / (patches ? 1 : 2);
    const double said = need.Pieces(StretchOf(map));
    EXPECT_GE(said, made) << "round " << round;
    EXPECT_TRUE(need.IsMet(StretchOf(map)));
    all_said += said;
    all_made += made;
  }
  EXPECT_LT(all_said, 3 * all_made) << "far more than necessary";
}

TEST(CutNeeds, AreNotMetWhereCuttingComesToAnEnd) {
  std::vector<float> points;
  for (int i = 0; i < 20'000; ++i) {
    for (const float c :
         {0.0f, 0.0f, 0.0f, 400.0f, 400.0f, 0.0f, -200.0f, 400.0f, 0.0f, 200.0f, 0.0f, 0.0f}) {
      points.push_back(c);
    }
  }
  const GeometryView curves = View(points, PrimitiveKind::kCurves, Topology::kList);
  EXPECT_FALSE(CutNeed::Of(curves.record, points).IsMet(1));
  EXPECT_TRUE(CutNeed::Of(curves.record, points).IsMet(0.1));
  std::mt19937 random(5);
  const std::vector<float> patch = RandomPoints(random, 16, -1, 1);
  const CutNeed need =
      CutNeed::Of(View(patch, PrimitiveKind::kPatches, Topology::kList).record, patch);
  EXPECT_TRUE(need.IsMet(1e3));
  EXPECT_FALSE(need.IsMet(1e6)) << "more than 512 along a side";
  const CutNeed none = CutNeed::Of(View({}, PrimitiveKind::kPatches, Topology::kList).record, {});
  EXPECT_TRUE(none.IsMet(1e30));
}

TEST(CutNeeds, NoDistanceBecomesLongerThanTheStretch) {
  std::mt19937 random(6);
  std::uniform_real_distribution<double> number(-1, 1);
  for (int round = 0; round < 300; ++round) {
    const Affine map = RandomMap(random);
    const double stretch = StretchOf(map);
    double longest = 0;
    for (int i = 0; i < 300; ++i) {
      const double d[3] = {number(random), number(random), number(random)};
      double square = 0;
      for (int r = 0; r < 3; ++r) {
        const double at = map.m[r * 4] * d[0] + map.m[r * 4 + 1] * d[1] + map.m[r * 4 + 2] * d[2];
        square += at * at;
      }
      longest = std::max(longest, std::sqrt(square / (d[0] * d[0] + d[1] * d[1] + d[2] * d[2])));
    }
    EXPECT_LE(longest, stretch * (1 + 1e-12));
    EXPECT_GT(longest, stretch / 2);
  }
  Affine scale;
  scale.m[0] = 3, scale.m[5] = -7, scale.m[10] = 2;
  EXPECT_EQ(StretchOf(scale), 7);
}

TEST(CutPatches, FarOnesAreLeftOutAndAllHaveAnEnd) {
  std::vector<float> away(48, -5000.0f);
  EXPECT_TRUE(CutCurved(View(away, PrimitiveKind::kPatches, Topology::kList), Affine(),
                        TileGrid::Of(kSize, kSize, kSize))
                  .vertices.empty());
  std::mt19937 random(3);
  const std::vector<float> huge = RandomPoints(random, 16, -1e9, 1e9);
  const Cut cut = CutCurved(View(huge, PrimitiveKind::kPatches, Topology::kList), Affine(),
                            TileGrid::Of(kSize, kSize, kSize));
  EXPECT_EQ(cut.vertices.size(), size_t{kMostPatchPieces + 1} * (kMostPatchPieces + 1));
}

}  // namespace
}  // namespace voxeld::gpu
