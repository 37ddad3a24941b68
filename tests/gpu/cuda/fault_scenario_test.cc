// Tests the scenarios in which CUDA's calls are made to fail, played by the CPU engine.
#include "tests/gpu/cuda/fault_scenario.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/types/span.h"
#include "tests/conformance/conformance_test.h"

namespace voxeld::gpu {
namespace {

// Runs the step, and checks that the result is what the oracle draws. Returns true if it was a
// frame.
bool DrawsWhatItSays(FaultPlayer& player, const FaultStep& step) {
  const absl::Status status = player.Do(step);
  EXPECT_TRUE(status.ok()) << status;
  if (step.kind == FaultStep::Kind::kApply || step.kind == FaultStep::Kind::kTarget) return false;
  const conformance::DenseVolume want = conformance::OracleVoxels(step.scene, step.target);
  if (step.kind == FaultStep::Kind::kVoxels) {
    EXPECT_EQ(conformance::FirstDifference(player.seen().voxels, want, step.target), "");
    return false;
  }
  EXPECT_TRUE(player.seen().pictures == conformance::OraclePictures(want, step.target));
  return true;
}

TEST(FaultScenario, DrawsWhatItSaysAndSomethingNewWithEveryFrame) {
  FaultPlayer player(conformance::CaseOf("cpu", EngineKind::kCpu, false));
  std::vector<std::byte> before;
  int frames = 0;
  for (const FaultStep& step : FaultScenario()) {
    SCOPED_TRACE(step.name);
    if (!DrawsWhatItSays(player, step)) continue;
    ++frames;
    EXPECT_GT(player.seen().lit_voxels, 1000u);
    EXPECT_EQ(player.seen().singular_drawables, frames == 1 ? 0u : 1u);
    const bool out_of_sight = step.name == "the crowd has moved out of sight, drawn";
    EXPECT_EQ(player.seen().pictures == before, out_of_sight) << step.name;
    before = player.seen().pictures;
  }
  EXPECT_EQ(frames, 14);
}

TEST(FaultScenario, DrawsByChanceWhatItSays) {
#ifdef VOXELD_SANITIZED  // which makes them slow
  const absl::Span<const uint64_t> seeds = absl::MakeConstSpan(kFaultSeeds).first(2);
#else
  const absl::Span<const uint64_t> seeds = kFaultSeeds;
#endif
  for (const uint64_t seed : seeds) {
    FaultPlayer player(conformance::CaseOf("cpu", EngineKind::kCpu, false));
    uint64_t lit = 0;
    const std::vector<FaultStep> steps = RandomFaultScenario(seed);
    for (const FaultStep& step : steps) {
      SCOPED_TRACE("seed " + std::to_string(seed) + ", " + step.name);
      if (DrawsWhatItSays(player, step)) lit += player.seen().lit_voxels;
    }
    EXPECT_GT(lit, 1000u) << seed;
    EXPECT_EQ(steps.back().kind, FaultStep::Kind::kFrame);
  }
}

}  // namespace
}  // namespace voxeld::gpu
