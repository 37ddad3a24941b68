// Tests displays whose pixels are voxels, which an engine may draw in another way: many thin lines,
// across every edge of volumes that are not multiples of a tile.
#include <cstdlib>
#include <random>

#include "display/geometry/footprint.h"
#include "tests/conformance/conformance_test.h"

namespace voxeld::gpu::conformance {
namespace {

Target StackOf(int32_t width, int32_t height, int32_t slices, display::PixelFormat format) {
  Target target;
  display::PlanarStack stack;
  stack.width_px = width;
  stack.height_px = height;
  for (int32_t s = 0; s < slices; ++s) stack.positions_mm.push_back(s - (slices - 1) * 0.5);
  target.geometry.shape = stack;
  target.geometry.grid = display::DefaultGrid(target.geometry);
  target.layout = {.slices = slices, .width = width, .height = height, .format = format};
  target.tone.SetCurve(display::Tone::Linear());
  return target;
}

// Returns lines and points in one layer, of one or two colours each, some of zero length.
SceneModel RandomLines(uint64_t seed, uint32_t lines, const display::VoxelGrid& grid) {
  std::mt19937_64 random(seed);
  SceneModel scene;
  scene.layers[1].id = 1;
  for (uint64_t id = 1; id <= 4; ++id) {
    ModelGeometry& g = scene.geometries[id];
    g.record.id = id;
    g.record.kind = id == 4 ? PrimitiveKind::kPoints : PrimitiveKind::kSegments;
    g.record.sampling = id == 2 ? LineSampling::kEuclidean : LineSampling::kThin;
    g.record.color_mode = ColorMode::kPerVertex;
    for (uint32_t i = 0; i < lines; ++i) {
      const float size[3] = {static_cast<float>(grid.nx), static_cast<float>(grid.ny),
                             static_cast<float>(grid.nz)};
      float start[3];
      for (int end = 0; end < 2; ++end) {
        for (int a = 0; a < 3; ++a) {
          std::uniform_real_distribution<float> anywhere(-0.3F * size[a], 1.3F * size[a]);
          std::uniform_real_distribution<float> near(-1, 1);
          const float at = end == 1 && i % 3 == 0 ? start[a] + near(random) : anywhere(random);
          if (end == 0) start[a] = at;
          g.positions.push_back(at);
        }
        const bool same = end == 1 && i % 2 == 0;
        g.colors.push_back(same ? g.colors.back() : static_cast<uint32_t>(random() & 0xFFFFFF));
      }
    }
    g.record.vertex_count = static_cast<uint32_t>(g.positions.size() / 3);
    scene.drawables[id] = {.id = id, .geometry = id, .layer = 1, .priority = id == 3 ? 2u : 1u};
  }
  return scene;
}

DeltaBuffer Whole(const SceneModel& scene) {
  DeltaBuffer delta;
  delta.PutWhole(scene);
  return delta;
}

uint64_t Seed() {
  const char* const text = std::getenv("VOXELD_SEED");
  return text != nullptr ? std::strtoull(text, nullptr, 10) : 1;
}

class OwnResolution : public EngineConformance {};

INSTANTIATE_TEST_SUITE_P(Engines, OwnResolution, testing::ValuesIn(EngineCases()),
                         [](const auto& info) { return info.param.name; });

TEST_P(OwnResolution, LinesOverAllEdgesEqualTheOracle) {
  for (const auto format : {display::PixelFormat::kBitPlanes, display::PixelFormat::kRgb888,
                            display::PixelFormat::kRgb332}) {
    Target target = StackOf(43, 70, 20, format);
    target.layout.sub_frames = 2;
    target.tone.dither = display::Dither::kOrdered;
    const SceneModel scene = RandomLines(Seed(), 200, target.geometry.grid);
    EngineDriver engine = Make();
    ASSERT_TRUE(engine.SetTarget(target).ok());
    ASSERT_TRUE(engine.Apply(Whole(scene)).ok());
    ExpectLikeOracle(engine, scene, target);
  }
}

// More lines in each neighbourhood than any list of an engine takes at once.
TEST_P(OwnResolution, CrowdsEqualTheOracle) {
  const Target target = StackOf(120, 100, 60, display::PixelFormat::kBitPlanes);
  const SceneModel scene = RandomLines(Seed() + 2, 40'000, target.geometry.grid);
  EngineDriver engine = Make();
  ASSERT_TRUE(engine.SetTarget(target).ok());
  ASSERT_TRUE(engine.Apply(Whole(scene)).ok());
  ExpectLikeOracle(engine, scene, target);
}

TEST_P(OwnResolution, PartsJoinedEqualTheWhole) {
  const Target target = StackOf(64, 40, 50, display::PixelFormat::kBitPlanes);
  const SceneModel scene = RandomLines(Seed() + 1, 150, target.geometry.grid);
  const std::vector<std::byte> want = OraclePictures(OracleVoxels(scene, target), target);
  std::vector<std::byte> joined(target.layout.bytes());
  const size_t size = target.layout.bytes_per_slice();
  for (const auto& [begin, end] : {std::pair(0, 7), {7, 33}, {33, 50}}) {
    EngineOptions options;
    options.threads = 2;
    options.part = {begin, end};
    EngineDriver engine = Make(options);
    ASSERT_TRUE(engine.SetTarget(target).ok());
    ASSERT_TRUE(engine.Apply(Whole(scene)).ok());
    ASSERT_EQ(engine.Frame().status(), absl::OkStatus());
    std::copy(engine.pictures().begin() + static_cast<ptrdiff_t>(begin * size),
              engine.pictures().begin() + static_cast<ptrdiff_t>(end * size),
              joined.begin() + static_cast<ptrdiff_t>(begin * size));
  }
  EXPECT_TRUE(joined == want);
}

// A line within a voxel has the colours of both its ends there, and the greater one shows.
TEST_P(OwnResolution, ALineWithinAVoxelShowsTheGreaterColour) {
  const Target target = StackOf(32, 32, 16, display::PixelFormat::kRgb888);
  SceneModel scene;
  scene.layers[1].id = 1;
  ModelGeometry& g = scene.geometries[1];
  g.record.id = 1;
  g.record.kind = PrimitiveKind::kSegments;
  g.record.color_mode = ColorMode::kPerVertex;
  g.positions = {5.2F, 5.5F, 5.5F, 5.7F, 5.5F, 5.5F};
  g.colors = {0x000010, 0xFFFFFF};
  g.record.vertex_count = 2;
  scene.drawables[1] = {.id = 1, .geometry = 1, .layer = 1};
  EngineDriver engine = Make();
  ASSERT_TRUE(engine.SetTarget(target).ok());
  ASSERT_TRUE(engine.Apply(Whole(scene)).ok());
  ASSERT_EQ(engine.Frame().status(), absl::OkStatus());
  const std::vector<uint32_t> voxels = engine.Voxels();
  EXPECT_EQ(voxels[(5 * 32 + 5) * 32 + 5], 0xFFFFFFu);
  EXPECT_EQ(CountLit(voxels), 1u);
}

// A strip with one corner has no lines: it is removed after those that were inserted with it.
TEST_P(OwnResolution, DrawablesWithoutLinesComeAndGo) {
  const Target target = StackOf(32, 32, 16, display::PixelFormat::kRgb888);
  SceneModel scene = RandomLines(Seed() + 3, 4, target.geometry.grid);
  scene.geometries[2].record.topology = Topology::kStrip;
  scene.geometries[2].record.vertex_count = 1;
  scene.geometries[2].positions.resize(3);
  scene.geometries[2].colors.resize(1);
  EngineDriver engine = Make();
  ASSERT_TRUE(engine.SetTarget(target).ok());
  ASSERT_TRUE(engine.Apply(Whole(scene)).ok());
  ExpectLikeOracle(engine, scene, target);
  for (const uint64_t id : {1, 3, 4, 2}) {
    DeltaBuffer delta;
    delta.Drop(Op::kDropDrawable, id);
    scene.drawables.erase(id);
    ASSERT_TRUE(engine.Apply(delta).ok());
    ExpectLikeOracle(engine, scene, target);
  }
}

// Changes drawn for a reader of voxels are reported with the next frame, also if the target is set
// in between; and nothing of them stays when a target is sliced in another way.
TEST_P(OwnResolution, ChangesBetweenTargetsAreTold) {
  Target target = StackOf(48, 48, 20, display::PixelFormat::kBitPlanes);
  const SceneModel before = RandomLines(Seed() + 2, 50, target.geometry.grid);
  EngineDriver engine = Make();
  ASSERT_TRUE(engine.SetTarget(target).ok());
  ASSERT_TRUE(engine.Apply(Whole(before)).ok());
  ExpectLikeOracle(engine, before, target);
  SceneModel after = before;
  after.drawables.erase(2);
  after.drawables[1].transform.m[7] = 3;
  DeltaBuffer delta;
  delta.Drop(Op::kDropDrawable, 2);
  delta.Put(after.drawables[1]);
  ASSERT_TRUE(engine.Apply(delta).ok());
  ASSERT_FALSE(engine.Voxels().empty());
  ASSERT_TRUE(engine.SetTarget(target).ok());
  ExpectLikeOracle(engine, after, target);

  DeltaBuffer nothing;
  for (const uint64_t id : {1, 3, 4}) nothing.Drop(Op::kDropDrawable, id);
  ASSERT_FALSE(engine.Voxels().empty());
  target.tone.sampling = display::Sampling::kWeighted;
  ASSERT_TRUE(engine.SetTarget(target).ok());
  ASSERT_TRUE(engine.Apply(nothing).ok());
  after.drawables.clear();
  ExpectLikeOracle(engine, after, target);
}

}  // namespace
}  // namespace voxeld::gpu::conformance
