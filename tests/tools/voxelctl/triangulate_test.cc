// Tests that polygons become triangles that cover them once.
#include "tools/voxelctl/import/triangulate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace voxeld::voxelctl {
namespace {

std::vector<uint32_t> Cut(const std::vector<Point3>& corners) {
  std::vector<uint32_t> triangles;
  Triangulator().Append(corners, &triangles);
  return triangles;
}

// Returns twice the area of each triangle, with the sign of the side of the xy-plane from which it
// is seen.
std::vector<double> Areas(const std::vector<Point3>& corners) {
  std::vector<double> areas;
  const std::vector<uint32_t> triangles = Cut(corners);
  for (size_t i = 0; i + 2 < triangles.size(); i += 3) {
    const Point3 &a = corners[triangles[i]], &b = corners[triangles[i + 1]],
                 &c = corners[triangles[i + 2]];
    areas.push_back((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x));
  }
  return areas;
}

double Sum(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum;
}

// A star with this many points, counter-clockwise, and not quite planar.
std::vector<Point3> Star(int points) {
  std::vector<Point3> corners;
  for (int i = 0; i < 2 * points; ++i) {
    const double radius = i % 2 == 0 ? 1 : 0.3, angle = i * M_PI / points;
    corners.push_back({radius * std::cos(angle), radius * std::sin(angle), 0.001 * i});
  }
  return corners;
}

TEST(Triangulate, AConvexPolygonIsAFan) {
  EXPECT_EQ(Cut({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}),
            (std::vector<uint32_t>{0, 1, 2, 0, 2, 3}));
}

TEST(Triangulate, AStarIsCoveredOnceWithoutTurningATriangle) {
  for (const int points : {3, 5, 40, 256}) {
    std::vector<Point3> star = Star(points);
    const std::vector<double> areas = Areas(star);
    EXPECT_EQ(areas.size(), star.size() - 2);
    const double whole = 2 * points * 0.3 * std::sin(M_PI / points);
    EXPECT_NEAR(Sum(areas), whole, 1e-9) << points;
    for (const double area : areas) EXPECT_GE(area, 0) << points;
    std::reverse(star.begin(), star.end());
    for (const double area : Areas(star)) EXPECT_LE(area, 0) << points << " clockwise";
  }
}

TEST(Triangulate, ABridgeToAHoleIsKeptOpen) {
  // A square of 4 with a square hole of 2, as exporters write it: out and back along one edge.
  const std::vector<double> areas = Areas({{0, 0, 0},
                                           {4, 0, 0},
                                           {4, 4, 0},
                                           {0, 4, 0},
                                           {0, 0, 0},
                                           {1, 1, 0},
                                           {1, 3, 0},
                                           {3, 3, 0},
                                           {3, 1, 0},
                                           {1, 1, 0}});
  EXPECT_EQ(areas.size(), 8u);
  EXPECT_NEAR(Sum(areas), 24, 1e-9);
  for (const double area : areas) EXPECT_GE(area, 0);
}

TEST(Triangulate, WhatIsDegenerateStillMakesAllTriangles) {
  EXPECT_EQ(Cut({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}, {1, 0, 0}}).size(), 9u);
  EXPECT_EQ(Cut(std::vector<Point3>(7, Point3{1, 1, 1})).size(), 15u);
  EXPECT_EQ(Cut({{0, 0, 0}, {1, 1, 0}, {1, 0, 0}, {0, 1, 0}}).size(), 6u) << "crosses itself";
  EXPECT_EQ(Cut(Star(300)).size(), 3 * 598u) << "too many corners for ears";
  const double nan = std::nan("");
  EXPECT_EQ(Cut({{0, 0, 0}, {nan, 0, 0}, {1, 1, 0}, {0, 1, 0}}).size(), 6u);
}

}  // namespace
}  // namespace voxeld::voxelctl
