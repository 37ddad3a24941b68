// Test patterns, drawn by the CPU engine and looked at voxel by voxel.
#include "daemon/pipeline/test_pattern.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <set>
#include <vector>

#include "daemon/scene/engine_delta.h"
#include "gpu/engine.h"

namespace voxeld::daemon {
namespace {

constexpr int kNx = 20, kNy = 12, kNz = 10;

class Drawn {
 public:
  explicit Drawn(TestPattern pattern) {
    gpu::EngineOptions options;
    options.kind = gpu::EngineKind::kCpu;
    options.threads = 1;
    options.inline_execution = true;
    auto engine = *gpu::CreateEngine(options);
    gpu::Target target;
    display::PlanarStack stack;
    stack.width_px = kNx;
    stack.height_px = kNy;
    for (int i = 0; i < kNz; ++i) stack.positions_mm.push_back(i + 0.5 - kNz / 2.0);
    target.geometry = {stack, {kNx, kNy, kNz, {1, 1, 1}, {-kNx / 2.0, -kNy / 2.0, -kNz / 2.0}}};
    target.layout = {kNz, kNx, kNy, 1, display::PixelFormat::kRgb888};
    const auto ok = [](const absl::Status& status) { EXPECT_TRUE(status.ok()) << status; };
    engine->SetTarget(target, ok);
    EngineScene scene;
    const size_t size = scene.Plan(MakePattern(pattern, target.geometry, 1));
    gpu::StagingBlock block = *engine->AcquireStaging(size);
    gpu::DeltaWriter writer(block.bytes());
    scene.Write(writer);
    engine->Apply(std::move(block), size, ok);
    voxels_.resize(kNx * kNy * kNz);
    engine->ReadVoxels({0, 0, 0, kNx, kNy, kNz}, voxels_, ok);
  }
  uint32_t At(int x, int y, int z) const { return voxels_[(z * kNy + y) * kNx + x]; }
  std::map<uint32_t, int> Colors() const {
    std::map<uint32_t, int> colors;
    for (const uint32_t voxel : voxels_) ++colors[voxel];
    return colors;
  }

 private:
  std::vector<uint32_t> voxels_;
};

TEST(TestPattern, WhiteIsEveryVoxel) {
  EXPECT_THAT(Drawn(TestPattern::kWhite).Colors(),
              ::testing::ElementsAre(std::pair<const uint32_t, int>(0xFFFFFF, kNx * kNy * kNz)));
}

TEST(TestPattern, AxesPointFromTheMiddleToThePositiveFaces) {
  const Drawn drawn(TestPattern::kAxes);
  EXPECT_EQ(drawn.At(kNx - 1, kNy / 2, kNz / 2), 0xFF0000u);
  EXPECT_EQ(drawn.At(kNx / 2, kNy - 1, kNz / 2), 0x00FF00u);
  EXPECT_EQ(drawn.At(kNx / 2, kNy / 2, kNz - 1), 0x0000FFu);
  EXPECT_EQ(drawn.At(0, kNy / 2, kNz / 2), 0u);
  EXPECT_EQ(drawn.At(kNx / 2, 0, kNz / 2), 0u);
  EXPECT_EQ(drawn.At(kNx / 2, kNy / 2, 0), 0u);
}

TEST(TestPattern, CornersDifferInColourAndEdgesJoinThem) {
  const Drawn drawn(TestPattern::kCorners);
  std::set<uint32_t> colors;
  for (const int x : {0, kNx - 1}) {
    for (const int y : {0, kNy - 1}) {
      for (const int z : {0, kNz - 1}) colors.insert(drawn.At(x, y, z));
    }
  }
  EXPECT_EQ(colors.size(), 8u);
  EXPECT_FALSE(colors.contains(0));
  for (int x = 2; x < kNx - 2; ++x) {
    for (const int y : {0, kNy - 1}) {
      for (const int z : {0, kNz - 1}) EXPECT_EQ(drawn.At(x, y, z), 0x808080u);
    }
  }
  EXPECT_EQ(drawn.At(kNx / 2, kNy / 2, kNz / 2), 0u);
}

TEST(TestPattern, GridIsDotsEightApart) {
  const Drawn drawn(TestPattern::kGrid);
  EXPECT_EQ(drawn.At(4, 4, 4), 0xFFFFFFu);
  EXPECT_EQ(drawn.At(12, 4, 4), 0xFFFFFFu);
  EXPECT_EQ(drawn.Colors()[0xFFFFFF], 2);  // 4 and 12 in x, 4 in y, 4 in z (the next would be 12)
}

TEST(TestPattern, RampRisesAlongX) {
  const Drawn drawn(TestPattern::kRamp);
  uint32_t last = 0;
  for (int x = 0; x < kNx; ++x) {
    const uint32_t level = drawn.At(x, 3, kNz / 2) & 0xFF;
    EXPECT_EQ(drawn.At(x, 3, kNz / 2), level << 16 | level << 8 | level);
    EXPECT_TRUE(x == 0 || level > last);
    last = level;
  }
  EXPECT_EQ(last, 255u);
}

}  // namespace
}  // namespace voxeld::daemon
