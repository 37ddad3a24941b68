// Whole frames through the engine's door: draw list to packed slices.
// Items are voxels drawn a second; beside each stands what the machine's memory allows
// for the same bytes (memcpy of the frame).
#include <benchmark/benchmark.h>

#include <cstring>
#include <memory>
#include <random>
#include <vector>

#include "display/geometry/footprint.h"
#include "gpu/delta.h"
#include "gpu/engine.h"

namespace voxeld::gpu {
namespace {

display::Geometry Stack(int32_t n) {
  display::PlanarStack stack;
  stack.width_px = stack.height_px = n;
  for (int32_t s = 0; s < n; ++s) stack.positions_mm.push_back(s - (n - 1) * 0.5);
  display::Geometry geometry{stack, {}};
  geometry.grid = display::DefaultGrid(geometry);
  return geometry;
}

display::Geometry VortexRotor() {
  display::Rotor rotor;
  rotor.slices_per_turn = 360;
  rotor.width_px = 128;
  rotor.height_px = 64;
  rotor.panels.resize(2);
  rotor.panels[0].eccentricity_mm = 13.5;
  rotor.panels[1].eccentricity_mm = 0.375;
  display::Geometry geometry{rotor, {}};
  geometry.grid = display::DefaultGrid(geometry);
  return geometry;
}

// An inline engine that draws `geometry` in voxel coordinates.
class Bench {
 public:
  Bench(const display::Geometry& geometry, display::PixelFormat format) {
    EngineOptions options;
    options.kind = EngineKind::kCpu;
    options.inline_execution = true;
    engine_ = std::move(*CreateEngine(options));
    Target target;
    target.geometry = geometry;
    target.layout.slices = display::SliceCount(geometry);
    std::visit(
        [&](const auto& shape) {
          target.layout.width = shape.width_px;
          target.layout.height = shape.height_px;
        },
        geometry.shape);
    target.layout.format = format;
    target.tone.SetCurve(display::Tone::Linear());
    bytes_.resize(target.layout.bytes());
    changed_.resize(target.layout.pictures());
    grid_ = geometry.grid;
    engine_->SetTarget(target, [](absl::Status s) { Check(s); });
    LayerRecord layer;
    layer.id = 1;
    Apply(DeltaWriter::SizeOf(layer), [&](DeltaWriter& w) { w.PutLayer(layer); });
  }

  const display::VoxelGrid& grid() const { return grid_; }
  size_t frame_bytes() const { return bytes_.size(); }

  // Replaces the drawn segments: vertices two by two.
  void PutSegments(const std::vector<float>& positions) {
    GeometryRecord g;
    g.id = ++id_;
    g.kind = PrimitiveKind::kSegments;
    g.vertex_count = static_cast<uint32_t>(positions.size() / 3);
    DrawableRecord d;
    d.id = 1;
    d.geometry = g.id;
    d.layer = 1;
    const size_t size = DeltaWriter::SizeOf(g) + DeltaWriter::SizeOf(d) + DeltaWriter::kSizeOfId;
    Apply(size, [&](DeltaWriter& w) {
      w.PutGeometry(g, positions, {}, {});
      w.PutDrawable(d);
      if (id_ > 1) w.Drop(Op::kDropGeometry, id_ - 1);
    });
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
  static void Check(const absl::Status& status) {
    if (!status.ok()) {
      fprintf(stderr, "engine: %s\n", std::string(status.message()).c_str());
      std::abort();
    }
  }

  template <typename Write>
  void Apply(size_t size, Write write) {
    auto block = engine_->AcquireStaging(size);
    Check(block.status());
    DeltaWriter writer(block->bytes());
    write(writer);
    engine_->Apply(*std::move(block), writer.size(), [](absl::Status s) { Check(s); });
  }

  std::unique_ptr<Engine> engine_;
  display::VoxelGrid grid_;
  std::vector<std::byte> bytes_;
  std::vector<uint64_t> changed_;
  uint64_t id_ = 0, frame_ = 0;
};

// `count` segments of at most `length` voxels along each axis, inside the grid.
std::vector<float> RandomSegments(std::mt19937& random, const display::VoxelGrid& grid, int count,
                                  float length) {
  std::vector<float> positions;
  positions.reserve(static_cast<size_t>(count) * 6);
  const float size[3] = {static_cast<float>(grid.nx), static_cast<float>(grid.ny),
                         static_cast<float>(grid.nz)};
  std::uniform_real_distribution<float> unit(0, 1);
  for (int i = 0; i < count; ++i) {
    float start[3];
    for (int a = 0; a < 3; ++a) positions.push_back(start[a] = unit(random) * size[a]);
    for (int a = 0; a < 3; ++a) {
      const float step = (unit(random) * 2 - 1) * length;
      positions.push_back(std::min(std::max(start[a] + step, 0.0f), size[a] - 0.01f));
    }
  }
  return positions;
}

void LinesFrame(benchmark::State& state, const display::Geometry& geometry,
                display::PixelFormat format, int count, float length) {
  Bench bench(geometry, format);
  std::mt19937 random(7);
  const std::vector<float> scenes[2] = {RandomSegments(random, bench.grid(), count, length),
                                        RandomSegments(random, bench.grid(), count, length)};
  size_t turn = 0;
  uint64_t lit = 0;
  for ([[maybe_unused]] auto _ : state) {
    bench.PutSegments(scenes[turn++ % 2]);
    lit += bench.Frame().lit_voxels;
  }
  state.SetItemsProcessed(static_cast<int64_t>(lit));
  state.counters["lines/s"] =
      benchmark::Counter(static_cast<double>(count), benchmark::Counter::kIsIterationInvariantRate);
}

// The ceiling beside it: copying as many bytes as the frame has.
void CopyFrame(benchmark::State& state, const display::Geometry& geometry,
               display::PixelFormat format) {
  Bench bench(geometry, format);
  std::vector<char> from(bench.frame_bytes(), 1), to(bench.frame_bytes());
  for ([[maybe_unused]] auto _ : state) {
    std::memcpy(to.data(), from.data(), from.size());
    benchmark::DoNotOptimize(to.data());
    benchmark::ClobberMemory();
  }
  state.SetBytesProcessed(static_cast<int64_t>(state.iterations() * bench.frame_bytes()));
}

BENCHMARK_CAPTURE(LinesFrame, lattice64_1000_short, Stack(64), display::PixelFormat::kRgb888, 1000,
                  20.0f)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(LinesFrame, stack128_20000_long, Stack(128), display::PixelFormat::kRgb888, 20000,
                  100.0f)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(LinesFrame, stack128_20000_long_bitplanes, Stack(128),
                  display::PixelFormat::kBitPlanes, 20000, 100.0f)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(LinesFrame, rotor_20000_long_rgb332, VortexRotor(), display::PixelFormat::kRgb332,
                  20000, 60.0f)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(CopyFrame, stack128, Stack(128), display::PixelFormat::kRgb888)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(CopyFrame, rotor, VortexRotor(), display::PixelFormat::kRgb332)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace voxeld::gpu
