#include "tests/gpu/cuda/fault_scenario.h"

#include <algorithm>
#include <random>
#include <utility>

#include "gpu/implicit/graph.h"
#include "tests/conformance/scene_generator.h"

namespace voxeld::gpu {
namespace {

using conformance::DeltaBuffer;
using conformance::ModelGeometry;

constexpr int32_t kSize = 48, kDepth = 32;
// More than the removed items that an engine keeps (cuda_volume.cc's kSpareItems).
constexpr uint32_t kCloud = 80'000;
constexpr uint32_t kLines = 3000;  // more than the smallest pass (pair_index.cc's kLeastPass)

Target StackTarget() {
  Target target;
  display::PlanarStack stack;
  stack.width_px = stack.height_px = kSize;
  for (int i = 0; i < kDepth; ++i) stack.positions_mm.push_back(i);
  target.geometry.shape = stack;
  target.geometry.grid = {kSize, kSize, kDepth, {1, 1, 1}, {-24, -24, -0.5}};
  target.layout = {.slices = kDepth, .width = kSize, .height = kSize};
  target.tone.SetCurve(display::Tone::Linear());
  return target;
}

ModelGeometry Vertices(uint64_t id, PrimitiveKind kind, uint32_t count, uint32_t seed) {
  ModelGeometry g;
  g.record.id = id;
  g.record.kind = kind;
  g.record.color = 0x3060FF;
  g.record.vertex_count = count;
  std::minstd_rand random(seed);
  std::uniform_real_distribution<float> side(0, kSize), depth(0, kDepth), step(-4, 4);
  float at[3] = {};
  for (uint32_t v = 0; v < count; ++v) {
    const bool near = kind == PrimitiveKind::kSegments && v % 2 == 1;
    for (int a = 0; a < 3; ++a) {
      at[a] = near ? at[a] + step(random) : a == 2 ? depth(random) : side(random);
      g.positions.push_back(at[a]);
    }
  }
  return g;
}

ModelGeometry Ball(uint64_t id, float x, float y, float z, float radius, uint32_t rgb) {
  ModelGeometry g;
  g.record.id = id;
  g.record.kind = PrimitiveKind::kSphere;
  g.record.fill = Fill::kSolid;
  g.record.color = rgb;
  const float params[4] = {x, y, z, radius};
  for (int i = 0; i < 4; ++i) g.record.params[i] = params[i];
  return g;
}

// Returns the lower half of a ball's shell, by an expression and its bound: all of them share one
// program.
ModelGeometry Bowl(uint64_t id, double x, double y, double z, double radius) {
  implicit::Graph graph;
  const double center[3] = {x, y, z};
  implicit::Graph::Node sum = graph.Constant(-radius * radius);
  for (int a = 0; a < 3; ++a) {
    sum = graph.Add(sum, graph.Square(graph.Sub(graph.Axis(a), graph.Constant(center[a]))));
  }
  ModelGeometry g;
  g.record.id = id;
  g.record.kind = PrimitiveKind::kImplicit;
  g.record.color = 0x60C0FF;
  g.record.thickness = 1.5F;
  g.indices = *implicit::Compile(
      graph, {.surface = sum, .bound = graph.Sub(graph.Axis(2), graph.Constant(z))});
  g.record.index_count = static_cast<uint32_t>(g.indices.size());
  return g;
}

// Writes a scenario, step by step.
class Script {
 public:
  void SetTarget(const std::string& name, const Target& target) {
    target_ = target;
    Add(FaultStep::Kind::kTarget, name);
  }
  void Put(const ModelGeometry& g, uint64_t layer, uint32_t erase = 0) {
    PutGeometry(g);
    Put(DrawableRecord{.id = g.record.id, .geometry = g.record.id, .layer = layer, .erase = erase});
  }
  void PutGeometry(const ModelGeometry& g) {
    scene_.geometries[g.record.id] = g;
    delta_.Put(g);
  }
  void Put(const DrawableRecord& d) {
    scene_.drawables[d.id] = d;
    delta_.Put(d);
  }
  void Put(const LayerRecord& l) {
    scene_.layers[l.id] = l;
    delta_.Put(l);
  }
  void DropGeometry(uint64_t id) {
    scene_.geometries.erase(id);
    delta_.Drop(Op::kDropGeometry, id);
  }
  void Drop(uint64_t id) {
    scene_.drawables.erase(id);
    delta_.Drop(Op::kDropDrawable, id);
    DropGeometry(id);
  }
  const DrawableRecord& drawable(uint64_t id) const { return scene_.drawables.at(id); }

  void Apply(const std::string& name) {
    Add(FaultStep::Kind::kApply, name);
    steps_.back().delta = std::exchange(delta_, {});
  }
  void Frame(const std::string& name) { Add(FaultStep::Kind::kFrame, name); }
  void Voxels(const std::string& name) { Add(FaultStep::Kind::kVoxels, name); }
  std::vector<FaultStep> Take() { return std::move(steps_); }

 private:
  void Add(FaultStep::Kind kind, const std::string& name) {
    steps_.push_back({kind, name, target_, {}, scene_});
  }

  Target target_;
  DeltaBuffer delta_;
  conformance::SceneModel scene_;
  std::vector<FaultStep> steps_;
};

}  // namespace

std::vector<FaultStep> FaultScenario() {
  Script script;
  script.SetTarget("first target", StackTarget());
  script.Put(LayerRecord{.id = 1});
  script.Put(LayerRecord{.id = 2, .order = 1, .opacity = 200, .blend = BlendMode::kAdd});
  script.Put(Vertices(1, PrimitiveKind::kSegments, 2 * kLines, 1), 1);
  script.Put(Vertices(2, PrimitiveKind::kTriangles, 60, 2), 1);
  script.Put(Ball(3, 20, 20, 16, 9, 0xFF4000), 2);
  ModelGeometry by_cpu = Vertices(4, PrimitiveKind::kSegments, 40, 5);
  by_cpu.record.drawn_by = DrawnBy::kCpu;
  script.Put(by_cpu, 2);
  script.Apply("first scene");
  script.Frame("first frame");

  script.DropGeometry(1);  // its drawable stays, and uses the new one
  script.PutGeometry(Vertices(1, PrimitiveKind::kSegments, 2 * kLines, 3));
  script.Drop(2);
  for (uint64_t i = 0; i < 60; ++i) {
    const auto at = static_cast<float>(i);
    script.Put(Ball(100 + i, at * 0.8F, 40 - at * 0.5F, 5 + at * 0.3F, 2.5F, 0x20FF40), 1,
               i % 7 == 0 ? 1 : 0);
  }
  DrawableRecord flat = script.drawable(130);
  flat.transform.m[0] = 0;  // without an inverse: draws nothing, but is counted
  script.Put(flat);
  script.Apply("more drawables than the table holds, one replaced, one dropped");
  script.Frame("after growth");

  script.Put(Vertices(500, PrimitiveKind::kPoints, kCloud, 4), 2);
  script.Apply("a cloud");
  script.Frame("with the cloud");
  script.Voxels("with the cloud, voxels");

  for (uint64_t i = 0; i < 6; ++i) {
    const auto at = static_cast<double>(i);
    script.Put(Bowl(5000 + i, 8 + 6 * at, 40 - 5 * at, 10 + 2 * at, 5), 1);
  }
  script.Apply("bowls");
  script.Frame("with bowls");

  script.Drop(500);
  script.Put(LayerRecord{
      .id = 2, .order = -1, .opacity = 255, .plane_count = 1, .planes = {{0.5, 0, 1, -20}}});
  script.Apply("the cloud has gone, its layer is clipped");
  script.Frame("without the cloud");

  Target darker = StackTarget();
  for (display::Tone::Curve& curve : darker.tone.lut) {
    for (uint16_t& light : curve) light /= 2;
  }
  darker.view.m[3] = 1.25;
  script.SetTarget("the same layout", darker);
  script.Put(LayerRecord{.id = 3, .order = 2});
  DrawableRecord moved = script.drawable(3);
  moved.layer = 3;
  moved.transform.m[7] = 6;
  script.Put(moved);
  script.Apply("a ball in a new layer");
  script.Frame("under the second target");

  // Many solids and nothing else: they move, change style, are hidden, and mask.
  LayerRecord crowd{.id = 4, .order = 1, .opacity = 210};
  script.Put(crowd);
  script.PutGeometry(Ball(600, 0, 0, 0, 2, 0xFFC040));
  for (uint64_t i = 0; i < 40; ++i) {
    const auto at = static_cast<double>(i);
    DrawableRecord ball{.id = 600 + i, .geometry = 600, .layer = crowd.id};
    ball.transform.m[3] = 4 + at, ball.transform.m[7] = 44 - at, ball.transform.m[11] = at * 0.7;
    script.Put(ball);
  }
  script.Apply("a crowd");
  script.Frame("with the crowd");
  const auto change = [&](const std::string& how) {
    script.Put(crowd);
    script.Apply(how);
    script.Frame(how + ", drawn");
  };
  crowd.opacity = 90;
  change("the crowd is fainter");
  crowd.transform.m[3] = 1.5, crowd.transform.m[1] = 0.2;
  change("the crowd has moved");
  crowd.transform.m[7] = -2;
  crowd.visible = 0;
  change("the crowd has moved away");
  crowd.transform.m[11] = 3;
  change("the crowd has moved out of sight");
  script.Put(LayerRecord{.id = 3, .order = 2, .has_mask = 1, .mask = crowd.id});
  crowd.transform.m[5] = 0.9;
  crowd.visible = 1;
  change("the crowd is back, and masks a layer");
  DrawableRecord out = script.drawable(610);
  out.layer = 1;
  script.Put(out);
  crowd.transform.m[0] = 1.1;
  change("one leaves the crowd, which moves");

  Target planes = darker;
  planes.layout.format = display::PixelFormat::kBitPlanes;
  planes.layout.sub_frames = 2;
  script.SetTarget("another layout", planes);
  script.Put(LayerRecord{.id = 2, .visible = 0});
  script.Drop(3);
  script.Apply("a layer hidden, a ball dropped");
  script.Voxels("before the last frame, voxels");
  script.Frame("last frame");
  return script.Take();
}

std::vector<FaultStep> RandomFaultScenario(uint64_t seed) {
  constexpr int kRandomSize = 24, kRounds = 5;
  conformance::SceneGenerator generator(seed);
  const auto roomy = [&] {
    for (;;) {
      Target target = generator.RandomTarget();
      const display::VoxelGrid& grid = target.geometry.grid;
      if (std::min({grid.nx, grid.ny, grid.nz}) >= 16) return target;
    }
  };
  std::vector<FaultStep> steps;
  FaultStep now{FaultStep::Kind::kTarget, "a target", roomy(), {}, {}};
  const auto add = [&](FaultStep::Kind kind, const std::string& name) {
    now.kind = kind;
    now.name = name;
    steps.push_back(now);
    now.delta = {};
  };
  add(FaultStep::Kind::kTarget, "a target");
  now.scene = generator.RandomScene(kRandomSize);
  now.delta.PutWhole(now.scene);
  add(FaultStep::Kind::kApply, "a scene");
  add(FaultStep::Kind::kFrame, "its frame");
  for (int round = 1; round <= 2 * kRounds; ++round) {
    const std::string which = " of round " + std::to_string(round);
    if (round == kRounds) {
      now.target = roomy();
      add(FaultStep::Kind::kTarget, "another target" + which);
    }
    for (int64_t n = generator.Int(2, 5); n > 0; --n) {
      generator.Change(now.scene, kRandomSize, now.delta);
    }
    add(FaultStep::Kind::kApply, "changes" + which);
    if (round % kRounds == 0) add(FaultStep::Kind::kVoxels, "voxels" + which);
    add(FaultStep::Kind::kFrame, "the frame" + which);
  }
  return steps;
}

FaultPlayer::FaultPlayer(const conformance::EngineCase& engine)
    : driver_(engine, {.threads = 1, .inline_execution = true}) {}

absl::Status FaultPlayer::Do(const FaultStep& step) {
  switch (step.kind) {
    case FaultStep::Kind::kTarget:
      return driver_.SetTarget(step.target);
    case FaultStep::Kind::kApply:
      return driver_.Apply(step.delta);
    case FaultStep::Kind::kFrame: {
      const absl::StatusOr<FrameResult> frame = driver_.Frame();
      if (!frame.ok()) return frame.status();
      seen_.pictures = driver_.pictures();
      seen_.changed_in = driver_.changed_in();
      seen_.lit_voxels = frame->lit_voxels;
      seen_.singular_drawables = frame->singular_drawables;
      return absl::OkStatus();
    }
    case FaultStep::Kind::kVoxels:
      break;
  }
  const display::VoxelGrid& grid = step.target.geometry.grid;
  std::vector<uint32_t> voxels(static_cast<size_t>(grid.nx) * static_cast<size_t>(grid.ny) *
                               static_cast<size_t>(grid.nz));
  absl::Status status = absl::InternalError("no answer");
  driver_.engine().ReadVoxels({0, 0, 0, grid.nx, grid.ny, grid.nz}, voxels,
                              [&](const absl::Status& done) { status = done; });
  if (status.ok()) seen_.voxels = std::move(voxels);
  return status;
}

}  // namespace voxeld::gpu
