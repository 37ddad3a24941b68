// Nothing that a display can show stays dark: a single voxel of full white lights a pixel, after
// sampling, tone, dither and packing, in every geometry, format and sampling, over the sub-frames
// of one volume.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "display/geometry/footprint.h"
#include "gpu/slice/pack.h"
#include "gpu/slice/quantize.h"
#include "gpu/slice/weight.h"
#include "tests/display/geometry/geometry_cases.h"
#include "tests/display/geometry/swept_flat.h"
#include "tests/display/geometry/swept_solid.h"

namespace voxeld::gpu {
namespace {

using display::Dither;
using display::FootprintEntry;
using display::PixelFormat;
using display::Sampling;

// How a sampled pixel is converted to bytes.
struct Finish {
  PixelFormat format;
  Dither dither;
  uint32_t sub_frames;
  double gamma;
};

std::vector<Finish> Finishes() {
  std::vector<Finish> finishes;
  for (PixelFormat format : {PixelFormat::kRgb888, PixelFormat::kRgb332, PixelFormat::kBitPlanes}) {
    for (Dither dither : {Dither::kNone, Dither::kOrdered}) {
      for (uint32_t sub_frames : {1u, 3u}) {
        for (double gamma : {1.0, 2.2}) finishes.push_back({format, dither, sub_frames, gamma});
      }
    }
  }
  return finishes;
}

std::string NameOf(const Finish& finish) {
  return "format " + std::to_string(static_cast<int>(finish.format)) + ", dither " +
         std::to_string(static_cast<int>(finish.dither)) + ", " +
         std::to_string(finish.sub_frames) + " sub-frames, gamma " + std::to_string(finish.gamma);
}

constexpr uint32_t kPeriod = 8;  // of thresholds across pixels

// Returns whether a bit of the picture of some sub-frame is set, for pixel (u, v) with the colour
// `rgb`.
bool Lights(const Finish& finish, uint32_t rgb, uint32_t u, uint32_t v) {
  const auto light = [&](uint32_t c) {
    return static_cast<uint32_t>(std::lround(65535 * std::pow(c / 255.0, finish.gamma)));
  };
  const auto bits =
      static_cast<uint32_t>(display::FrameLayout{.format = finish.format}.bits_per_channel());
  const Levels levels = LevelsOf(finish.format, bits);
  std::array<uint8_t, kPeriod * kPeriod * 3> picture{};
  for (uint32_t sub = 0; sub < finish.sub_frames; ++sub) {
    const uint32_t threshold = Threshold(finish.dither, u, v, sub, finish.sub_frames);
    const Levels q = {Quantize(light(rgb >> 16), levels.r, threshold),
                      Quantize(light(rgb >> 8 & 255), levels.g, threshold),
                      Quantize(light(rgb & 255), levels.b, threshold)};
    PackPixel({finish.format, bits, kPeriod, kPeriod}, u, v, q, picture.data());
  }
  return std::any_of(picture.begin(), picture.end(), [](uint8_t byte) { return byte != 0; });
}

// For a white voxel: bit n is for the nth finish, by the voxel's weight in the pixel's footprint
// and the pixel's place in the period.
class LitBy {
 public:
  explicit LitBy(Sampling sampling) {
    const std::vector<Finish> finishes = Finishes();
    for (uint32_t weight = 1; weight < 256; ++weight) {
      const uint32_t rgb =
          sampling == Sampling::kMax ? 0xFFFFFF : RaiseWeighted(0, weight, 0xFFFFFF);
      for (uint32_t pixel = 0; pixel < kPeriod * kPeriod; ++pixel) {
        for (size_t n = 0; n < finishes.size(); ++n) {
          const bool lit = Lights(finishes[n], rgb, pixel % kPeriod, pixel / kPeriod);
          masks_[weight][pixel] |= static_cast<uint32_t>(lit) << n;
        }
      }
    }
  }
  uint32_t mask(uint32_t weight, int32_t u, int32_t v) const {
    return masks_[weight][static_cast<uint32_t>(v) % kPeriod * kPeriod +
                          static_cast<uint32_t>(u) % kPeriod];
  }

 private:
  std::array<std::array<uint32_t, kPeriod * kPeriod>, 256> masks_{};
};

// Returns, for every voxel (x fastest), the finishes with which some pixel is lit if only that
// voxel is lit.
std::vector<uint32_t> LitVoxels(const display::FootprintTable& table, const LitBy& lit_by,
                                const display::VoxelGrid& grid) {
  const size_t nx = static_cast<size_t>(grid.nx), ny = static_cast<size_t>(grid.ny);
  std::vector<uint32_t> lit(nx * ny * static_cast<size_t>(grid.nz));
  for (int32_t slice = 0; slice < table.slices; ++slice) {
    for (int32_t u = 0; u < table.width; ++u) {
      for (const FootprintEntry& o : table.Outer(slice, u)) {
        for (int32_t v = 0; v < table.height; ++v) {
          for (const FootprintEntry& i : table.Inner(slice, v)) {
            const size_t x = o.x + size_t{i.x}, y = o.y + size_t{i.y}, z = o.z + size_t{i.z};
            const int32_t row = table.flat_row;
            lit.at((z * ny + y) * nx + x) |=
                lit_by.mask(FootprintWeight(o.weight, i.weight), row == 0 ? u : u % row,
                            row == 0 ? v : u / row);
          }
        }
      }
    }
  }
  return lit;
}

class LitVoxelTest : public testing::TestWithParam<Sampling> {};

TEST_P(LitVoxelTest, EveryReachableVoxelOfFullWhiteLightsAPixel) {
  const std::vector<Finish> finishes = Finishes();
  const uint32_t all = (uint32_t{1} << finishes.size()) - 1;
  const LitBy lit_by(GetParam());
  std::vector<display::GeometryCase> cases = display::AllCases();
  const size_t products = cases.size();
  for (display::GeometryCase& c : display::FlatCases()) cases.push_back(std::move(c));
  for (const display::GeometryCase& c : cases) {
    SCOPED_TRACE(c.name);
    const display::VoxelGrid& grid = c.geometry.grid;
    const bool is_product = &c < &cases[products];
    const auto solid = is_product ? display::MakeSweptSolid(c.geometry) : nullptr;
    const display::SweptFlat flat(c.geometry);
    const std::vector<uint32_t> lit =
        LitVoxels(display::BuildFootprints(c.geometry, GetParam()), lit_by, grid);
    std::vector<int64_t> dark(finishes.size());
    int64_t reachable = 0;
    size_t voxel = 0;
    for (int32_t k = 0; k < grid.nz; ++k) {
      for (int32_t j = 0; j < grid.ny; ++j) {
        for (int32_t i = 0; i < grid.nx; ++i) {
          const uint32_t missing = all & ~lit[voxel++];
          const display::Vec3 centre = display::VoxelCentre(grid, i, j, k);
          const auto where = is_product ? solid->Locate(centre) : flat.Locate(centre);
          if (where != display::SweptSolid::Where::kInside) continue;
          if (!is_product && flat.Doubtful(centre)) continue;
          ++reachable;
          for (size_t n = 0; n < finishes.size(); ++n) dark[n] += missing >> n & 1;
        }
      }
    }
    EXPECT_GT(reachable, 0);
    for (size_t n = 0; n < finishes.size(); ++n) {
      EXPECT_EQ(dark[n], 0) << NameOf(finishes[n]) << ": dark, of " << reachable << " voxels";
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, LitVoxelTest, testing::Values(Sampling::kMax, Sampling::kWeighted),
                         [](const auto& info) {
                           return info.param == Sampling::kMax ? "Max" : "Weighted";
                         });

}  // namespace
}  // namespace voxeld::gpu
