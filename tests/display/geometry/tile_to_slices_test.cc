#include <random>
#include <set>

#include <gtest/gtest.h>

#include "display/geometry/footprint.h"
#include "tests/display/geometry/geometry_cases.h"

namespace voxeld::display {
namespace {

struct Tiles {
  int32_t x, y, z;
};

// The slices with a voxel of the tile in some footprint, by looking at all of them.
std::vector<int32_t> SlicesByLooking(const FootprintTable& table, const Tiles& size, int32_t i,
                                     int32_t j, int32_t k) {
  const auto in_tile = [&](const FootprintEntry& o, const FootprintEntry& n) {
    return (o.x + n.x) / size.x == i && (o.y + n.y) / size.y == j && (o.z + n.z) / size.z == k;
  };
  const auto sees = [&](int32_t slice) {
    for (int32_t v = 0; v < table.height; ++v) {
      for (const FootprintEntry& inner : table.Inner(slice, v)) {
        for (int32_t u = 0; u < table.width; ++u) {
          for (const FootprintEntry& outer : table.Outer(slice, u)) {
            if (in_tile(outer, inner)) return true;
          }
        }
      }
    }
    return false;
  };
  std::vector<int32_t> slices;
  for (int32_t slice = 0; slice < table.slices; ++slice) {
    if (sees(slice)) slices.push_back(slice);
  }
  return slices;
}

class TileToSlicesTest : public testing::TestWithParam<GeometryCase> {};

TEST_P(TileToSlicesTest, NamesTheSlicesThatSeeATile) {
  const Geometry& geometry = GetParam().geometry;
  const VoxelGrid& grid = geometry.grid;
  const FootprintTable table = BuildFootprints(geometry, Sampling::kMax);
  std::mt19937 random(7);
  const auto below = [&](int32_t n) {
    return static_cast<int32_t>(random() % static_cast<uint32_t>(n));
  };
  for (const Tiles& size : {Tiles{32, 32, 32}, Tiles{8, 16, 4}, Tiles{5, 3, 7}}) {
    const TileToSlices map(table, grid, size.x, size.y, size.z);
    for (int n = 0; n < 4; ++n) {
      const int32_t i = below(grid.nx) / size.x, j = below(grid.ny) / size.y,
                    k = below(grid.nz) / size.z;
      const std::vector<int32_t> slices = SlicesByLooking(table, size, i, j, k);
      ASSERT_EQ(map.Slices(i, j, k), slices) << i << " " << j << " " << k;
      for (int range = 0; range < 8; ++range) {
        const int32_t begin = below(table.slices), end = begin + below(table.slices - begin + 1);
        const bool visible = std::any_of(slices.begin(), slices.end(),
                                         [&](int32_t s) { return s >= begin && s < end; });
        ASSERT_EQ(map.Visible(i, j, k, begin, end), visible) << begin << " to " << end;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, TileToSlicesTest, testing::ValuesIn(AllCases()),
                         [](const auto& info) { return info.param.name; });

TEST(TileToSlicesByHandTest, AStackWhosePixelsAreVoxels) {
  PlanarStack stack;
  stack.width_px = 20;
  stack.height_px = 9;
  stack.positions_mm = EvenPositions(10, 1);
  Geometry geometry{stack, {}};
  geometry.grid = DefaultGrid(geometry);
  const TileToSlices map(BuildFootprints(geometry, Sampling::kMax), geometry.grid, 8, 8, 4);
  for (const int32_t i : {0, 1, 2}) {
    for (const int32_t j : {0, 1}) {
      EXPECT_EQ(map.Slices(i, j, 0), (std::vector<int32_t>{0, 1, 2, 3}));
      EXPECT_EQ(map.Slices(i, j, 2), (std::vector<int32_t>{8, 9}));
    }
  }
  EXPECT_TRUE(map.Visible(0, 0, 1, 7, 10));
  EXPECT_FALSE(map.Visible(0, 0, 1, 8, 10));
  EXPECT_FALSE(map.Visible(0, 0, 1, 5, 5));
}

TEST(TileToSlicesByHandTest, TilesThatNoPixelSees) {
  Rotor rotor;
  rotor.slices_per_turn = 36;
  rotor.width_px = 16;
  rotor.height_px = 4;
  rotor.panels = {{.eccentricity_mm = 6}};
  Geometry geometry{rotor, CentredGrid(24, 24, 12, {1, 1, 1})};
  const TileToSlices map(BuildFootprints(geometry, Sampling::kMax), geometry.grid, 4, 4, 4);
  EXPECT_TRUE(map.Slices(2, 2, 1).empty());  // within the plane's distance from the axis
  EXPECT_TRUE(map.Slices(0, 0, 1).empty());  // beyond the circle
  EXPECT_TRUE(map.Slices(1, 2, 0).empty());  // below the panel
  EXPECT_FALSE(map.Slices(1, 2, 1).empty());
  EXPECT_FALSE(map.Visible(2, 2, 1, 0, 36));
}

}  // namespace
}  // namespace voxeld::display
