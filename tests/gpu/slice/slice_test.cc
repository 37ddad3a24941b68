#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <optional>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "gpu/slice/blue_noise.h"
#include "gpu/slice/finish.h"
#include "gpu/slice/light_plan.h"
#include "gpu/slice/pack.h"
#include "gpu/slice/quantize.h"
#include "gpu/slice/sampler.h"
#include "gpu/slice/weight.h"
#include "gpu/word.h"

namespace voxeld::gpu {
namespace {

TEST(Quantize, BayerMatrixHasEachValueOnceAndTheClassicFirstRows) {
  std::set<uint32_t> values;
  for (uint32_t v = 0; v < 8; ++v) {
    for (uint32_t u = 0; u < 8; ++u) values.insert(Bayer8(u, v));
  }
  EXPECT_EQ(values.size(), 64u);
  EXPECT_EQ(*values.rbegin(), 63u);
  const uint32_t row0[8] = {0, 32, 8, 40, 2, 34, 10, 42};
  const uint32_t row1[8] = {48, 16, 56, 24, 50, 18, 58, 26};
  for (uint32_t u = 0; u < 8; ++u) {
    EXPECT_EQ(Bayer8(u, 0), row0[u]);
    EXPECT_EQ(Bayer8(u + 8, 9), row1[u]);  // repeats every 8 pixels
  }
}

TEST(Quantize, FullIsFullAndDarkIsDarkUnderEveryThreshold) {
  for (uint32_t levels : {2u, 4u, 8u, 256u}) {
    for (uint32_t sub = 0; sub < 64; ++sub) {
      for (uint32_t u = 0; u < 8; ++u) {
        const uint32_t t = Threshold(display::Dither::kOrdered, u, 3, sub, 64);
        EXPECT_LE(t, 65534u);
        EXPECT_EQ(Quantize(65535, levels, t), levels - 1);
        EXPECT_EQ(Quantize(0, levels, t), 0u);
      }
    }
  }
}

// Without dither, to the nearest: with two levels the step is at 32768; with 256, at half of 257.
TEST(Quantize, WithoutDitherRoundsToTheNearest) {
  const uint32_t t = Threshold(display::Dither::kNone, 5, 6, 1, 2);
  EXPECT_EQ(t, 32767u);
  EXPECT_EQ(Quantize(32767, 2, t), 0u);
  EXPECT_EQ(Quantize(32768, 2, t), 1u);
  EXPECT_EQ(Quantize(128, 256, t), 0u);
  EXPECT_EQ(Quantize(129, 256, t), 1u);
}

// B = 0: 65535/128 = 511; one sub-frame of two later: B = 32: 65·65535/128 = 33279.
TEST(Quantize, ThresholdsAreAsCountedByHand) {
  EXPECT_EQ(Threshold(display::Dither::kOrdered, 0, 0, 0, 2), 511u);
  EXPECT_EQ(Threshold(display::Dither::kOrdered, 0, 0, 1, 2), 33279u);
  EXPECT_EQ(Threshold(display::Dither::kOrdered, 5, 7, 0, 1), (2u * 29 + 1) * 65535 / 128);
}

// A quarter of the light lights a quarter of the pixels, in space and in time.
TEST(Quantize, LightIsKeptOnAverage) {
  for (uint32_t sub_frames : {1u, 4u, 64u}) {
    uint32_t lit = 0;
    for (uint32_t sub = 0; sub < sub_frames; ++sub) {
      for (uint32_t v = 0; v < 8; ++v) {
        for (uint32_t u = 0; u < 8; ++u) {
          lit += Quantize(16384, 2, Threshold(display::Dither::kOrdered, u, v, sub, sub_frames));
        }
      }
    }
    EXPECT_EQ(lit, 16 * sub_frames);
  }
}

TEST(Pack, Rgb888) {
  uint8_t picture[2 * 2 * 3] = {};
  PackPixel({display::PixelFormat::kRgb888, 8, 2, 2}, 1, 1, {1, 2, 3}, picture);
  const uint8_t want[12] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 2, 3};
  EXPECT_TRUE(std::equal(std::begin(want), std::end(want), picture));
}

TEST(Pack, Rgb332) {
  uint8_t picture[2] = {};
  PackPixel({display::PixelFormat::kRgb332, 3, 2, 1}, 1, 0, {7, 2, 1}, picture);
  EXPECT_EQ(picture[0], 0);
  EXPECT_EQ(picture[1], 0b11101001);
}

// Nine pixels a row: two bytes; three planes of 2 × 2 bytes.
TEST(Pack, BitPlanes) {
  uint8_t picture[12] = {};
  PackPixel({display::PixelFormat::kBitPlanes, 1, 9, 2}, 0, 0, {1, 0, 1}, picture);
  PackPixel({display::PixelFormat::kBitPlanes, 1, 9, 2}, 8, 1, {0, 1, 1}, picture);
  PackPixel({display::PixelFormat::kBitPlanes, 1, 9, 2}, 7, 0, {1, 0, 0}, picture);
  const uint8_t want[12] = {0x81, 0, 0, 0, 0, 0, 0, 0x80, 0x80, 0, 0, 0x80};
  for (int i = 0; i < 12; ++i) EXPECT_EQ(picture[i], want[i]) << i;
}

// Two bits: the planes of the higher bit of red, green and blue, then of the lower.
TEST(Pack, BitPlanesOfSeveralBits) {
  uint8_t picture[6] = {};
  PackPixel({display::PixelFormat::kBitPlanes, 2, 8, 1}, 0, 0, {2, 1, 3}, picture);
  PackPixel({display::PixelFormat::kBitPlanes, 2, 8, 1}, 7, 0, {1, 0, 0}, picture);
  const uint8_t want[6] = {0x80, 0, 0x80, 0x01, 0x80, 0x80};
  for (int i = 0; i < 6; ++i) EXPECT_EQ(picture[i], want[i]) << i;
}

// Four rows of two: rows 0 and 2, 1 and 3 side by side; the higher bit first.
TEST(Pack, Hub75) {
  uint8_t picture[8] = {};
  const PictureShape shape{display::PixelFormat::kHub75, 2, 2, 4};
  PackPixel(shape, 0, 0, {2, 0, 1}, picture);
  PackPixel(shape, 0, 2, {3, 2, 0}, picture);
  PackPixel(shape, 1, 3, {0, 0, 1}, picture);
  const uint8_t want[8] = {0b011'001, 0, 0, 0, 0b001'100, 0, 0, 0b100'000};
  for (int i = 0; i < 8; ++i) EXPECT_EQ(picture[i], want[i]) << i;
}

TEST(Pack, Planes24) {
  uint8_t picture[6] = {};
  // Red in parts 0 and 7, green in part 2, blue in part 5.
  PackPixel({display::PixelFormat::kPlanes24, 1, 2, 1}, 1, 0, {0b10000001, 0b100, 0b100000},
            picture);
  const uint8_t want[6] = {0, 0, 0, 0b1000'0001, 0, 0b0010'0010};
  for (int i = 0; i < 6; ++i) EXPECT_EQ(picture[i], want[i]) << i;
}

TEST(Finish, DimsLightByTheRowsFactor) {
  std::vector<uint16_t> curves(768);
  curves[255] = 65535;
  curves[256 + 255] = 30000;
  const uint16_t factors[2] = {65535, 32768};
  Finish finish;
  finish.curves = curves.data();
  EXPECT_EQ(finish.LightAt(0xFFFFFF, 1).r, 65535u);
  finish.factors = factors;
  EXPECT_EQ(finish.LightAt(0xFFFFFF, 0).r, 65535u);
  EXPECT_EQ(finish.LightAt(0xFFFFFF, 0).g, 30000u);
  EXPECT_EQ(finish.LightAt(0xFFFFFF, 1).r, 32768u);
  EXPECT_EQ(finish.LightAt(0xFFFFFF, 1).g, 15000u);
  EXPECT_EQ(finish.LightAt(0xFFFFFF, 1).b, 0u);
}

// Eight parts of each sub-frame go through evenly spread thresholds: for light n/16, n bits of two
// sub-frames are set.
TEST(Finish, PartsOfPlanes24AreDitheredOverTime) {
  std::vector<uint16_t> curves(768);
  Finish finish;
  finish.format = display::PixelFormat::kPlanes24;
  finish.dither = display::Dither::kOrdered;
  finish.bits = 1;
  finish.sub_frames = 2;
  finish.curves = curves.data();
  for (uint32_t n = 0; n <= 16; ++n) {
    int lit = 0;
    for (uint32_t sub = 0; sub < 2; ++sub) {
      const Levels q = finish.LevelsAt({n * 65535 / 16, 0, 65535}, 0, 3, 5, sub);
      lit += std::popcount(q.r);
      EXPECT_EQ(q.g, 0u);
      EXPECT_EQ(q.b, 0xFFu);
    }
    EXPECT_EQ(lit, static_cast<int>(n));
  }
}

// The factor that guarantees light: a step below it, some pixel stays dark.
TEST(LeastFactor, LightsEveryPixelAndNoLessDoes) {
  const std::array<uint16_t, kNoiseRanks>& noise = BlueNoise();
  for (const display::PixelFormat format :
       {display::PixelFormat::kRgb332, display::PixelFormat::kBitPlanes,
        display::PixelFormat::kPlanes24}) {
    for (const display::Dither dither :
         {display::Dither::kNone, display::Dither::kOrdered, display::Dither::kBlueNoise}) {
      for (const int32_t sub_frames : {1, 3}) {
        display::Tone tone;
        tone.SetCurve(display::Tone::Linear());
        tone.dither = dither;
        const display::FrameLayout layout{
            .slices = 1, .width = 64, .height = 64, .sub_frames = sub_frames, .format = format};
        const std::vector<uint16_t> curves(768, 65535);
        const uint32_t least = LeastFactor(layout, tone);
        Finish finish;
        finish.format = format;
        finish.dither = dither;
        finish.bits = static_cast<uint32_t>(layout.bits_per_channel());
        finish.sub_frames = static_cast<uint32_t>(sub_frames);
        finish.curves = curves.data();
        finish.noise = noise.data();
        const auto dark = [&](uint32_t factor) {
          int count = 0;
          for (uint32_t pixel = 0; pixel < 4096; ++pixel) {
            uint32_t lit = 0;
            for (uint32_t sub = 0; sub < finish.sub_frames; ++sub) {
              lit |= finish.LevelsAt({Dim(65535, factor), 0, 0}, 0, pixel % 64, pixel / 64, sub).r;
            }
            count += lit == 0;
          }
          return count;
        };
        EXPECT_EQ(dark(least), 0) << static_cast<int>(format) << " " << static_cast<int>(dither);
        EXPECT_GT(dark(least - least / 64 - 2), 0);
      }
    }
  }
}

TEST(Weight, RoundsAsTheDefinitionSays) {
  EXPECT_EQ(FootprintWeight(255, 200), 200u);
  EXPECT_EQ(FootprintWeight(128, 128), 64u);  // (16384 + 127)/255
  EXPECT_EQ(WeighChannel(128, 255), 128u);
  EXPECT_EQ(WeighChannel(64, 1), 0u);
  EXPECT_EQ(WeighChannel(128, 1), 1u);
  EXPECT_EQ(RaiseWeighted(0x10FF00, 128, 0xFF0002), 0x80FF01u);
}

// One slice, two pixels wide, two high. Pixel (0, ·) sees x = 1 and 17 (in the next tile), pixel
// (1, ·) nothing lit; rows see z = 0 alone, and z = 0 and 1.
display::FootprintTable HandTable() {
  display::FootprintTable table;
  table.slices = 1;
  table.width = 2;
  table.height = 2;
  table.outer.begin = {0, 2, 3};
  table.outer.entries = {{1, 2, 0, 255}, {17, 2, 0, 128}, {5, 5, 0, 255}};
  table.inner.begin = {0, 1, 3};
  table.inner.entries = {{0, 0, 0, 255}, {0, 0, 0, 255}, {0, 0, 1, 64}};
  return table;
}

TileStore HandTiles(uint32_t at_1, uint32_t at_17, uint32_t at_17_above) {
  TileStore tiles;
  tiles.Reset(TileGrid::Of(20, 8, 4));
  std::vector<uint32_t> colors(kTileVoxels, 0);
  colors[tiles.grid().IndexInTile(1, 2, 0)] = Interleave(at_1);
  EXPECT_TRUE(tiles.Set(0, colors.data(), 1));
  EXPECT_FALSE(tiles.Set(0, colors.data(), 1));
  colors.assign(kTileVoxels, 0);
  colors[tiles.grid().IndexInTile(17, 2, 0)] = Interleave(at_17);
  colors[tiles.grid().IndexInTile(17, 2, 1)] = Interleave(at_17_above);
  EXPECT_TRUE(tiles.Set(1, colors.data(), 2));
  return tiles;
}

// Returns the colours of all pixels, row by row.
std::vector<uint32_t> Sampled(const TileStore& tiles, display::Sampling sampling) {
  const display::FootprintTable table = HandTable();
  absl::StatusOr<Sampler> sampler = Sampler::Create(table, tiles.grid(), sampling);
  EXPECT_TRUE(sampler.ok()) << sampler.status();
  SlicePixels pixels;
  sampler->Sample(tiles, 0, pixels);
  std::vector<uint32_t> colors(static_cast<size_t>(table.width * table.height));
  for (const auto& [rgb, u, v] : pixels.lit) {
    uint32_t& color = colors[v * static_cast<uint32_t>(table.width) + u];
    EXPECT_EQ(color, 0u) << "reported twice";
    EXPECT_NE(rgb, 0u);
    color = rgb;
  }
  return colors;
}

TEST(Sampler, MaxTakesTheGreatestWordOfTheFootprint) {
  const std::vector<uint32_t> pixels =
      Sampled(HandTiles(0xFF0000, 0x00FF00, 0x808080), display::Sampling::kMax);
  // Grey's word is greater than green's: the highest bits are equal, then the bit of red decides.
  EXPECT_EQ(pixels, (std::vector<uint32_t>{0x00FF00, 0, 0x808080, 0}));
  const std::vector<uint32_t> other =
      Sampled(HandTiles(0xFF0000, 0x000001, 0x808080), display::Sampling::kMax);
  EXPECT_EQ(other, (std::vector<uint32_t>{0xFF0000, 0, 0x808080, 0}));
}

// Green at half weight: 128;
// grey above at (128·64 + 127)/255 = 32, of 0x80: (32·128 + 127)/255 = 16.
TEST(Sampler, WeightedTakesTheGreatestOfEachChannel) {
  const std::vector<uint32_t> pixels =
      Sampled(HandTiles(0xFF0000, 0x00FF00, 0x808080), display::Sampling::kWeighted);
  EXPECT_EQ(pixels, (std::vector<uint32_t>{0xFF8000, 0, 0xFF8010, 0}));
}

// Rows of lights, one voxel each: adjacent in memory along x, with gaps, backwards, up to a tile's
// end.
TEST(Sampler, RowsOfLightsTakeTheirOwnVoxels) {
  std::mt19937 random(7);
  TileStore tiles;
  tiles.Reset(TileGrid::Of(40, 6, 5));
  const TileGrid& grid = tiles.grid();
  std::vector<uint32_t> rgb(40 * 6 * 5);
  const auto at = [&](int32_t x, int32_t y, int32_t z) -> uint32_t& {
    return rgb[static_cast<size_t>((z * 6 + y) * 40 + x)];
  };
  for (uint32_t tile = 0; tile + 1 < grid.count(); ++tile) {  // the last is dark
    std::vector<uint32_t> colors(kTileVoxels, 0);
    const Box3 box = grid.VoxelsOf(tile);
    uint32_t lit = 0;
    for (int32_t z = box.lo[2]; z < box.hi[2]; ++z) {
      for (int32_t y = box.lo[1]; y < box.hi[1]; ++y) {
        for (int32_t x = box.lo[0]; x < box.hi[0]; ++x) {
          at(x, y, z) = random() % 3 == 0 ? 0 : 1 + random() % 0xFFFFFF;
          colors[grid.IndexInTile(x, y, z)] = Interleave(at(x, y, z));
          lit += at(x, y, z) != 0;
        }
      }
    }
    tiles.Set(tile, colors.data(), lit);
  }
  display::FootprintTable table;
  table.slices = 4;
  table.width = 40;
  table.height = 1;
  table.inner = {{0, 1}, {{0, 0, 0}}};
  table.outer.begin = {0};
  const auto voxel = [](int32_t slice, int32_t u) -> std::optional<std::array<int32_t, 3>> {
    if (slice == 1 && u % 7 == 3) return std::nullopt;          // gaps
    if (slice == 2) return std::array{39 - u, 3, 4};            // against the order of memory
    if (slice == 3) return std::array{(u * 3) % 40, u % 6, 1};  // not adjacent
    return std::array{u, 5, slice};
  };
  for (int32_t slice = 0; slice < table.slices; ++slice) {
    for (int32_t u = 0; u < table.width; ++u) {
      if (const auto v = voxel(slice, u)) {
        table.outer.entries.push_back({static_cast<uint16_t>((*v)[0]),
                                       static_cast<uint16_t>((*v)[1]),
                                       static_cast<uint16_t>((*v)[2])});
      }
      table.outer.begin.push_back(static_cast<uint32_t>(table.outer.entries.size()));
    }
  }
  const absl::StatusOr<Sampler> sampler = Sampler::Create(table, grid, display::Sampling::kMax);
  ASSERT_TRUE(sampler.ok()) << sampler.status();
  for (int32_t slice = 0; slice < table.slices; ++slice) {
    SlicePixels pixels;
    sampler->Sample(tiles, slice, pixels);
    std::vector<uint32_t> got(40), want(40);
    for (const auto& [color, u, v] : pixels.lit) {
      EXPECT_EQ(v, 0u);
      EXPECT_EQ(std::exchange(got[u], color), 0u) << "reported twice";
    }
    for (int32_t u = 0; u < table.width; ++u) {
      if (const auto v = voxel(slice, u))
        want[static_cast<size_t>(u)] = at((*v)[0], (*v)[1], (*v)[2]);
    }
    EXPECT_EQ(got, want) << "slice " << slice;
  }
}

TEST(Sampler, RefusesATableThatLeavesTheGrid) {
  EXPECT_EQ(
      Sampler::Create(HandTable(), TileGrid::Of(17, 8, 4), display::Sampling::kMax).status().code(),
      absl::StatusCode::kInternal);
}

}  // namespace
}  // namespace voxeld::gpu
