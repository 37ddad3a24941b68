// Compares each engine with the oracle, and with itself when work is split into parts, threads and
// steps.
#include <algorithm>
#include <optional>
#include <utility>

#include "tests/conformance/conformance_test.h"

namespace voxeld::gpu::conformance {
namespace engine_conformance_test {

constexpr int kSize = 24;

INSTANTIATE_TEST_SUITE_P(Engines, EngineConformance, testing::ValuesIn(EngineCases()),
                         [](const auto& info) { return info.param.name; });

TEST_P(EngineConformance, RandomScenesEqualTheOracle) {
  constexpr uint64_t kScenes = 20269044;
  const uint64_t seed = SeedOr(kScenes);
  EngineDriver engine = Make();
  uint64_t lit = 0;
  for (uint64_t i = 0; i < 120; ++i) {
    SCOPED_TRACE("VOXELD_SEED=" + std::to_string(seed + i));
    SceneGenerator generator(seed + i);
    const Target target = generator.RandomTarget();
    const SceneModel scene = generator.RandomScene(kSize);
    DeltaBuffer delta;
    delta.PutWhole(scene);
    ASSERT_TRUE(engine.SetTarget(target).ok());
    const absl::Status applied = engine.Apply(delta);
    ASSERT_TRUE(applied.ok()) << applied;
    ExpectLikeOracle(engine, scene, target);
    if (HasFatalFailure()) return;
    lit += CountLit(engine.Voxels());
  }
  std::cout << lit << " voxels lit\n";
  EXPECT_GT(lit, seed == kScenes ? 10000u : 2000u) << "others may be sparser";
}

TEST_P(EngineConformance, PartsJoinedEqualTheWhole) {
  const uint64_t seed = SeedOr(1000);
  for (uint64_t i = 0; i < 25; ++i) {
    SCOPED_TRACE("VOXELD_SEED=" + std::to_string(seed + i));
    SceneGenerator generator(seed + i);
    const Target target = generator.RandomTarget();
    const SceneModel scene = generator.RandomScene(kSize);
    DeltaBuffer delta;
    delta.PutWhole(scene);
    const DenseVolume volume = OracleVoxels(scene, target);
    const std::vector<std::byte> whole = OraclePictures(volume, target);
    for (int parts : {1, 2, 5}) {
      std::vector<int32_t> cuts = {0, target.layout.slices};
      for (int cut = 1; cut < parts; ++cut) {
        cuts.push_back(static_cast<int32_t>(generator.Int(0, target.layout.slices)));
      }
      std::sort(cuts.begin(), cuts.end());
      std::vector<std::byte> joined(whole.size());
      std::vector<uint64_t> changed_in(target.layout.pictures());
      std::vector<uint32_t> voxels(volume.rgb.size());
      for (size_t part = 0; part + 1 < cuts.size(); ++part) {
        EngineDriver engine = Make({.threads = 1, .part = {cuts[part], cuts[part + 1]}});
        ASSERT_TRUE(engine.SetTarget(target).ok());
        ASSERT_TRUE(engine.Apply(delta).ok());
        ASSERT_TRUE(engine.Frame({.frame = 1}, {joined, changed_in}).ok());
        const std::vector<uint32_t> mine = engine.Voxels();
        for (size_t v = 0; v < voxels.size(); ++v) {
          if (mine[v] == 0) continue;
          ASSERT_EQ(mine[v], volume.rgb[v]) << "part " << part << ", voxel " << v;
          voxels[v] = mine[v];
        }
      }
      ASSERT_TRUE(joined == whole) << parts << " parts";
      for (uint64_t frame : changed_in) ASSERT_EQ(frame, 1u);
      // A voxel outside every part's tiles is seen by no slice.
      if (parts == 1) continue;
      EngineDriver one = Make({.threads = 1});
      ASSERT_TRUE(one.SetTarget(target).ok());
      ASSERT_TRUE(one.Apply(delta).ok());
      ASSERT_TRUE(voxels == one.Voxels()) << parts << " parts";
    }
  }
}

TEST_P(EngineConformance, ThreadsMakeNoDifference) {
  const uint64_t seed = SeedOr(2000);
  for (uint64_t i = 0; i < 10; ++i) {
    SCOPED_TRACE("VOXELD_SEED=" + std::to_string(seed + i));
    SceneGenerator generator(seed + i);
    const Target target = generator.RandomTarget();
    const SceneModel scene = generator.RandomScene(kSize);
    DeltaBuffer delta;
    delta.PutWhole(scene);
    std::vector<std::byte> pictures;
    std::vector<uint32_t> voxels;
    for (int threads : {1, 2, 3, 8}) {
      for (bool inline_execution : {false, true}) {
        EngineDriver engine = Make({.threads = threads, .inline_execution = inline_execution});
        ASSERT_TRUE(engine.SetTarget(target).ok());
        ASSERT_TRUE(engine.Apply(delta).ok());
        ASSERT_EQ(engine.Frame().status(), absl::OkStatus());
        if (pictures.empty()) {
          pictures = engine.pictures();
          voxels = engine.Voxels();
        }
        ASSERT_TRUE(engine.pictures() == pictures) << threads << " threads";
        ASSERT_TRUE(engine.Voxels() == voxels) << threads << " threads";
      }
    }
  }
}

TEST_P(EngineConformance, ThousandDeltasEqualTheSceneDrawnWhole) {
  const uint64_t seed = SeedOr(3000);
  std::cout << "VOXELD_SEED=" << seed << "\n";
  SceneGenerator generator(seed);
  Target target = generator.RandomTarget();
  while (target.geometry.grid.nx < 20 || target.geometry.grid.ny < 20 ||
         target.geometry.grid.nz < 20) {
    target = generator.RandomTarget();
  }
  SceneModel scene = generator.RandomScene(kSize);
  EngineDriver engine = Make();
  uint64_t lit = 0;
  int compared = 0;
  ASSERT_TRUE(engine.SetTarget(target).ok());
  DeltaBuffer first;
  first.PutWhole(scene);
  ASSERT_TRUE(engine.Apply(first).ok());
  const size_t size = target.layout.bytes_per_slice();
  std::vector<std::byte> before;
  std::vector<uint64_t> changed_in(target.layout.pictures(), 1);
  std::optional<EngineDriver> whole;
  for (int step = 1; step <= DeltasWanted(); ++step) {
    SCOPED_TRACE("step " + std::to_string(step));
    do {  // now and then several deltas in one frame
      DeltaBuffer delta;
      for (int64_t n = generator.Int(1, 3); n > 0; --n) generator.Change(scene, kSize, delta);
      const absl::Status applied = engine.Apply(delta);
      ASSERT_TRUE(applied.ok()) << applied;
    } while (generator.Chance(0.2));
    const absl::StatusOr<FrameResult> frame = engine.Frame();
    ASSERT_TRUE(frame.ok()) << frame.status();
    EXPECT_EQ(frame->frame, engine.frame());
    // The picture numbers say exactly which pictures changed.
    bool changed = before.empty();
    for (size_t p = 0; p < changed_in.size() && !before.empty(); ++p) {
      const auto at = static_cast<ptrdiff_t>(p * size);
      if (!std::equal(before.begin() + at, before.begin() + at + static_cast<ptrdiff_t>(size),
                      engine.pictures().begin() + at)) {
        changed_in[p] = frame->frame;
        changed = true;
      }
    }
    EXPECT_EQ(frame->changed, changed);
    ASSERT_EQ(engine.changed_in(), changed_in);
    before = engine.pictures();
    const std::vector<uint32_t> voxels = engine.Voxels();
    EXPECT_EQ(frame->lit_voxels, CountLit(voxels));
    lit += frame->lit_voxels;
    // Drawn by an engine that has forgotten everything, now and then by a new one.
    if (step % 50 == 1) whole.emplace(Make({.threads = 1, .inline_execution = true}));
    ASSERT_TRUE(whole->SetTarget(target).ok());
    DeltaBuffer everything;
    everything.Reset();
    everything.PutWhole(scene);
    ASSERT_TRUE(whole->Apply(everything).ok());
    ASSERT_EQ(whole->Frame().status(), absl::OkStatus());
    ASSERT_TRUE(whole->Voxels() == voxels);
    ASSERT_TRUE(whole->pictures() == engine.pictures());
    ++compared;
  }
  EXPECT_EQ(compared, DeltasWanted());
  std::cout << lit << " voxels lit in all frames\n";
  // A few deltas, as when run under a tool, may light next to nothing.
  EXPECT_GT(lit, DeltasWanted() < 1000 ? 0u : static_cast<uint64_t>(DeltasWanted()) * 10);
  ASSERT_EQ(engine.Frame().status(), absl::OkStatus());
  const DenseVolume want = OracleVoxels(scene, target);
  EXPECT_EQ(FirstDifference(engine.Voxels(), want, target), "");
  EXPECT_TRUE(engine.pictures() == OraclePictures(want, target));
}

TEST_P(EngineConformance, NewTargetsDrawTheSameSceneAnew) {
  const uint64_t seed = SeedOr(4000);
  std::cout << "VOXELD_SEED=" << seed << "\n";
  SceneGenerator generator(seed);
  const SceneModel scene = generator.RandomScene(kSize);
  DeltaBuffer delta;
  delta.PutWhole(scene);
  EngineDriver engine = Make();
  ASSERT_TRUE(engine.Apply(delta).ok());  // may precede the first target
  for (int i = 0; i < 12; ++i) {
    SCOPED_TRACE(i);
    const Target target = generator.RandomTarget();
    ASSERT_TRUE(engine.SetTarget(target).ok());
    ExpectLikeOracle(engine, scene, target);
    if (HasFatalFailure()) return;
  }
}

}  // namespace engine_conformance_test
}  // namespace voxeld::gpu::conformance
