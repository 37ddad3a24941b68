// Columns as levels: against the definitions of sampling, tone, dither and packing, pixel by pixel, on every
// instruction set of this processor.
#include "gpu/slice/level_columns.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <random>
#include <string>

#include "gpu/slice/pack.h"
#include "gpu/slice/quantize.h"
#include "gpu/word.h"
#include "hwy/highway.h"

namespace voxeld::gpu {
namespace {

display::Tone RandomTone(std::mt19937& random, display::Dither dither) {
  display::Tone tone;
  tone.dither = dither;
  for (size_t c = 1; c < 256; ++c) tone.lut[c] = static_cast<uint16_t>(random() % 65536);
  tone.lut[255] = 65535;
  return tone;
}

TEST(LevelTables, AreTheLevelsOfEveryChannelUnderEveryThreshold) {
  std::mt19937 random(1);
  for (const display::Dither dither : {display::Dither::kOrdered, display::Dither::kNone}) {
    const display::Tone tone = RandomTone(random, dither);
    const LevelTables tables = LevelTables::OfRgb332(tone);
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
                          Quantize(tone.lut[c], levels[k], threshold) << shifts[k])
                    << "channel " << k << " of " << c << " at " << u << ", " << v;
              }
            }
          }
        }
      }
    }
  }
}

// Runs `body` on each instruction set that is both compiled and here.
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

  // Fills a tile: one in `sparse` voxels is lit.
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

uint8_t PixelOf(const Scene& scene, const display::FootprintTable& table, const display::Tone& tone,
                int32_t slice, int32_t u, int32_t v, uint32_t sub, uint32_t sub_frames) {
  uint32_t most = 0;
  for (const auto& o : table.Outer(slice, u)) {
    for (const auto& i : table.Inner(slice, v)) {
      most = std::max(most, scene.At(o.x + i.x, o.y + i.y, o.z + i.z));
    }
  }
  const uint32_t rgb = Deinterleave(most);
  const uint32_t threshold =
      Threshold(tone.dither, static_cast<uint32_t>(u), static_cast<uint32_t>(v), sub, sub_frames);
  uint8_t pixel = 0;
  PackPixel(display::PixelFormat::kRgb332, 1, 1, 0, 0,
            {Quantize(tone.lut[rgb >> 16], 8, threshold),
             Quantize(tone.lut[rgb >> 8 & 0xFF], 8, threshold),
             Quantize(tone.lut[rgb & 0xFF], 4, threshold)},
            &pixel);
  return pixel;
}

void ExpectPictures(const Case& c, const Scene& scene, const display::FootprintTable& table,
                    const display::Tone& tone, const LevelColumns& columns, int32_t begin,
                    int32_t end) {
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
          const uint8_t want = PixelOf(scene, table, tone, slice, u, v, static_cast<uint32_t>(sub),
                                       static_cast<uint32_t>(c.sub_frames));
          lit += want != 0;
          ASSERT_EQ(picture[at], want)
              << c.name << ": slice " << slice << ", pixel " << u << ", " << v << ", sub " << sub;
        }
      }
    }
  }
  EXPECT_GT(lit, 0u) << "something was to be seen";
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
      // Dense, then thinned out, then a tile that changes, goes dark and comes back.
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
  Case fine = rotor;
  fine.geometry.grid.nz *= 2;
  fine.geometry.grid.pitch_mm.z = 0.5;
  EXPECT_FALSE(create(fine, PixelFormat::kRgb332, Sampling::kMax)) << "two voxels a row";
}

}  // namespace
}  // namespace voxeld::gpu
