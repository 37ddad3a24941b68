#include "daemon/wire/open_edges.h"

#include <gtest/gtest.h>

#include <vector>

namespace voxeld::daemon::wire {
namespace {

const std::vector<float> kCorners = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
const std::vector<uint32_t> kFaces = {0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3};

std::vector<float> Apart(const std::vector<uint32_t>& indices) {
  std::vector<float> positions;
  for (const uint32_t i : indices) {
    positions.insert(positions.end(), &kCorners[i * 3], &kCorners[i * 3] + 3);
  }
  return positions;
}

TEST(OpenEdges, ATetrahedronIsClosedHoweverItsFacesAreTurned) {
  EXPECT_FALSE(FindOpenEdge(kCorners, kFaces));
  std::vector<uint32_t> turned = kFaces;
  std::swap(turned[3], turned[4]);
  EXPECT_FALSE(FindOpenEdge(kCorners, turned));
  EXPECT_TRUE(FindOpenEdge(Apart({0, 1, 2}), {})) << "a triangle alone";
}

TEST(OpenEdges, VerticesAtOnePlaceAreOne) {
  EXPECT_FALSE(FindOpenEdge(Apart(kFaces), {}));
  std::vector<float> positions = Apart(kFaces);
  positions[1] = -0.0f;
  EXPECT_FALSE(FindOpenEdge(positions, {}));
  positions[1] = 1e-30f;
  EXPECT_TRUE(FindOpenEdge(positions, {}));
  // Each face has vertices of its own, by index.
  std::vector<uint32_t> indices(12);
  for (uint32_t i = 0; i < 12; ++i) indices[i] = i;
  EXPECT_FALSE(FindOpenEdge(Apart(kFaces), indices));
}

TEST(OpenEdges, WithoutAFaceTheFirstOfItsEdgesIsNamed) {
  const std::vector<uint32_t> open(kFaces.begin() + 3, kFaces.end());
  const auto edge = FindOpenEdge(kCorners, open);
  ASSERT_TRUE(edge);
  EXPECT_EQ(edge->first, 0u);
  EXPECT_EQ(edge->second, 1u);
  EXPECT_EQ(edge->triangles, 1u);
}

TEST(OpenEdges, ThreeTrianglesAtAnEdgeLeaveItOpenAndFourDoNot) {
  std::vector<uint32_t> fins = kFaces;
  fins.insert(fins.end(), {0, 1, 2});
  ASSERT_TRUE(FindOpenEdge(kCorners, fins));
  EXPECT_EQ(FindOpenEdge(kCorners, fins)->triangles, 3u);
  fins.insert(fins.end(), {0, 1, 2});
  EXPECT_FALSE(FindOpenEdge(kCorners, fins));
  EXPECT_FALSE(FindOpenEdge(kCorners, std::vector<uint32_t>{0, 0, 1, 1, 0, 0}));
}

}  // namespace
}  // namespace voxeld::daemon::wire
