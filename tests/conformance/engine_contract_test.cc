// Tests the contract of gpu/engine.h on calls, errors, buffers, and cost.
#include <algorithm>
#include <limits>
#include <map>

#include "display/geometry/footprint.h"
#include "tests/conformance/conformance_test.h"

namespace voxeld::gpu::conformance {
namespace engine_contract_test {

// Returns a stack of slices with one voxel a pixel: 48 × 48 × 32, so 3 × 3 × 2 tiles of 16.
Target StackTarget() {
  Target target;
  display::PlanarStack stack;
  stack.width_px = 48;
  stack.height_px = 48;
  for (int i = 0; i < 32; ++i) stack.positions_mm.push_back(i);
  target.geometry.shape = stack;
  target.geometry.grid = {48, 48, 32, {1, 1, 1}, {-24, -24, -0.5}};
  target.layout = {.slices = 32, .width = 48, .height = 48};
  target.tone.SetCurve(display::Tone::Linear());
  return target;
}

// One voxel.
ModelGeometry Dot(uint64_t id, float x, float y, float z, uint32_t rgb = 0xFFFFFF) {
  ModelGeometry g;
  g.record.id = id;
  g.record.kind = PrimitiveKind::kPoints;
  g.record.color = rgb;
  g.record.vertex_count = 1;
  g.positions = {x, y, z};
  return g;
}

// Two layers with a dot each: (1, 1, 1) in layer 1 and (40, 40, 20) in layer 2.
SceneModel TwoDots() {
  SceneModel scene;
  scene.layers[1].id = 1;
  scene.layers[2].id = 2;
  scene.geometries[1] = Dot(1, 1.5, 1.5, 1.5, 0xFF0000);
  scene.geometries[2] = Dot(2, 40.5, 40.5, 20.5, 0x00FF00);
  scene.drawables[1] = {.id = 1, .geometry = 1, .layer = 1};
  scene.drawables[2] = {.id = 2, .geometry = 2, .layer = 2};
  return scene;
}

DeltaBuffer Whole(const SceneModel& scene) {
  DeltaBuffer delta;
  delta.PutWhole(scene);
  return delta;
}

class EngineContract : public EngineConformance {
 protected:
  EngineContract() : engine_(Make()) {
    EXPECT_TRUE(engine_.SetTarget(target_).ok());
    EXPECT_TRUE(engine_.Apply(Whole(scene_)).ok());
  }
  FrameResult MustFrame() {
    absl::StatusOr<FrameResult> frame = engine_.Frame();
    EXPECT_TRUE(frame.ok()) << frame.status();
    return frame.value_or(FrameResult{});
  }
  void Put(const auto& record) {
    DeltaBuffer delta;
    delta.Put(record);
    const absl::Status status = engine_.Apply(delta);
    EXPECT_TRUE(status.ok()) << status;
  }

  const Target target_ = StackTarget();
  SceneModel scene_ = TwoDots();
  EngineDriver engine_;
};

INSTANTIATE_TEST_SUITE_P(Engines, EngineContract, testing::ValuesIn(EngineCases()),
                         [](const auto& info) { return info.param.name; });

TEST_P(EngineContract, InfoNamesKindDeviceAndReason) {
  const EngineInfo& info = engine_.engine().info();
  EXPECT_NE(info.kind, EngineKind::kAuto);
  EXPECT_NE(info.device, "");
  EXPECT_NE(info.reason, "");
}

TEST_P(EngineContract, FrameCountsWhatWasDone) {
  const FrameResult first = MustFrame();
  EXPECT_TRUE(first.changed);
  EXPECT_EQ(first.lit_voxels, 2u);
  EXPECT_EQ(first.tiles_drawn, 2u);
  EXPECT_EQ(first.pictures_drawn, 32u);
  EXPECT_GE(first.memory_bytes,
            engine_.pictures().size() + size_t{2} * 16 * 16 * 16 * sizeof(uint32_t))
      << "the pictures, and the tiles with light";
  const FrameResult second = MustFrame();
  EXPECT_FALSE(second.changed);
  EXPECT_EQ(second.tiles_drawn, 0u);
  EXPECT_EQ(second.pictures_drawn, 0u);
  EXPECT_EQ(second.lit_voxels, 2u);
}

TEST_P(EngineContract, OnlyChangedTilesAndTheirSlicesAreDrawn) {
  MustFrame();
  scene_.drawables[1].transform.m[3] = 1;
  Put(scene_.drawables[1]);
  const FrameResult frame = MustFrame();
  EXPECT_TRUE(frame.changed);
  EXPECT_EQ(frame.tiles_drawn, 1u);
  // Pictures that look at 16 layers of voxels, and one or two neighbours.
  EXPECT_LE(frame.pictures_drawn, 18u);
  int changed = 0;
  for (uint64_t number : engine_.changed_in()) changed += number == 2;
  EXPECT_EQ(changed, 1);
}

TEST_P(EngineContract, LayerChangesDrawOnlyTheTilesOfTheLayer) {
  MustFrame();
  LayerRecord layer = scene_.layers[1];
  layer.opacity = 128;
  Put(layer);
  EXPECT_EQ(MustFrame().tiles_drawn, 1u);
  layer.visible = 0;
  Put(layer);
  FrameResult frame = MustFrame();
  EXPECT_EQ(frame.tiles_drawn, 1u);
  EXPECT_EQ(frame.lit_voxels, 1u);
  // While the layer is hidden, its changes cost nothing.
  layer.order = 7;
  Put(layer);
  scene_.drawables[1].transform.m[3] = 2;
  Put(scene_.drawables[1]);
  EXPECT_EQ(MustFrame().tiles_drawn, 0u);
  layer.visible = 1;
  layer.transform.m[11] = 20;
  Put(layer);
  frame = MustFrame();
  EXPECT_EQ(frame.tiles_drawn, 1u);
  EXPECT_EQ(frame.lit_voxels, 2u);
  // The same record again changes nothing.
  Put(layer);
  EXPECT_EQ(MustFrame().tiles_drawn, 0u);
}

TEST_P(EngineContract, ATileThatComesOutTheSameChangesNoPicture) {
  MustFrame();
  scene_.drawables[1].priority = 77;
  Put(scene_.drawables[1]);
  const FrameResult frame = MustFrame();
  EXPECT_EQ(frame.tiles_drawn, 1u);
  EXPECT_EQ(frame.pictures_drawn, 0u);
  EXPECT_FALSE(frame.changed);
}

TEST_P(EngineContract, BuffersAreBroughtUpFromWhatTheyHold) {
  std::vector<std::byte> bytes[2];
  std::vector<uint64_t> numbers[2];
  uint64_t holds[2] = {0, 0};
  for (int b = 0; b < 2; ++b) {
    bytes[b].assign(target_.layout.bytes(), std::byte{0x5A});
    numbers[b].assign(target_.layout.pictures(), 99);
  }
  for (uint64_t frame = 1; frame <= 9; ++frame) {
    scene_.drawables[1].transform.m[11] = static_cast<double>(frame);
    Put(scene_.drawables[1]);
    const size_t b = frame % 3 == 0 ? 1 : 0;
    ASSERT_TRUE(
        engine_.Frame({.frame = frame, .buffer_holds = holds[b]}, {bytes[b], numbers[b]}).ok());
    holds[b] = frame;
    const DenseVolume volume = OracleVoxels(scene_, target_);
    ASSERT_TRUE(bytes[b] == OraclePictures(volume, target_)) << "frame " << frame;
  }
}

TEST_P(EngineContract, PicturesThatDidNotChangeAreNotWritten) {
  std::vector<std::byte> bytes(target_.layout.bytes());
  std::vector<uint64_t> numbers(target_.layout.pictures());
  ASSERT_TRUE(engine_.Frame({.frame = 5}, {bytes, numbers}).ok());
  const std::vector<std::byte> mark(bytes.size(), std::byte{0x77});
  bytes = mark;
  ASSERT_TRUE(engine_.Frame({.frame = 6, .buffer_holds = 5}, {bytes, numbers}).ok());
  EXPECT_TRUE(bytes == mark);
  for (uint64_t number : numbers) EXPECT_EQ(number, 5u);
}

TEST_P(EngineContract, BadFramesAreRefusedAndLeaveNoTrace) {
  std::vector<std::byte> bytes(target_.layout.bytes());
  std::vector<uint64_t> numbers(target_.layout.pictures());
  const auto code = [&](const FrameRequest& request, FrameBuffer buffer) {
    return engine_.Frame(request, buffer).status().code();
  };
  EXPECT_EQ(code({.frame = 0}, {bytes, numbers}), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code({.frame = 3, .buffer_holds = 3}, {bytes, numbers}),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code({.frame = 3}, {std::span(bytes).first(10), numbers}),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code({.frame = 3}, {bytes, std::span(numbers).first(1)}),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code({.frame = 3}, {bytes, numbers}), absl::StatusCode::kOk);
  EXPECT_EQ(code({.frame = 3}, {bytes, numbers}), absl::StatusCode::kInvalidArgument);
  EngineDriver fresh = Make();
  EXPECT_EQ(fresh.Frame({.frame = 1}, {bytes, numbers}).status().code(),
            absl::StatusCode::kFailedPrecondition);
}

TEST_P(EngineContract, AMalformedDeltaChangesNothing) {
  MustFrame();
  const std::vector<std::byte> pictures = engine_.pictures();
  std::map<std::string, DeltaBuffer> bad;
  const auto begin = [&](const char* name) -> DeltaBuffer& {
    DeltaBuffer& delta = bad[name];
    delta.Drop(Op::kDropDrawable, 1);  // would be visible
    return delta;
  };
  begin("unknown drawable").Drop(Op::kDropDrawable, 9);
  begin("dropped twice").Drop(Op::kDropDrawable, 1);
  begin("geometry exists").Put(Dot(2, 1, 1, 1));
  begin("geometry in use").Drop(Op::kDropGeometry, 2);
  begin("layer in use").Drop(Op::kDropLayer, 2);
  begin("unknown geometry").Put(DrawableRecord{.id = 7, .geometry = 8, .layer = 1});
  begin("unknown layer").Put(DrawableRecord{.id = 7, .geometry = 1, .layer = 8});
  begin("bad priority").Put(DrawableRecord{.id = 7, .geometry = 1, .layer = 1, .priority = 127});
  begin("bad opacity").Put(LayerRecord{.id = 1, .opacity = 256});
  begin("after a reset").Reset();
  bad["after a reset"].Put(DrawableRecord{.id = 1, .geometry = 1, .layer = 1});
  for (const auto& [name, delta] : bad) {
    SCOPED_TRACE(name);
    EXPECT_EQ(engine_.Apply(delta).code(), absl::StatusCode::kInvalidArgument);
    const FrameResult frame = MustFrame();
    EXPECT_FALSE(frame.changed);
    EXPECT_EQ(frame.tiles_drawn, 0u);
    EXPECT_TRUE(engine_.pictures() == pictures);
  }
  // Truncated at any place, too.
  const DeltaBuffer whole = Whole(TwoDots());
  for (size_t size = 1; size < whole.bytes().size(); size += 8) {
    if (size % 16 == 0) continue;
    EXPECT_EQ(engine_.ApplyBytes(std::span(whole.bytes()).first(size), whole.referred()).code(),
              absl::StatusCode::kInvalidArgument)
        << size;
  }
  EXPECT_FALSE(MustFrame().changed);
}

TEST_P(EngineContract, IdsMayBeUsedAgainWithinADelta) {
  MustFrame();
  DeltaBuffer delta;
  delta.Drop(Op::kDropGeometry, 1);
  delta.Put(Dot(1, 5.5, 1.5, 1.5, 0x0000FF));
  delta.Drop(Op::kDropLayer, 2);
  delta.Put(LayerRecord{.id = 2, .opacity = 255});
  ASSERT_TRUE(engine_.Apply(delta).ok());
  scene_.geometries[1] = Dot(1, 5.5, 1.5, 1.5, 0x0000FF);
  ExpectLikeOracle(engine_, scene_, target_);
}

TEST_P(EngineContract, StagingIsLimitedAndComesBack) {
  EngineDriver engine = Make({.threads = 1, .staging_limit_bytes = 4096});
  ASSERT_TRUE(engine.SetTarget(target_).ok());
  {
    absl::StatusOr<StagingBlock> all = engine.engine().AcquireStaging(4096);
    ASSERT_TRUE(all.ok());
    EXPECT_EQ(all->bytes().size(), 4096u);
    EXPECT_EQ(reinterpret_cast<uintptr_t>(all->bytes().data()) % 16, 0u);
    EXPECT_EQ(engine.engine().AcquireStaging(1).status().code(),
              absl::StatusCode::kResourceExhausted);
  }
  EXPECT_EQ(engine.engine().AcquireStaging(4097).status().code(),
            absl::StatusCode::kResourceExhausted);
  // The engine holds none of the memory after a delta has been applied, however often it is
  // replaced.
  for (int i = 0; i < 3; ++i) {
    DeltaBuffer delta;
    delta.Reset();
    delta.PutWhole(scene_);
    ASSERT_TRUE(engine.Apply(delta).ok());
    EXPECT_TRUE(engine.engine().AcquireStaging(4096).ok());
  }
  ExpectLikeOracle(engine, scene_, target_);
}

TEST_P(EngineContract, SingularSolidsAreCountedAndDrawNothing) {
  ModelGeometry sphere;
  sphere.record.id = 3;
  sphere.record.kind = PrimitiveKind::kSphere;
  sphere.record.params[0] = sphere.record.params[1] = sphere.record.params[2] = 10;
  sphere.record.params[3] = 4;
  DrawableRecord drawable{.id = 3, .geometry = 3, .layer = 1};
  drawable.transform.m[0] = 0;
  DeltaBuffer delta;
  delta.Put(sphere);
  delta.Put(drawable);
  ASSERT_TRUE(engine_.Apply(delta).ok());
  FrameResult frame = MustFrame();
  EXPECT_EQ(frame.singular_drawables, 1u);
  EXPECT_EQ(frame.lit_voxels, 2u);
  drawable.transform.m[0] = 1;
  Put(drawable);
  frame = MustFrame();
  EXPECT_EQ(frame.singular_drawables, 0u);
  EXPECT_GT(frame.lit_voxels, 100u);
}

TEST_P(EngineContract, BadTargetsAreRefusedAndTheOldOneStays) {
  MustFrame();
  std::map<std::string, Target> bad;
  const auto add = [&](const char* name) -> Target& { return bad[name] = target_; };
  add("slices").layout.slices = 31;
  add("width").layout.width = 47;
  add("height").layout.height = 49;
  add("sub_frames").layout.sub_frames = 0;
  add("too many sub_frames").layout.sub_frames = 65;
  add("format").layout.format = static_cast<display::PixelFormat>(9);
  add("lut").tone.lut[1][0] = 1;
  add("density").tone.density = static_cast<display::Density>(2);
  add("bits").layout.bits = 9;
  add("view").view.m[5] = std::numeric_limits<double>::infinity();
  add("grid").geometry.grid.nx = 0;
  for (const auto& [name, target] : bad) {
    const absl::Status status = engine_.SetTarget(target);
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << name << ": " << status;
  }
  EXPECT_FALSE(MustFrame().changed);
}

// When the tone changes, pictures that stay as they were keep their numbers.
TEST_P(EngineContract, ANewToneKeepsBlackPictures) {
  MustFrame();
  Target darker = target_;
  for (display::Tone::Curve& curve : darker.tone.lut) {
    for (uint16_t& light : curve) light /= 2;
  }
  // Without the driver, since its SetTarget forgets what its buffer holds.
  std::vector<std::byte> bytes(target_.layout.bytes());
  std::vector<uint64_t> numbers(target_.layout.pictures());
  ASSERT_TRUE(engine_.SetTarget(darker).ok());
  const absl::StatusOr<FrameResult> frame = engine_.Frame({.frame = 2}, {bytes, numbers});
  ASSERT_TRUE(frame.ok());
  EXPECT_EQ(std::count(numbers.begin(), numbers.end(), 2u), 2);
  EXPECT_EQ(std::count(numbers.begin(), numbers.end(), 1u), 30);
  EXPECT_TRUE(bytes == OraclePictures(OracleVoxels(scene_, darker), darker));
}

TEST_P(EngineContract, VoxelsOfAnyBoxCanBeRead) {
  std::vector<uint32_t> out(4 * 3 * 2, 0x12345678);
  absl::Status answer = absl::UnknownError("no answer");
  EngineDriver engine = Make({.threads = 1, .inline_execution = true});
  ASSERT_TRUE(engine.SetTarget(target_).ok());
  ASSERT_TRUE(engine.Apply(Whole(scene_)).ok());
  const auto take = [&](absl::Status status) { answer = status; };
  engine.engine().ReadVoxels({-1, 0, 0, 3, 3, 2}, out, take);
  ASSERT_TRUE(answer.ok()) << answer;
  for (size_t i = 0; i < out.size(); ++i) {
    EXPECT_EQ(out[i], i == (1 * 3 + 1) * 4 + 2 ? 0xFF0000u : 0u) << i;
  }
  engine.engine().ReadVoxels({0, 0, 0, 3, 3, 2}, out, take);
  EXPECT_EQ(answer.code(), absl::StatusCode::kInvalidArgument);
}

// Each call is answered once, in order, also when the engine is destroyed in between.
TEST_P(EngineContract, EveryCallIsAnsweredOnceAndInOrder) {
  std::vector<int> answers;
  {
    EngineDriver engine = Make({.threads = 1});
    for (int i = 0; i < 200; ++i) {
      absl::StatusOr<StagingBlock> block = engine.engine().AcquireStaging(16);
      ASSERT_TRUE(block.ok());
      engine.engine().Apply(*std::move(block), 0, [&answers, i](absl::Status status) {
        answers.push_back(i);
        EXPECT_TRUE(status.ok() || absl::IsCancelled(status)) << status;
      });
    }
  }
  ASSERT_EQ(answers.size(), 200u);
  for (int i = 0; i < 200; ++i) EXPECT_EQ(answers[static_cast<size_t>(i)], i);
}

}  // namespace engine_contract_test
}  // namespace voxeld::gpu::conformance
