// Benchmarks of assembly on the CPU: from a delta to the blended colours of tiles, and whole frames
// that consist mostly of assembly. Items are voxels a second. `PlainLines` is the reference for
// `RandomLines`: compare the two within one run.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <random>
#include <vector>

#include "display/geometry/footprint.h"
#include "gpu/assemble/volume.h"
#include "gpu/cpu/executor.h"
#include "gpu/delta.h"
#include "gpu/engine.h"
#include "tools/bench/frame/plain_lines.h"

namespace voxeld::gpu {
namespace {

void Check(const absl::Status& status) {
  if (status.ok()) return;
  fprintf(stderr, "assemble_bench: %s\n", std::string(status.message()).c_str());
  std::abort();
}

struct Draft {
  PrimitiveKind kind = PrimitiveKind::kSegments;
  std::vector<float> positions;
  std::vector<uint32_t> colors;  // one per vertex
};

// Returns a delta that replaces the geometry of the only drawable of the only layer.
std::vector<std::byte> DeltaOf(const Draft& scene, uint64_t id) {
  GeometryRecord g;
  g.id = id;
  g.kind = scene.kind;
  g.vertex_count = static_cast<uint32_t>(scene.positions.size() / 3);
  if (!scene.colors.empty()) g.color_mode = ColorMode::kPerVertex;
  DrawableRecord d;
  d.id = d.layer = 1;
  d.geometry = g.id;
  std::vector<std::byte> bytes(DeltaWriter::SizeOf(g) + DeltaWriter::SizeOf(d) +
                               DeltaWriter::kSizeOfId);
  DeltaWriter writer(bytes);
  writer.PutGeometry(g, scene.positions, {}, scene.colors);
  writer.PutDrawable(d);
  if (id > 1) writer.Drop(Op::kDropGeometry, id - 1);
  bytes.resize(writer.size());
  return bytes;
}

std::vector<std::byte> LayerDelta() {
  LayerRecord layer;
  layer.id = 1;
  std::vector<std::byte> bytes(DeltaWriter::SizeOf(layer));
  DeltaWriter(bytes).PutLayer(layer);
  return bytes;
}

// Makes `items` primitives of `corners` vertices each, every one in its own colour: inside a cube
// of `extent` voxels, or anywhere in the volume if `extent` is 0.
Draft RandomScene(uint64_t seed, PrimitiveKind kind, size_t corners, size_t items, float extent,
                  const int32_t size[3]) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<float> unit(0, 1);
  Draft scene;
  scene.kind = kind;
  for (size_t i = 0; i < items; ++i) {
    float origin[3] = {}, range[3];
    for (int a = 0; a < 3; ++a) {
      const float most = static_cast<float>(size[a]) - 0.02f;
      range[a] = extent > 0 ? extent : most;
      origin[a] = 0.01f + unit(random) * (most - range[a]);
    }
    const auto color = static_cast<uint32_t>(random() & 0xFFFFFF) | 0x010101;
    for (size_t c = 0; c < corners; ++c) {
      for (int a = 0; a < 3; ++a) scene.positions.push_back(origin[a] + unit(random) * range[a]);
      scene.colors.push_back(color);
    }
  }
  return scene;
}

// Measures a volume without slices: from the draw list to blended tiles.
void Assemble(benchmark::State& state, const Draft (&scenes)[2], const int32_t size[3],
              uint64_t voxels) {
  const std::unique_ptr<Executor> executor = MakeExecutor(static_cast<int>(state.range(0)));
  Volume volume(*executor);
  const TileGrid grid = TileGrid::Of(size[0], size[1], size[2]);
  volume.SetView(grid, Affine(), std::vector<uint8_t>(grid.count(), 1));
  Check(volume.Apply(LayerDelta(), nullptr));
  uint64_t id = 0, lit = 0, drawn = 0;
  std::vector<std::byte> delta;
  const auto frame = [&] {
    Check(volume.Apply(delta, nullptr));
    benchmark::DoNotOptimize(volume.Update(nullptr));
  };
  for (int i = 0; i < 2; ++i) {  // allocates the memory before the measurement
    delta = DeltaOf(scenes[id % 2], id + 1);
    ++id;
    frame();
  }
  for ([[maybe_unused]] auto _ : state) {
    state.PauseTiming();
    delta = DeltaOf(scenes[id % 2], id + 1);
    ++id;
    state.ResumeTiming();
    frame();
    lit += volume.lit_voxels();
    drawn += voxels;
  }
  state.SetItemsProcessed(static_cast<int64_t>(voxels != 0 ? drawn : lit));
}

constexpr int32_t kLineVolume[3] = {512, 512, 256};
constexpr size_t kLines = 126'000;

const Draft& LineScene(uint64_t seed) {
  static const Draft scenes[2] = {
      RandomScene(1, PrimitiveKind::kSegments, 2, kLines, 0, kLineVolume),
      RandomScene(2, PrimitiveKind::kSegments, 2, kLines, 0, kLineVolume)};
  return scenes[seed];
}

size_t DenseVoxels() {
  return static_cast<size_t>(kLineVolume[0]) * static_cast<size_t>(kLineVolume[1]) *
         static_cast<size_t>(kLineVolume[2]);
}

// A line of N steps has N + 1 voxels.
uint64_t VoxelsOf(const Draft& scene) {
  uint64_t voxels = 0;
  for (size_t i = 0; i < scene.positions.size(); i += 6) {
    const float* const p = &scene.positions[i];
    float n = 0;
    for (int a = 0; a < 3; ++a) n = std::max(n, std::abs(std::floor(p[3 + a]) - std::floor(p[a])));
    voxels += static_cast<uint64_t>(n) + 1;
  }
  return voxels;
}

uint64_t PlainFrame(std::vector<uint32_t>& dense, const Draft& scene) {
  const size_t room = bench::frame::PlainLinesRoom(static_cast<size_t>(kLineVolume[0]),
                                                   static_cast<size_t>(kLineVolume[1]));
  dense.resize(room + DenseVoxels());
  bench::frame::DrawPlainLines(scene.positions.data(), scene.colors.data(), 0,
                               scene.colors.size() / 2, kLineVolume[0], kLineVolume[1],
                               dense.data() + room);
  return VoxelsOf(scene);
}

void PlainLines(benchmark::State& state) {
  std::vector<uint32_t> dense(DenseVoxels());
  PlainFrame(dense, LineScene(0));
  uint64_t voxels = 0, turn = 0;
  for ([[maybe_unused]] auto _ : state) voxels += PlainFrame(dense, LineScene(turn++ % 2));
  state.SetItemsProcessed(static_cast<int64_t>(voxels));
}

void RandomLines(benchmark::State& state) {
  std::vector<uint32_t> dense(DenseVoxels());
  const uint64_t voxels = PlainFrame(dense, LineScene(0));
  dense = {};
  Assemble(state, {LineScene(0), LineScene(1)}, kLineVolume, voxels);
}

// Makes equilateral triangles with edges of `edge` voxels in random directions, each in its own
// colour.
Draft Tiles(uint64_t seed, size_t count, float edge, const int32_t size[3]) {
  std::mt19937_64 random(seed);
  std::normal_distribution<float> normal;
  std::uniform_real_distribution<float> unit(0, 1);
  Draft scene;
  scene.kind = PrimitiveKind::kTriangles;
  for (size_t i = 0; i < count; ++i) {
    float u[3], w[3], uu = 0, uw = 0, ww = 0;
    for (int a = 0; a < 3; ++a) u[a] = normal(random), w[a] = normal(random);
    for (int a = 0; a < 3; ++a) uu += u[a] * u[a], uw += u[a] * w[a];
    for (int a = 0; a < 3; ++a) w[a] -= u[a] * uw / uu, ww += w[a] * w[a];
    const float radius = edge / std::sqrt(3.0f);
    const auto color = static_cast<uint32_t>(random() & 0xFFFFFF) | 0x010101;
    float centre[3];
    for (int a = 0; a < 3; ++a) {
      centre[a] = edge + unit(random) * (static_cast<float>(size[a]) - 2 * edge);
    }
    for (int corner = 0; corner < 3; ++corner) {
      const float angle = static_cast<float>(corner) * 2.0943951f;
      for (int a = 0; a < 3; ++a) {
        scene.positions.push_back(centre[a] + radius * (std::cos(angle) * u[a] / std::sqrt(uu) +
                                                        std::sin(angle) * w[a] / std::sqrt(ww)));
      }
      scene.colors.push_back(color);
    }
  }
  return scene;
}

void SmallTriangles(benchmark::State& state) {
  constexpr int32_t kSize[3] = {256, 256, 256};
  static const Draft scenes[2] = {Tiles(3, 40'000, 20, kSize), Tiles(4, 40'000, 20, kSize)};
  Assemble(state, scenes, kSize, 0);
}

// An inline engine over a stack of slices, with its slice images.
class Frames {
 public:
  Frames(int32_t width, int32_t height, int32_t slices, display::PixelFormat format, int threads) {
    EngineOptions options;
    options.kind = EngineKind::kCpu;
    options.inline_execution = true;
    options.threads = threads;
    engine_ = std::move(*CreateEngine(options));
    display::PlanarStack stack;
    stack.width_px = width;
    stack.height_px = height;
    for (int32_t s = 0; s < slices; ++s) stack.positions_mm.push_back(s - (slices - 1) * 0.5);
    Target target;
    target.geometry = display::Geometry{stack, {}};
    target.geometry.grid = display::DefaultGrid(target.geometry);
    target.layout = {slices, width, height, 1, format};
    target.tone.SetCurve(display::Tone::Linear());
    bytes_.resize(target.layout.bytes());
    changed_.resize(target.layout.pictures());
    size_[0] = target.geometry.grid.nx;
    size_[1] = target.geometry.grid.ny;
    size_[2] = target.geometry.grid.nz;
    engine_->SetTarget(target, [](absl::Status s) { Check(s); });
    Apply(LayerDelta());
  }

  const int32_t* size() const { return size_; }

  void Apply(const std::vector<std::byte>& delta) {
    auto block = engine_->AcquireStaging(delta.size());
    Check(block.status());
    std::copy(delta.begin(), delta.end(), block->bytes().begin());
    engine_->Apply(*std::move(block), delta.size(), [](absl::Status s) { Check(s); });
  }

  FrameResult Frame() {
    FrameResult result;
    ++frame_;
    engine_->SubmitFrame({frame_, frame_ - 1}, {bytes_, changed_},
                         [&](absl::StatusOr<FrameResult> r) {
                           Check(r.status());
                           result = *r;
                         });
    return result;
  }

 private:
  std::unique_ptr<Engine> engine_;
  int32_t size_[3] = {};
  std::vector<std::byte> bytes_;
  std::vector<uint64_t> changed_;
  uint64_t frame_ = 0;
};

void WholeFrames(benchmark::State& state, Frames& frames, const Draft (&scenes)[2]) {
  uint64_t id = 0, lit = 0;
  double assemble = 0, slice = 0;
  std::vector<std::byte> deltas[2];
  for (int i = 0; i < 2; ++i) {
    frames.Apply(DeltaOf(scenes[id % 2], id + 1));
    ++id;
    frames.Frame();
  }
  for ([[maybe_unused]] auto _ : state) {
    state.PauseTiming();
    const std::vector<std::byte> delta = DeltaOf(scenes[id % 2], id + 1);
    ++id;
    state.ResumeTiming();
    frames.Apply(delta);
    const FrameResult result = frames.Frame();
    lit += result.lit_voxels;
    assemble += static_cast<double>(result.assemble_ns) * 1e-6;
    slice += static_cast<double>(result.slice_ns) * 1e-6;
  }
  state.SetItemsProcessed(static_cast<int64_t>(lit));
  state.counters["assemble_ms"] = benchmark::Counter(assemble, benchmark::Counter::kAvgIterations);
  state.counters["slice_ms"] = benchmark::Counter(slice, benchmark::Counter::kAvgIterations);
}

// Makes segments of `length` voxels in random directions.
Draft Threads(uint64_t seed, size_t count, float length, const int32_t size[3]) {
  std::mt19937_64 random(seed);
  std::normal_distribution<float> normal;
  std::uniform_real_distribution<float> unit(0, 1);
  Draft scene;
  while (scene.positions.size() < count * 6) {
    float start[3], way[3], square = 0;
    for (float& w : way) {
      w = normal(random);
      square += w * w;
    }
    bool inside = true;
    for (int a = 0; a < 3; ++a) {
      way[a] *= length / std::sqrt(square);
      start[a] = unit(random) * static_cast<float>(size[a]);
      const float end = start[a] + way[a];
      inside = inside && end >= 0 && end < static_cast<float>(size[a]);
    }
    if (!inside) continue;
    for (int end = 0; end < 2; ++end) {
      for (int a = 0; a < 3; ++a) {
        scene.positions.push_back(start[a] + static_cast<float>(end) * way[a]);
      }
    }
  }
  return scene;
}

void Vx1(benchmark::State& state) {
  Frames frames(912, 1140, 192, display::PixelFormat::kBitPlanes, static_cast<int>(state.range(0)));
  const Draft scenes[2] = {Threads(5, 20'000, 100, frames.size()),
                           Threads(6, 20'000, 100, frames.size())};
  WholeFrames(state, frames, scenes);
}

void Lattice64(benchmark::State& state) {
  Frames frames(64, 64, 64, display::PixelFormat::kRgb888, static_cast<int>(state.range(0)));
  const Draft scenes[2] = {Threads(7, 10'000, 20, frames.size()),
                           Threads(8, 10'000, 20, frames.size())};
  WholeFrames(state, frames, scenes);
}

BENCHMARK(PlainLines)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(RandomLines)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(SmallTriangles)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(Vx1)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(Lattice64)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace voxeld::gpu
