#include <optional>
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

// Returns the slices that have a voxel of the tile in some footprint, by examining all of them.
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

// The same from the flat tables, as a device reads them.
std::vector<int32_t> SlicesFromTables(const TileToSlices& map, int32_t i, int32_t j, int32_t k) {
  const TileToSlices::Tables tables = map.tables();
  const auto place =
      static_cast<size_t>(tables.stride[0] * i + tables.stride[1] * j + tables.stride[2] * k);
  const int32_t along = tables.inner_axis == Axis::kX ? i : tables.inner_axis == Axis::kY ? j : k;
  std::vector<int32_t> slices;
  for (uint32_t n = tables.begin[place]; n < tables.begin[place + 1]; ++n) {
    const int32_t slice = tables.slices[n];
    const int32_t row = slice % tables.inner_sets * tables.inner_tiles;
    if (tables.seen[static_cast<size_t>(row + along)] != 0) slices.push_back(slice);
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
      ASSERT_EQ(SlicesFromTables(map, i, j, k), slices) << i << " " << j << " " << k;
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

// Every tile, in both directions: no slice too many, and none too few.
TEST(TileToSlicesByHandTest, EveryTileOfEveryLattice) {
  for (const GeometryCase& c : LatticeCases()) {
    const VoxelGrid& grid = c.geometry.grid;
    const FootprintTable table = BuildFootprints(c.geometry, Sampling::kMax);
    for (const int32_t size : {4, 9}) {
      const TileToSlices map(table, grid, size, size, size);
      for (int32_t k = 0; k * size < grid.nz; ++k) {
        for (int32_t j = 0; j * size < grid.ny; ++j) {
          for (int32_t i = 0; i * size < grid.nx; ++i) {
            const std::vector<int32_t> slices = SlicesByLooking(table, {size, size, size}, i, j, k);
            ASSERT_EQ(map.Slices(i, j, k), slices) << c.name << i << " " << j << " " << k;
            ASSERT_EQ(SlicesFromTables(map, i, j, k), slices) << c.name;
          }
        }
      }
    }
  }
}

// Slices that see tiles at one height in one place, and at another height in another.
TEST(TileToSlicesByHandTest, ALatticesSlicesGoWhereTheyLike) {
  Lattice lattice;
  lattice.width_px = 2;
  lattice.points_mm = {Vec3{0.5, 0.5, 0.5}, Vec3{7.5, 0.5, 7.5},   // slice 0: below, then above
                       Vec3{0.5, 0.5, 7.5}, Vec3{7.5, 0.5, 0.5},   // slice 1: above, then below
                       std::nullopt,        Vec3{0.5, 0.5, 1.5}};  // slice 2: below
  const Geometry geometry{lattice, {8, 1, 8, {1, 1, 1}, {0, 0, 0}}};
  const TileToSlices map(BuildFootprints(geometry, Sampling::kMax), geometry.grid, 4, 4, 4);
  EXPECT_EQ(map.Slices(0, 0, 0), (std::vector<int32_t>{0, 2}));
  EXPECT_EQ(map.Slices(1, 0, 0), (std::vector<int32_t>{1}));
  EXPECT_EQ(map.Slices(0, 0, 1), (std::vector<int32_t>{1}));
  EXPECT_EQ(map.Slices(1, 0, 1), (std::vector<int32_t>{0}));
  EXPECT_FALSE(map.Visible(0, 0, 0, 1, 2));
  EXPECT_TRUE(map.Visible(0, 0, 0, 1, 3));
}

TEST(TileToSlicesByHandTest, TilesThatNoPixelSees) {
  Rotor rotor;
  rotor.slices_per_turn = 36;
  rotor.width_px = 16;
  rotor.height_px = 4;
  rotor.panels = {{.eccentricity_mm = 6}};
  Geometry geometry{rotor, CentredGrid(24, 24, 12, {1, 1, 1})};
  const TileToSlices map(BuildFootprints(geometry, Sampling::kMax), geometry.grid, 4, 4, 4);
  EXPECT_TRUE(map.Slices(2, 2, 1).empty());  // nearer to the axis than the plane
  EXPECT_TRUE(map.Slices(0, 0, 1).empty());  // beyond the circle
  EXPECT_TRUE(map.Slices(1, 2, 0).empty());  // below the panel
  EXPECT_FALSE(map.Slices(1, 2, 1).empty());
  EXPECT_FALSE(map.Visible(2, 2, 1, 0, 36));
}

}  // namespace
}  // namespace voxeld::display
