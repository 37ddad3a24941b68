// Tests that footprints are complete and without foreign voxels, for every kind of geometry,
// compared with the solid that the pixels sweep in closed form.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <set>
#include <string>
#include <tuple>

#include <gtest/gtest.h>

#include "display/geometry/footprint.h"
#include "tests/display/geometry/geometry_cases.h"
#include "tests/display/geometry/swept_solid.h"
#include "tests/display/geometry/table_reader.h"

namespace voxeld::display {
namespace {

using Where = SweptSolid::Where;

struct Parameter {
  GeometryCase geometry_case;
  Sampling sampling;
};

std::vector<Parameter> Parameters() {
  std::vector<Parameter> parameters;
  for (const GeometryCase& c : AllCases()) {
    parameters.push_back({c, Sampling::kMax});
    parameters.push_back({c, Sampling::kWeighted});
  }
  return parameters;
}

std::string NameOf(const testing::TestParamInfo<Parameter>& info) {
  return info.param.geometry_case.name +
         (info.param.sampling == Sampling::kMax ? "Max" : "Weighted");
}

class ReachabilityTest : public testing::TestWithParam<Parameter> {
 protected:
  void SetUp() override {
    ASSERT_TRUE(ValidateGeometry(geometry_).ok()) << ValidateGeometry(geometry_);
    const auto start = std::chrono::steady_clock::now();
    table_ = BuildFootprints(geometry_, GetParam().sampling);
    build_ms_ =
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    solid_ = MakeSweptSolid(geometry_);
  }

  template <typename Visit>
  void ForEachVoxel(Visit visit) const {
    for (int32_t k = 0; k < grid_.nz; ++k) {
      for (int32_t j = 0; j < grid_.ny; ++j) {
        for (int32_t i = 0; i < grid_.nx; ++i) visit(i, j, k);
      }
    }
  }

  bool MayBeInGrid(const Vec3& p, double slack) const {
    const auto within = [&](double x, double origin, double pitch, int32_t n) {
      const double cell = (x - origin) / pitch;
      return cell > -slack && cell < n + slack;
    };
    return within(p.x, grid_.origin_mm.x, grid_.pitch_mm.x, grid_.nx) &&
           within(p.y, grid_.origin_mm.y, grid_.pitch_mm.y, grid_.ny) &&
           within(p.z, grid_.origin_mm.z, grid_.pitch_mm.z, grid_.nz);
  }

  const Geometry& geometry_ = GetParam().geometry_case.geometry;
  const VoxelGrid& grid_ = geometry_.grid;
  FootprintTable table_;
  double build_ms_ = 0;
  std::unique_ptr<SweptSolid> solid_;
};

TEST_P(ReachabilityTest, EveryReachableVoxelLightsAPixel) {
  const std::vector<int32_t> weights = GreatestWeights(table_, grid_);
  int64_t reachable = 0, undecided = 0, dark = 0;
  size_t voxel = 0;
  ForEachVoxel([&](int32_t i, int32_t j, int32_t k) {
    const int32_t weight = weights[voxel++];
    const Where where = solid_->Locate(VoxelCentre(grid_, i, j, k));
    undecided += where == Where::kNearBoundary;
    if (where != Where::kInside) return;
    ++reachable;
    if (weight == 255) return;
    if (++dark <= 5) {
      ADD_FAILURE() << "voxel (" << i << ", " << j << ", " << k << ") has weight " << weight;
    }
  });
  EXPECT_EQ(dark, 0);
  EXPECT_GT(reachable, 0);
  const double voxels = static_cast<double>(weights.size());
  const double share = static_cast<double>(reachable) / voxels;
  EXPECT_LT(static_cast<double>(undecided), 0.06 * voxels);
  RecordProperty("reachable_share", std::to_string(share));
  std::printf(
      "%6.2f %% of %d·%d·%d voxels reachable, %lld undecided; %zu + %zu entries in %.2f ms\n",
      100 * share, grid_.nx, grid_.ny, grid_.nz, static_cast<long long>(undecided),
      table_.outer.entries.size(), table_.inner.entries.size(), build_ms_);
}

TEST_P(ReachabilityTest, PixelsThatPassAVoxelShowIt) {
  // Checking one plane of voxels at a time suffices, since lists are products.
  const int32_t stride = std::max(1, grid_.nz / 4);
  int64_t checked = 0, missing = 0;
  ForEachVoxel([&](int32_t i, int32_t j, int32_t k) {
    if (k % stride != 0) return;
    for (const PixelId& pixel : solid_->Passing(VoxelCentre(grid_, i, j, k))) {
      ++checked;
      bool shown = false;
      for (const FootprintEntry& o : table_.Outer(pixel.slice, pixel.u)) {
        for (const FootprintEntry& n : table_.Inner(pixel.slice, pixel.v)) {
          shown = shown || (o.x + n.x == i && o.y + n.y == j && o.z + n.z == k && o.weight == 255);
        }
      }
      if (shown) continue;
      if (++missing <= 5) {
        ADD_FAILURE() << "voxel (" << i << ", " << j << ", " << k << ") is not shown by pixel ("
                      << pixel.u << ", " << pixel.v << ") of slice " << pixel.slice;
      }
    }
  });
  EXPECT_EQ(missing, 0);
  EXPECT_GT(checked, 0);
}

TEST_P(ReachabilityTest, NoPixelShowsWhatItDoesNotSweep) {
  const int reach = GetParam().sampling == Sampling::kWeighted ? 2 : 1;
  int64_t foreign = 0;
  for (int32_t s = 0; s < table_.slices; ++s) {
    for (int32_t u = 0; u < table_.width; ++u) {
      for (const FootprintEntry& entry : table_.Outer(s, u)) {
        if (solid_->MayShowOuter(s, u, entry, reach)) continue;
        if (++foreign <= 5) {
          ADD_FAILURE() << "(" << entry.x << ", " << entry.y << ", " << entry.z
                        << ") in the outer list of slice " << s << ", u " << u;
        }
      }
    }
  }
  for (int32_t s = 0; s < table_.inner_sets; ++s) {
    for (int32_t v = 0; v < table_.height; ++v) {
      for (const FootprintEntry& entry : table_.Inner(s, v)) {
        EXPECT_EQ(entry.weight, 255);
        EXPECT_TRUE(solid_->MayShowInner(s, v, entry)) << "set " << s << ", v " << v;
      }
    }
  }
  EXPECT_EQ(foreign, 0);
}

TEST_P(ReachabilityTest, EveryPixelShowsTheVoxelThatHoldsItsCentre) {
  int64_t checked = 0, missing = 0;
  const int32_t stride = std::max(1, table_.height / 5);
  for (int32_t s = 0; s < table_.slices; ++s) {
    for (int32_t u = 0; u < table_.width; ++u) {
      for (int32_t v = 0; v < table_.height; v += stride) {
        const Vec3 centre = solid_->Centre({s, u, v});
        const Vec3 position = PixelPosition(geometry_, s, u, v);
        if (std::isnan(centre.x)) {
          EXPECT_TRUE(std::isnan(position.x) && std::isnan(position.y) && std::isnan(position.z));
          EXPECT_TRUE(table_.Outer(s, u).empty());
          continue;
        }
        ASSERT_NEAR(position.x, centre.x, 1e-6);
        ASSERT_NEAR(position.y, centre.y, 1e-6);
        ASSERT_NEAR(position.z, centre.z, 1e-6);
        if (!MayBeInGrid(centre, -kMargin)) continue;
        ++checked;
        bool shown = false;
        for (const auto& [voxel, weight] : ReadFootprint(table_, s, u, v)) {
          const Vec3 c = VoxelCentre(grid_, voxel[0], voxel[1], voxel[2]);
          const double half = 0.5 + kMargin;
          shown = shown || (weight >= 128 && std::abs(c.x - centre.x) <= half * grid_.pitch_mm.x &&
                            std::abs(c.y - centre.y) <= half * grid_.pitch_mm.y &&
                            std::abs(c.z - centre.z) <= half * grid_.pitch_mm.z);
        }
        if (!shown && ++missing <= 5) {
          ADD_FAILURE() << "slice " << s << ", pixel (" << u << ", " << v << ")";
        }
      }
    }
  }
  EXPECT_EQ(missing, 0);
  EXPECT_GT(checked, 0);
}

TEST_P(ReachabilityTest, ListsAreWellFormed) {
  const auto check = [&](const FootprintLists& lists, size_t count) {
    ASSERT_EQ(lists.begin.size(), count + 1);
    EXPECT_EQ(lists.begin.front(), 0u);
    EXPECT_EQ(lists.begin.back(), lists.entries.size());
    for (size_t r = 0; r < count; ++r) {
      ASSERT_LE(lists.begin[r], lists.begin[r + 1]);
      const auto list = lists.list(r);
      for (size_t n = 0; n < list.size(); ++n) {
        const FootprintEntry& e = list[n];
        ASSERT_TRUE(e.x < grid_.nx && e.y < grid_.ny && e.z < grid_.nz);
        ASSERT_TRUE(e.weight >= 1 && e.weight <= 255);
        if (GetParam().sampling == Sampling::kMax) {
          ASSERT_EQ(e.weight, 255);
        }
        if (n == 0) continue;
        const FootprintEntry& before = list[n - 1];
        ASSERT_LT(std::tuple(before.z, before.y, before.x), std::tuple(e.z, e.y, e.x));
      }
    }
  };
  EXPECT_EQ(table_.slices, SliceCount(geometry_));
  check(table_.outer, static_cast<size_t>(table_.slices) * static_cast<size_t>(table_.width));
  check(table_.inner, static_cast<size_t>(table_.inner_sets) * static_cast<size_t>(table_.height));
  EXPECT_EQ(table_, BuildFootprints(geometry_, GetParam().sampling));
}

INSTANTIATE_TEST_SUITE_P(All, ReachabilityTest, testing::ValuesIn(Parameters()), NameOf);

}  // namespace
}  // namespace voxeld::display
