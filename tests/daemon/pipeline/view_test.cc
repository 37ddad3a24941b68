// Tests views with values computed by hand.
#include "daemon/pipeline/view.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace voxeld::daemon {
namespace {

using ::testing::HasSubstr;

// 100 × 50 × 20 cells of 1 × 2 × 4 mm: 100 × 100 × 80 mm, not centred on the origin.
const display::VoxelGrid kGrid = {100, 50, 20, {1, 2, 4}, {-10, -20, -30}};

gpu::Point3d At(const ViewOptions& view, const display::VoxelGrid& grid, double x, double y,
                double z) {
  const absl::StatusOr<gpu::Affine> map = SceneToVoxel(view, grid);
  EXPECT_TRUE(map.ok()) << map.status();
  return gpu::Map(*map, x, y, z);
}

void ExpectNear(const gpu::Point3d& p, double x, double y, double z) {
  EXPECT_NEAR(p.x, x, 1e-9);
  EXPECT_NEAR(p.y, y, 1e-9);
  EXPECT_NEAR(p.z, z, 1e-9);
}

TEST(View, FitByDefaultPutsOneOnTheLongestAxis) {
  const ViewOptions fit;
  ExpectNear(At(fit, kGrid, 0, 0, 0), 50, 25, 10);     // the middle
  ExpectNear(At(fit, kGrid, 1, 1, 0.8), 100, 50, 20);  // 50 mm a unit on every axis
  ExpectNear(At(fit, kGrid, -1, -1, -0.8), 0, 0, 0);
  // The longest axis in millimetres, not in voxels.
  const display::VoxelGrid tall = {200, 10, 30, {0.5, 10, 20}, {0, 0, 0}};
  ExpectNear(At(fit, tall, 0, 0, 1), 100, 5, 30);
  ExpectNear(At(fit, tall, 1, 0, 0), 100 + 300 / 0.5, 5, 15);
}

TEST(View, FitABoxKeepsTheAspectAndCentres) {
  ViewOptions fit;
  fit.box = {{0, 0, 0}, {4, 1, 2}};  // limited by x: 25 mm a unit
  ExpectNear(At(fit, kGrid, 2, 0.5, 1), 50, 25, 10);
  ExpectNear(At(fit, kGrid, 0, 0.5, 1), 0, 25, 10);
  ExpectNear(At(fit, kGrid, 4, 1, 2), 100, 25 + 12.5 / 2, 10 + 25 / 4.0);
  fit.box = {{-1, -1, -1}, {1, 1, 1}};  // limited by z: 40 mm a unit
  ExpectNear(At(fit, kGrid, 1, 1, 1), 90, 45, 20);
}

TEST(View, MillimetresAreTheDisplays) {
  ViewOptions view;
  view.mode = ViewOptions::Mode::kMillimetres;
  ExpectNear(At(view, kGrid, -10, -20, -30), 0, 0, 0);
  ExpectNear(At(view, kGrid, 90, 80, 50), 100, 50, 20);
  ExpectNear(At(view, kGrid, 0, 0, 0), 10, 10, 7.5);
}

TEST(View, VoxelsAreExact) {
  ViewOptions view;
  view.mode = ViewOptions::Mode::kVoxels;
  EXPECT_EQ(*SceneToVoxel(view, kGrid), gpu::Affine());
}

TEST(View, TheTransformComesFirst) {
  ViewOptions view;
  view.transform.m[3] = 1;  // x + 1
  view.mode = ViewOptions::Mode::kVoxels;
  ExpectNear(At(view, kGrid, 1, 2, 3), 2, 2, 3);
  view.mode = ViewOptions::Mode::kFit;
  ExpectNear(At(view, kGrid, 0, 0, 0), 100, 25, 10);
}

TEST(View, RefusalsNameTheFieldAndTheValue) {
  ViewOptions view;
  view.box = {{0, 5, 0}, {1, 5, 1}};
  EXPECT_THAT(SceneToVoxel(view, kGrid).status().message(), HasSubstr("from 5 to 5 on axis y"));
  view.box = {{0, 0, 0}, {1, std::numeric_limits<double>::infinity(), 1}};
  EXPECT_EQ(SceneToVoxel(view, kGrid).status().code(), absl::StatusCode::kInvalidArgument);
  view.box = {{0, 0, 0}, {1, std::numeric_limits<double>::quiet_NaN(), 1}};
  EXPECT_FALSE(SceneToVoxel(view, kGrid).ok());
  view.box = {{0, 0, 0}, {1, 1, 1}};
  view.mode = ViewOptions::Mode::kVoxels;
  EXPECT_THAT(SceneToVoxel(view, kGrid).status().message(), HasSubstr("view.box"));
  view = {};
  view.transform.m[0] = 0;
  EXPECT_THAT(SceneToVoxel(view, kGrid).status().message(), HasSubstr("determinant 0"));
  view.transform.m[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(SceneToVoxel(view, kGrid).status().message(), HasSubstr("not finite"));
  view = {};
  view.box = {{0, 0, 0}, {1e-300, 1e-300, 1e-300}};
  EXPECT_THAT(SceneToVoxel(view, kGrid).status().message(), HasSubstr("nearer to the size"));
}

}  // namespace
}  // namespace voxeld::daemon
