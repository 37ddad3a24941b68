// Tests footprints pixel by pixel: complete, and without foreign voxels, compared with the solid
// that pixels sweep in closed form; those of a product geometry are the same as when computed as a
// product.
#include "display/geometry/flat_footprints.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "display/geometry/footprint.h"
#include "tests/display/geometry/geometry_cases.h"
#include "tests/display/geometry/swept_flat.h"
#include "tests/display/geometry/table_reader.h"

namespace voxeld::display {
namespace flat_footprints_test {

struct Parameter {
  GeometryCase c;
  Sampling sampling;
};

std::vector<Parameter> Parameters() {
  std::vector<Parameter> parameters;
  for (const GeometryCase& c : FlatCases()) {
    for (const Sampling sampling : {Sampling::kMax, Sampling::kWeighted}) {
      parameters.push_back({c, sampling});
    }
  }
  return parameters;
}

class FlatFootprints : public testing::TestWithParam<Parameter> {
 protected:
  void SetUp() override {
    ASSERT_EQ(ValidateGeometry(geometry_), absl::OkStatus());
    ASSERT_TRUE(IsFlat(geometry_));
    table_ = BuildFootprints(geometry_, GetParam().sampling);
    std::visit([&](const auto& shape) { width_ = shape.width_px, height_ = shape.height_px; },
               geometry_.shape);
    ASSERT_EQ(table_.slices, SliceCount(geometry_));
    ASSERT_EQ(table_.flat_row, FlatRow(width_));
    ASSERT_EQ(table_.width, table_.flat_row * height_);
  }

  const Geometry& geometry_ = GetParam().c.geometry;
  const VoxelGrid& grid_ = geometry_.grid;
  FootprintTable table_;
  int32_t width_ = 0, height_ = 0;
};

TEST_P(FlatFootprints, EveryReachableVoxelIsInOneWithFullWeight) {
  const SweptFlat solid(geometry_);
  const std::vector<int32_t> weights = GreatestWeights(table_, grid_);
  int64_t reachable = 0, dark = 0;
  size_t voxel = 0;
  for (int32_t k = 0; k < grid_.nz; ++k) {
    for (int32_t j = 0; j < grid_.ny; ++j) {
      for (int32_t i = 0; i < grid_.nx; ++i, ++voxel) {
        const Vec3 centre = VoxelCentre(grid_, i, j, k);
        if (solid.Doubtful(centre) || solid.Locate(centre) != SweptSolid::Where::kInside) continue;
        ++reachable;
        dark += weights[voxel] != kFullWeight;
      }
    }
  }
  EXPECT_GT(reachable, 1000);
  EXPECT_EQ(dark, 0) << "of " << reachable;
  std::printf("%s: %.1f %% of the grid reachable\n", GetParam().c.name.c_str(),
              100.0 * static_cast<double>(reachable) / static_cast<double>(weights.size()));
}

TEST_P(FlatFootprints, NothingForeignIsTakenIn) {
  const SweptFlat solid(geometry_);
  const int reach = GetParam().sampling == Sampling::kWeighted ? 2 : 1;
  int64_t entries = 0, foreign = 0, without = 0;
  for (int32_t slice = 0; slice < table_.slices; ++slice) {
    for (int32_t column = 0; column < table_.width; ++column) {
      const int32_t u = column % table_.flat_row, v = column / table_.flat_row;
      const auto list = table_.Outer(slice, column);
      if (u >= width_) {
        EXPECT_TRUE(list.empty());
        continue;
      }
      const Vec3 p = PixelPosition(geometry_, slice, u, v);
      const double at[3] = {(p.x - grid_.origin_mm.x) / grid_.pitch_mm.x,
                            (p.y - grid_.origin_mm.y) / grid_.pitch_mm.y,
                            (p.z - grid_.origin_mm.z) / grid_.pitch_mm.z};
      bool has_own = false;
      for (const FootprintEntry& e : list) {
        ++entries;
        const auto holds = [](double place, int32_t cell) {
          return std::abs(place - cell - 0.5) < 0.5 + 1e-4;
        };
        const bool own = holds(at[0], e.x) && holds(at[1], e.y) && holds(at[2], e.z);
        has_own |= own && e.weight >= kOwnWeight;
        if (own) continue;
        const Vec3 centre = VoxelCentre(grid_, e.x, e.y, e.z);
        foreign += !solid.Doubtful(centre) && !solid.MayPass(slice, u, v, centre, reach);
      }
      const bool in_grid = at[0] >= 0 && at[0] < grid_.nx && at[1] >= 0 && at[1] < grid_.ny &&
                           at[2] >= 0 && at[2] < grid_.nz;
      without += in_grid && !has_own;
    }
  }
  EXPECT_GT(entries, 1000);
  EXPECT_EQ(foreign, 0) << "of " << entries;
  EXPECT_EQ(without, 0) << "pixels without the voxel that they lie in";
}

// One function states what pixels are and where they are: their middles are passed.
TEST_P(FlatFootprints, PixelsLieWhereTheyAreSaidToPass) {
  const SweptFlat solid(geometry_);
  for (int32_t slice = 0; slice < table_.slices; slice += 7) {
    for (int32_t v = 0; v < height_; v += 3) {
      for (int32_t u = 0; u < width_; u += 3) {
        const Vec3 p = PixelPosition(geometry_, slice, u, v);
        if (std::isnan(p.x) || solid.Doubtful(p)) continue;
        EXPECT_TRUE(solid.MayPass(slice, u, v, p, 1)) << slice << " " << u << " " << v;
      }
    }
  }
}

TEST_P(FlatFootprints, TilesAreKnownByTheirSlices) {
  const TileToSlices look(table_, grid_, 8, 8, 8);
  for (int32_t slice = 0; slice < table_.slices; slice += 5) {
    for (int32_t column = 0; column < table_.width; column += 3) {
      for (const FootprintEntry& e : table_.Outer(slice, column)) {
        EXPECT_TRUE(look.Visible(e.x / 8, e.y / 8, e.z / 8, slice, slice + 1));
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, FlatFootprints, testing::ValuesIn(Parameters()),
                         [](const auto& info) {
                           return info.param.c.name +
                                  (info.param.sampling == Sampling::kMax ? "Max" : "Weighted");
                         });

TEST(FlatFootprintsOfProducts, AreTheProducts) {
  std::vector<GeometryCase> cases = StackCases();
  for (GeometryCase& c : RotorCases()) cases.push_back(std::move(c));
  for (GeometryCase& c : cases) {
    if (c.geometry.grid.nx * c.geometry.grid.ny > 120 * 120) continue;
    for (const Sampling sampling : {Sampling::kMax, Sampling::kWeighted}) {
      SCOPED_TRACE(c.name + (sampling == Sampling::kMax ? "" : ", weighted"));
      const FootprintTable product = BuildFootprints(c.geometry, sampling);
      ASSERT_EQ(product.flat_row, 0);
      c.geometry.correction = Correction();
      const FootprintTable flat = BuildFootprints(c.geometry, sampling);
      c.geometry.correction.reset();
      ASSERT_GT(flat.flat_row, 0);
      const VoxelGrid& grid = c.geometry.grid;
      int64_t missing = 0, foreign = 0, all = 0;
      for (int32_t slice = 0; slice < product.slices; ++slice) {
        for (int32_t v = 0; v < product.height; ++v) {
          for (int32_t u = 0; u < product.width; ++u) {
            const Vec3 p = PixelPosition(c.geometry, slice, u, v);
            const auto holds = [](double mm, double pitch_mm, int32_t cell) {
              return std::abs(mm / pitch_mm - cell - 0.5) < 0.5 + 1e-4;
            };
            // Returns along how many axes a voxel contains the pixel's middle.
            const auto own = [&](const std::array<int32_t, 3>& voxel) {
              return holds(p.x - grid.origin_mm.x, grid.pitch_mm.x, voxel[0]) +
                     holds(p.y - grid.origin_mm.y, grid.pitch_mm.y, voxel[1]) +
                     holds(p.z - grid.origin_mm.z, grid.pitch_mm.z, voxel[2]);
            };
            Footprint a = ReadFootprint(product, slice, u, v);
            for (const FootprintEntry& e : flat.Outer(slice, v * flat.flat_row + u)) {
              const auto found = a.find({e.x, e.y, e.z});
              ++all;
              // Between two voxels, either may be the pixel's own.
              if (found == a.end() || found->second < e.weight) foreign += own({e.x, e.y, e.z}) < 3;
              if (found != a.end() && found->second == e.weight) a.erase(found);
            }
            // The additional voxels of a product are in the cell that contains the pixel's middle
            // along one axis or another.
            for (const auto& [voxel, weight] : a) missing += own(voxel) == 0;
          }
        }
      }
      EXPECT_GT(all, 100);
      EXPECT_EQ(foreign, 0) << "of " << all;
      EXPECT_EQ(missing, 0) << "of " << all;
    }
  }
}

}  // namespace flat_footprints_test
}  // namespace voxeld::display
