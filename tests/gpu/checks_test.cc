#include "gpu/checks.h"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace voxeld::gpu {
namespace {

using ::testing::HasSubstr;

Target GoodTarget() {
  Target target;
  display::PlanarStack stack{.width_px = 4, .height_px = 4};
  stack.positions_mm = {0, 1, 2, 3};
  target.geometry.shape = stack;
  target.geometry.grid = {.nx = 4, .ny = 4, .nz = 4, .pitch_mm = {1, 1, 1}, .origin_mm = {}};
  target.layout = {.slices = 4, .width = 4, .height = 4};
  return target;
}

void ExpectWrong(const absl::Status& status, const std::string& why) {
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << why;
  EXPECT_THAT(status.message(), HasSubstr(why));
}

TEST(CheckTarget, SaysWhichFieldWhatItIsAndWhatWouldBeRight) {
  EXPECT_TRUE(CheckTarget(GoodTarget(), {}).ok()) << CheckTarget(GoodTarget(), {});
  const std::vector<std::pair<std::function<void(Target&)>, const char*>> wrong = {
      {[](Target& t) { t.geometry.grid.nx = 0; }, "nx"},
      {[](Target& t) { t.layout.sub_frames = 0; }, "sub_frames"},
      {[](Target& t) { t.layout.width = 5; }, "5"},
      {[](Target& t) { t.tone.lut[2][0] = 9; }, "tone.lut[2][0] is 9, must be 0"},
      {[](Target& t) { t.tone.dither = static_cast<display::Dither>(3); }, "tone.dither is 3"},
      {[](Target& t) { t.tone.density = static_cast<display::Density>(2); }, "tone.density is 2"},
      {[](Target& t) { t.tone.sampling = static_cast<display::Sampling>(2); },
       "tone.sampling is 2"},
      {[](Target& t) { t.view.m[7] = std::numeric_limits<float>::infinity(); },
       "view[7] is inf, must be finite"},
      {[](Target& t) { t.view.m[0] = std::nanf(""); }, "view[0] is nan"}};
  for (const auto& [change, why] : wrong) {
    Target target = GoodTarget();
    change(target);
    ExpectWrong(CheckTarget(target, {}), why);
  }
}

TEST(CheckTarget, APartIsOfItsSlices) {
  for (const SlicePart& part :
       {SlicePart{0, 4}, SlicePart{1, 1}, SlicePart{4, -1}, SlicePart{0, -1, 2, 3}}) {
    EXPECT_TRUE(CheckTarget(GoodTarget(), part).ok());
  }
  ExpectWrong(CheckTarget(GoodTarget(), {-1, 2}), "[-1, 2)");
  ExpectWrong(CheckTarget(GoodTarget(), {0, 5}), "[0, 5), must be within [0, 4)");
  ExpectWrong(CheckTarget(GoodTarget(), {3, 2}), "[3, 2)");
  ExpectWrong(CheckTarget(GoodTarget(), {0, -1, 0, 0}), "rank 0 of 0");
  ExpectWrong(CheckTarget(GoodTarget(), {0, -1, -1, 2}), "rank -1 of 2");
  ExpectWrong(CheckTarget(GoodTarget(), {0, -1, 2, 2}), "rank 2 of 2");
}

TEST(CheckDelta, IsNoMoreThanItsBlock) {
  ExpectWrong(CheckDelta(StagingBlock(), 1).status(),
              "its size is 1, must be at most the block's 0");
  const auto none = CheckDelta(StagingBlock(), 0);
  ASSERT_TRUE(none.ok());
  EXPECT_TRUE(none->empty());
}

TEST(OwnedTiles, ATileThatSeveralRanksSeeIsCountedByTheFirst) {
  const Target target = GoodTarget();
  const display::VoxelGrid& voxels = target.geometry.grid;
  const display::FootprintTable table =
      display::BuildFootprints(target.geometry, target.tone.sampling);
  const TileGrid grid = TileGrid::Of(voxels.nx, voxels.ny, voxels.nz);
  const display::TileToSlices seen(table, voxels, kTileSize, kTileSize, kTileSize);
  ASSERT_EQ(grid.count(), 1u);
  const auto owned = [&](SlicePart part) { return OwnedTiles(seen, grid, part, 4).at(0); };
  EXPECT_EQ(owned({}), kOwned);
  EXPECT_EQ(owned({.rank = 0, .ranks = 2}), kOwned);
  EXPECT_EQ(owned({.rank = 1, .ranks = 2}), kOwnedAndCountedElsewhere);
  EXPECT_EQ(owned({.begin = 2, .rank = 1, .ranks = 2}), kOwnedAndCountedElsewhere);
  EXPECT_EQ(owned({.begin = 2, .end = 2}), kNotOwned);
}

TEST(CheckFrame, ItsNumberRisesAndItsBufferFits) {
  std::vector<std::byte> bytes(192);
  std::vector<uint64_t> numbers(4);
  const FrameBuffer buffer{bytes, numbers};
  const std::optional<display::FrameLayout> layout = GoodTarget().layout;
  EXPECT_TRUE(CheckFrame({.frame = 2, .buffer_holds = 1}, buffer, layout, 1).ok());
  EXPECT_EQ(CheckFrame({.frame = 2}, buffer, std::nullopt, 1).code(),
            absl::StatusCode::kFailedPrecondition);
  ExpectWrong(CheckFrame({.frame = 2}, buffer, layout, 2), "is 2, must be greater than 2");
  ExpectWrong(CheckFrame({.frame = 2, .buffer_holds = 2}, buffer, layout, 1),
              "buffer_holds is 2, must be less than 2");
  ExpectWrong(CheckFrame({.frame = 2}, {std::span(bytes).first(191), numbers}, layout, 1),
              "191 bytes and 4 numbers, must have 192 and 4");
  ExpectWrong(CheckFrame({.frame = 2}, {bytes, std::span(numbers).first(3)}, layout, 1),
              "192 bytes and 3 numbers");
}

TEST(CheckBox, HasAsManyVoxelsAsAreWanted) {
  const std::optional<display::FrameLayout> layout = GoodTarget().layout;
  EXPECT_TRUE(CheckBox({0, 0, 0, 2, 3, 4}, 24, layout).ok());
  EXPECT_TRUE(CheckBox({1, 1, 1, 1, 1, 1}, 0, layout).ok());
  EXPECT_EQ(CheckBox({0, 0, 0, 2, 3, 4}, 24, std::nullopt).code(),
            absl::StatusCode::kFailedPrecondition);
  ExpectWrong(CheckBox({0, 0, 0, 2, 3, 4}, 23, layout), "2 x 3 x 4");
  constexpr int32_t kBeyond = (1 << 20) + 1;
  for (const VoxelBox& box : {VoxelBox{1, 0, 0, 0, 0, 0}, VoxelBox{0, 1, 0, 0, 0, 0},
                              VoxelBox{0, 0, 1, 0, 0, 0}, VoxelBox{0, 0, 0, kBeyond, 0, 0},
                              VoxelBox{0, 0, 0, 0, kBeyond, 0}, VoxelBox{0, 0, 0, 0, 0, kBeyond}}) {
    ExpectWrong(CheckBox(box, 0, layout), "does not match an output of 0");
  }
}

}  // namespace
}  // namespace voxeld::gpu
