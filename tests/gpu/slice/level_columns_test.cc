// Compares columns as levels with the definitions of sampling, tone, dither and packing, pixel by
// pixel, on every instruction set of this processor.
#include "gpu/slice/level_columns.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <random>
#include <string>

#include "gpu/cpu/cpu_engine.h"
#include "gpu/delta.h"
#include "gpu/engine.h"
#include "gpu/slice/pack.h"
#include "gpu/slice/quantize.h"
#include "gpu/slice/sampler.h"
#include "gpu/word.h"
#include "hwy/highway.h"

namespace voxeld::gpu {
namespace {

display::Tone RandomTone(std::mt19937& random, display::Dither dither) {
  display::Tone tone;
  tone.dither = dither;
  for (display::Tone::Curve& curve : tone.lut) {
    for (size_t c = 1; c < 256; ++c) curve[c] = static_cast<uint16_t>(random() % 65536);
    curve[255] = 65535;
  }
  return tone;
}

TEST(LevelTables, AreTheLevelsOfEveryChannelUnderEveryThreshold) {
  std::mt19937 random(1);
  for (const display::Dither dither : {display::Dither::kOrdered, display::Dither::kNone}) {
    const display::Tone tone = RandomTone(random, dither);
    const LevelTables tables =
        LevelTables::OfRgb332({.format = display::PixelFormat::kRgb332}, tone);
    for (const uint32_t sub_frames : {1u, 3u, 64u}) {
      for (uint32_t sub = 0; sub < sub_frames; sub += sub_frames / 3 + 1) {
        for (uint32_t u = 0; u < 8; ++u) {
          const uint64_t column = DitherColumn(u, sub, sub_frames);
          for (uint32_t v = 0; v < 8; ++v) {
            const uint32_t threshold = Threshold(dither, u, v, sub, sub_frames);
            const uint32_t below = column >> (8 * v) & 0xFF;
            for (uint32_t c = 0; c < 256; ++c) {
              const uint32_t shifts[3] = {5, 2, 0}, levels[3] = {8, 8, 4};
              for (size_t k = 0; k < 3; ++k) {
                const uint32_t lifted = tables.rise[k][c] > below ? 1 : 0;
                ASSERT_EQ(tables.base[k][c] + (lifted << shifts[k]),
                          Quantize(tone.lut[k][c], levels[k], threshold) << shifts[k])
                    << "channel " << k << " of " << c << " at " << u << ", " << v;
              }
            }
          }
        }
      }
    }
  }
}

// Runs `body` on each instruction set that is both compiled and supported.
void OnEveryTarget(const std::function<void()>& body) {
  int ran = 0;
  for (int64_t left = hwy::SupportedTargets(); left != 0; left &= left - 1) {
    const int64_t target = left & -left;
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    if (ColumnTarget() == hwy::TargetName(target)) {
      SCOPED_TRACE(ColumnTarget());
      body();
      ++ran;
    }
    hwy::SetSupportedTargetsForTest(0);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  }
  EXPECT_GE(ran, 2);
  testing::Test::RecordProperty("targets", ran);
}

struct Case {
  std::string name;
  display::Geometry geometry;
  int32_t sub_frames = 1;
  int32_t begin = 0, end = -1;
  display::Dither dither = display::Dither::kOrdered;
};

Case RotorCase(std::string name, int32_t width, int32_t height, int32_t slices, int32_t diameter,
               int panels) {
  display::Rotor rotor;
  rotor.slices_per_turn = slices;
  rotor.width_px = width;
  rotor.height_px = height;
  rotor.panels.resize(static_cast<size_t>(panels));
  rotor.panels.back().eccentricity_mm = 3.25;
  const double half = diameter * 0.5;
  return {std::move(name),
          {rotor, {diameter, diameter, height, {1, 1, 1}, {-half, -half, -height * 0.5}}}};
}

std::vector<Case> Cases() {
  std::vector<Case> cases;
  cases.push_back(RotorCase("a block of columns, a chunk of rows", 16, 64, 90, 16, 2));
  cases.push_back(RotorCase("part of a block and of a chunk", 21, 37, 150, 24, 1));
  cases.push_back(RotorCase("rows of two chunks", 30, 70, 200, 36, 2));
  cases.push_back(RotorCase("three sub-frames", 16, 20, 120, 18, 1));
  cases.back().sub_frames = 3;
  cases.push_back(RotorCase("a part of the slices", 16, 20, 120, 18, 2));
  cases.back().begin = 31;
  cases.back().end = 177;
  cases.push_back(RotorCase("without dither", 16, 20, 120, 18, 1));
  cases.back().dither = display::Dither::kNone;
  return cases;
}

struct Scene {
  TileGrid grid;
  TileStore tiles;
  std::vector<uint32_t> all;

  explicit Scene(const display::VoxelGrid& voxels)
      : grid(TileGrid::Of(voxels.nx, voxels.ny, voxels.nz, 2)) {
    tiles.Reset(grid);
    for (uint32_t tile = 0; tile < grid.count(); ++tile) all.push_back(tile);
  }

  // Fills a tile so that one in `sparse` voxels is lit.
  void Fill(uint32_t tile, std::mt19937& random, uint32_t sparse) {
    std::vector<uint32_t> colors(kTileVoxels, 0);
    const Box3 box = grid.VoxelsOf(tile);
    uint32_t lit = 0;
    for (int32_t z = box.lo[2]; z < box.hi[2]; ++z) {
      for (int32_t y = box.lo[1]; y < box.hi[1]; ++y) {
        for (int32_t x = box.lo[0]; x < box.hi[0]; ++x) {
          if (sparse == 0 || random() % sparse != 0) continue;
          const uint32_t color = Interleave(random() & 0xFFFFFF);
          colors[grid.IndexInTile(x, y, z)] = color;
          lit += color != 0;
        }
      }
    }
    tiles.Set(tile, colors.data(), lit);
  }

  uint32_t At(int32_t x, int32_t y, int32_t z) const {
    const uint32_t* colors = tiles.colors(grid.TileOf(x, y, z));
    return colors == nullptr ? 0 : colors[grid.IndexInTile(x, y, z)];
  }
};

// `at` maps x, y, z to the interleaved colour.
template <class At>
uint8_t PixelOf(const At& at, const display::FootprintTable& table, const display::Tone& tone,
                int32_t slice, int32_t u, int32_t v, uint32_t sub, uint32_t sub_frames) {
  uint32_t most = 0;
  for (const auto& o : table.Outer(slice, u)) {
    for (const auto& i : table.Inner(slice, v)) {
      most = std::max(most, at(o.x + i.x, o.y + i.y, o.z + i.z));
    }
  }
  const uint32_t rgb = Deinterleave(most);
  const uint32_t threshold =
      Threshold(tone.dither, static_cast<uint32_t>(u), static_cast<uint32_t>(v), sub, sub_frames);
  uint8_t pixel = 0;
  PackPixel({display::PixelFormat::kRgb332, 3, 1, 1}, 0, 0,
            {Quantize(tone.lut[0][rgb >> 16], 8, threshold),
             Quantize(tone.lut[1][rgb >> 8 & 0xFF], 8, threshold),
             Quantize(tone.lut[2][rgb & 0xFF], 4, threshold)},
            &pixel);
  return pixel;
}

void ExpectPictures(const Case& c, const Scene& scene, const display::FootprintTable& table,
                    const display::Tone& tone, const LevelColumns& columns, int32_t begin,
                    int32_t end) {
  const auto voxel = [&](int32_t x, int32_t y, int32_t z) { return scene.At(x, y, z); };
  LevelColumns::Scratch scratch;
  size_t lit = 0;
  std::vector<int32_t> slices;
  for (int32_t slice = begin; slice < end; ++slice) {
    const size_t i = static_cast<size_t>(slice - begin) % 3;  // three at a time
    if (i == 0) {
      slices.assign({slice, std::min(slice + 1, end - 1), std::min(slice + 2, end - 1)});
    }
    for (int32_t sub = 0; sub < c.sub_frames; ++sub) {
      columns.Draw(slices, static_cast<uint32_t>(sub), scratch);
      const auto picture = columns.picture(i, scratch);
      ASSERT_EQ(picture.size(),
                static_cast<size_t>(table.width) * static_cast<size_t>(table.height));
      size_t at = 0;
      for (int32_t v = 0; v < table.height; ++v) {
        for (int32_t u = 0; u < table.width; ++u, ++at) {
          const uint8_t want = PixelOf(voxel, table, tone, slice, u, v, static_cast<uint32_t>(sub),
                                       static_cast<uint32_t>(c.sub_frames));
          lit += want != 0;
          ASSERT_EQ(picture[at], want)
              << c.name << ": slice " << slice << ", pixel " << u << ", " << v << ", sub " << sub;
        }
      }
    }
  }
  EXPECT_GT(lit, 0u) << "something was visible";
}

TEST(LevelColumns, DrawWhatTheFootprintsSay) {
  std::mt19937 random(5);
  const std::unique_ptr<Executor> executor = MakeSerialExecutor();
  OnEveryTarget([&] {
    for (const Case& c : Cases()) {
      const display::Tone tone = RandomTone(random, c.dither);
      const display::FootprintTable table =
          display::BuildFootprints(c.geometry, display::Sampling::kMax);
      const int32_t end = c.end < 0 ? table.slices : c.end;
      Scene scene(c.geometry.grid);
      std::optional<LevelColumns> columns =
          LevelColumns::Create(table, scene.grid,
                               {.slices = table.slices,
                                .width = table.width,
                                .height = table.height,
                                .sub_frames = c.sub_frames,
                                .format = display::PixelFormat::kRgb332},
                               tone, c.begin, end);
      ASSERT_TRUE(columns) << c.name;
      // Dense, then sparse, then a tile that changes, goes dark and is lit again.
      for (const uint32_t sparse : {1u, 9u}) {
        for (uint32_t tile : scene.all) scene.Fill(tile, random, sparse);
        columns->Update(scene.tiles, scene.all, *executor);
        ExpectPictures(c, scene, table, tone, *columns, c.begin, end);
      }
      const uint32_t one = scene.grid.count() - 1;
      for (const uint32_t sparse : {3u, 0u, 2u}) {
        scene.Fill(one, random, sparse);
        columns->Update(scene.tiles, std::span(&one, 1), *executor);
        ExpectPictures(c, scene, table, tone, *columns, c.begin, end);
      }
    }
  });
}

TEST(LevelColumns, AreForSharedListsOfOneRowAVoxelInRgb332Alone) {
  const Case rotor = RotorCase("", 16, 20, 120, 18, 1);
  const auto create = [](const Case& c, display::PixelFormat format, display::Sampling sampling) {
    display::Tone tone;
    tone.sampling = sampling;
    const display::FootprintTable table = display::BuildFootprints(c.geometry, sampling);
    const display::VoxelGrid& g = c.geometry.grid;
    return LevelColumns::Create(table, TileGrid::Of(g.nx, g.ny, g.nz, 2),
                                {.slices = table.slices,
                                 .width = table.width,
                                 .height = table.height,
                                 .format = format},
                                tone, 0, table.slices)
        .has_value();
  };
  using display::PixelFormat;
  using display::Sampling;
  EXPECT_TRUE(create(rotor, PixelFormat::kRgb332, Sampling::kMax));
  EXPECT_FALSE(create(rotor, PixelFormat::kRgb888, Sampling::kMax));
  EXPECT_FALSE(create(rotor, PixelFormat::kRgb332, Sampling::kWeighted));
  Case few = RotorCase("", 16, 20, 5, 18, 1);
  EXPECT_FALSE(create(few, PixelFormat::kRgb332, Sampling::kMax)) << "every list used about once";
  display::Lattice lights;  // eight in each voxel
  lights.width_px = 512;
  for (int i = 0; i < 512; ++i) {
    lights.points_mm.push_back(
        display::Vec3{i % 8 * 0.5 + 0.1, i / 8 % 8 * 0.5 + 0.1, i / 64 * 0.5 + 0.1});
  }
  lights.cell_mm = {0.1, 0.1, 0.1};
  const Case lattice = {"", {lights, {4, 4, 4, {1, 1, 1}, {0, 0, 0}}}};
  EXPECT_FALSE(create(lattice, PixelFormat::kRgb332, Sampling::kMax))
      << "there are no rows to follow";
  Case fine = rotor;
  fine.geometry.grid.nz *= 2;
  fine.geometry.grid.pitch_mm.z = 0.5;
  EXPECT_FALSE(create(fine, PixelFormat::kRgb332, Sampling::kMax)) << "two voxels a row";
}

// A whole engine whose pictures are drawn in this way: bytes, and the frames in which they changed.
class RotorEngine {
 public:
  explicit RotorEngine(const Target& target)
      : target_(target),
        table_(display::BuildFootprints(target.geometry, target.tone.sampling)),
        engine_(CreateCpuEngine({.threads = 2, .inline_execution = true}, "a test")),
        bytes_(target.layout.bytes()),
        changed_in_(target.layout.pictures()) {
    engine_->SetTarget(target, [](const absl::Status& status) { ASSERT_TRUE(status.ok()); });
    Apply([](DeltaWriter& w) { w.PutLayer({.id = 1}); });
  }

  void Apply(const std::function<void(DeltaWriter&)>& write) {
    StagingBlock block = *engine_->AcquireStaging(1 << 16);
    DeltaWriter writer(block.bytes());
    write(writer);
    ASSERT_FALSE(writer.overrun());
    engine_->Apply(std::move(block), writer.size(),
                   [](const absl::Status& status) { ASSERT_TRUE(status.ok()) << status; });
  }

  // Draws a frame and checks all of it.
  void ExpectFrame() {
    const std::vector<std::byte> before = bytes_;
    const std::vector<uint64_t> changed_before = changed_in_;
    ++frame_;
    engine_->SubmitFrame({frame_, frame_ - 1}, {bytes_, changed_in_},
                         [](const absl::StatusOr<FrameResult>& result) {
                           ASSERT_TRUE(result.ok()) << result.status();
                         });
    const display::VoxelGrid& grid = target_.geometry.grid;
    std::vector<uint32_t> voxels(static_cast<size_t>(grid.nx * grid.ny * grid.nz));
    engine_->ReadVoxels({0, 0, 0, grid.nx, grid.ny, grid.nz}, voxels,
                        [](const absl::Status& status) { ASSERT_TRUE(status.ok()); });
    const auto at = [&](int32_t x, int32_t y, int32_t z) {
      return Interleave(voxels[static_cast<size_t>((z * grid.ny + y) * grid.nx + x)]);
    };
    const display::FrameLayout& layout = target_.layout;
    const auto subs = static_cast<uint32_t>(layout.sub_frames);
    size_t byte = 0;
    for (size_t picture = 0; picture < layout.pictures(); ++picture) {
      const size_t begin = byte;
      for (int32_t v = 0; v < layout.height; ++v) {
        for (int32_t u = 0; u < layout.width; ++u, ++byte) {
          ASSERT_EQ(static_cast<uint8_t>(bytes_[byte]),
                    PixelOf(at, table_, target_.tone, static_cast<int32_t>(picture / subs), u, v,
                            static_cast<uint32_t>(picture % subs), subs))
              << "frame " << frame_ << ", picture " << picture << ", pixel " << u << ", " << v;
        }
      }
      const bool differs = !std::equal(bytes_.begin() + static_cast<ptrdiff_t>(begin),
                                       bytes_.begin() + static_cast<ptrdiff_t>(byte),
                                       before.begin() + static_cast<ptrdiff_t>(begin));
      ASSERT_EQ(changed_in_[picture], frame_ == 1 || differs ? frame_ : changed_before[picture])
          << "frame " << frame_ << ", picture " << picture;
    }
  }

 private:
  const Target target_;
  const display::FootprintTable table_;
  const std::unique_ptr<Engine> engine_;
  std::vector<std::byte> bytes_;
  std::vector<uint64_t> changed_in_;
  uint64_t frame_ = 0;
};

TEST(LevelColumns, AWholeEngineShowsThemAndTellsWhatChanged) {
  std::mt19937 random(11);
  Case rotor = RotorCase("", 20, 24, 130, 22, 2);
  Target target;
  target.geometry = rotor.geometry;
  target.layout = {.slices = display::SliceCount(rotor.geometry),
                   .width = 20,
                   .height = 24,
                   .sub_frames = 2,
                   .format = display::PixelFormat::kRgb332};
  target.tone = RandomTone(random, display::Dither::kOrdered);
  const display::FootprintTable table =
      display::BuildFootprints(target.geometry, display::Sampling::kMax);
  ASSERT_TRUE(LevelColumns::Create(table, TileGrid::Of(22, 22, 24, Sampler::FastestAxis(table)),
                                   target.layout, target.tone, 0, target.layout.slices))
      << "otherwise these are not used";
  RotorEngine engine(target);
  engine.ExpectFrame();  // nothing is drawn
  const auto put = [&](uint64_t geometry, uint64_t drawable, int lines) {
    std::vector<float> positions;
    for (int i = 0; i < lines * 2; ++i) {
      for (const uint32_t size : {22u, 22u, 24u}) {
        positions.push_back(static_cast<float>(random() % (size * 16)) / 16);
      }
    }
    engine.Apply([&](DeltaWriter& w) {
      GeometryRecord g;
      g.id = geometry;
      g.kind = PrimitiveKind::kSegments;
      g.color = static_cast<uint32_t>(random()) & 0xFFFFFF;
      g.vertex_count = static_cast<uint32_t>(lines) * 2;
      w.PutGeometry(g, positions, {}, {});
      w.PutDrawable({.id = drawable, .geometry = geometry, .layer = 1});
    });
  };
  put(1, 1, 1);
  engine.ExpectFrame();  // few slices have light
  put(2, 2, 60);
  engine.ExpectFrame();
  engine.ExpectFrame();  // as before
  put(3, 1, 2);          // replaces the first
  engine.ExpectFrame();
  engine.Apply([](DeltaWriter& w) { w.Drop(Op::kDropDrawable, 2); });
  engine.ExpectFrame();
  engine.Apply([](DeltaWriter& w) { w.Drop(Op::kDropDrawable, 1); });
  engine.ExpectFrame();  // dark again
  put(4, 4, 5);
  engine.ExpectFrame();
}

}  // namespace
}  // namespace voxeld::gpu
