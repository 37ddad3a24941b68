// Tests what is sent of volumes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <variant>
#include <vector>

#include "absl/status/statusor.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tools/import/volume_samples.h"
#include "tools/voxelctl/scene/placement.h"
#include "tools/voxelctl/scene/volume.h"

namespace voxeld::voxelctl {
namespace packed_volume_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

SampledVolume Ramp(uint32_t nx, uint32_t ny, uint32_t nz) {
  SampledVolume volume{.size = {nx, ny, nz}, .samples = {}};
  for (uint32_t i = 0; i < nx * ny * nz; ++i) volume.samples.push_back(static_cast<float>(i % nx));
  EXPECT_TRUE(
      PlaceVolume({}, {0.5, 0.5, 0.5}, {Point3{1, 0, 0}, Point3{0, 1, 0}, Point3{0, 0, 1}}, &volume)
          .ok());
  return volume;
}

TEST(PackedVolumes, AreBytesWithinTheWindow) {
  const auto packed = PackVolume(Ramp(5, 1, 1), {.window = {{1, 3}}}, {});
  ASSERT_THAT(packed, IsOk());
  const auto& volume = std::get<client::Volume>(packed->part.shape);
  const auto bytes = std::get<client::Array<uint8_t>>(volume.grid.samples).view();
  EXPECT_THAT(std::vector<int>(bytes.begin(), bytes.end()), ElementsAre(0, 0, 128, 255, 255));
  EXPECT_EQ(volume.grid.edge_a.x, 5);
  EXPECT_EQ(packed->note, "");
}

TEST(PackedVolumes, AreReducedToWhatTheServerTakes) {
  client::Limits limits;
  limits.max_message_bytes = 8192;  // less 4096 for everything else
  const auto packed = PackVolume(Ramp(33, 16, 16), {}, limits);
  ASSERT_THAT(packed, IsOk());
  const auto& grid = std::get<client::Volume>(packed->part.shape).grid;
  EXPECT_LE(packed->samples, 4096u);
  EXPECT_EQ(uint64_t{grid.size_a} * grid.size_b * grid.size_c, packed->samples);
  EXPECT_EQ(grid.size_a * 2u, 34u);
  EXPECT_EQ(grid.edge_a.x, 34) << "a cell that the end divides keeps its length";
  EXPECT_THAT(packed->note, HasSubstr("33 by 16 by 16 samples are more than the server takes"));
}

TEST(PackedVolumes, ColoursAsTheyAre) {
  SampledVolume volume = Ramp(2, 1, 1);
  volume.colors = {{1, 2, 3}, {0, 0, 0}};
  const auto bytes_of = [](const absl::StatusOr<PackedVolume>& packed) {
    EXPECT_THAT(packed, IsOk());
    const auto& shown = std::get<client::Volume>(packed->part.shape);
    EXPECT_EQ(shown.colors, !shown.transfer.has_value());
    const auto bytes = std::get<client::Array<uint8_t>>(shown.grid.samples).view();
    return std::vector<int>(bytes.begin(), bytes.end());
  };
  EXPECT_THAT(bytes_of(PackVolume(volume, {}, {})), ElementsAre(1, 2, 3, 255, 0, 0, 0, 0));
  EXPECT_THAT(bytes_of(PackVolume(volume, {.colormap = "inferno", .window = {{0, 1}}}, {})),
              ElementsAre(0, 255))
      << "their brightness";
  client::Limits limits;
  limits.max_indices_per_entity = 1;
  EXPECT_THAT(bytes_of(PackVolume(volume, {}, limits)), ElementsAre(1, 1, 2, 255)) << "averaged";
}

TEST(PackedVolumes, LargeOnesGoAsAssets) {
  client::Limits limits;
  limits.max_message_bytes = 8192;
  limits.max_asset_bytes = 1 << 20;
  std::string brought;
  const AssetSink upload = [&brought](absl::string_view bytes) {
    brought = std::string(bytes);
    return client::Asset{.sha256 = "hash", .size = bytes.size()};
  };
  ASSERT_THAT(PackVolume(Ramp(16, 16, 16), {}, limits, upload), IsOk());
  EXPECT_EQ(brought, "") << "it fits a message";
  const auto packed = PackVolume(Ramp(33, 16, 16), {.window = {{0, 255}}}, limits, upload);
  ASSERT_THAT(packed, IsOk());
  EXPECT_EQ(packed->note, "");
  EXPECT_EQ(packed->samples, 33u * 16 * 16);
  ASSERT_EQ(brought.size(), 33u * 16 * 16);
  EXPECT_EQ(brought[32], 32);
  const auto& grid = std::get<client::Volume>(packed->part.shape).grid;
  ASSERT_TRUE(std::get<client::Array<uint8_t>>(grid.samples).asset());
  EXPECT_EQ(std::get<client::Array<uint8_t>>(grid.samples).asset()->sha256, "hash");
  // For a surface, two bytes each; a volume that exceeds the server's limit for one asset is
  // averaged.
  ASSERT_THAT(PackVolume(Ramp(33, 16, 16), {.level = 5}, limits, upload), IsOk());
  EXPECT_EQ(brought.size(), 2u * 33 * 16 * 16);
  limits.max_asset_bytes = 5000;
  const auto averaged = PackVolume(Ramp(33, 16, 16), {}, limits, upload);
  ASSERT_THAT(averaged, IsOk());
  EXPECT_LE(brought.size(), 5000u);
  EXPECT_THAT(averaged->note, HasSubstr("are more than the server takes"));
}

TEST(PackedVolumes, WhereAssetsAreNotTakenTheyAreAveraged) {
  client::Limits limits;
  limits.max_message_bytes = 8192;
  limits.max_asset_bytes = 1 << 20;
  absl::Status status = absl::ResourceExhaustedError("there is no room");
  const AssetSink upload = [&status](absl::string_view) -> absl::StatusOr<client::Asset> {
    return status;
  };
  const auto packed = PackVolume(Ramp(33, 16, 16), {}, limits, upload);
  ASSERT_THAT(packed, IsOk());
  EXPECT_LE(packed->samples, 4096u);
  EXPECT_THAT(packed->note,
              HasSubstr("did not take it as an asset (there is no room); 33 by 16 by 16 samples"));
  status = absl::CancelledError("interrupted");
  EXPECT_TRUE(absl::IsCancelled(PackVolume(Ramp(33, 16, 16), {}, limits, upload).status()));
}

TEST(PackedVolumes, AsASurface) {
  const auto packed = PackVolume(Ramp(5, 1, 1), {.level = 1}, {});
  ASSERT_THAT(packed, IsOk());
  EXPECT_EQ(std::get<client::Isosurface>(packed->part.shape).level, 65535 / 4.0);
  EXPECT_THAT(std::string(PackVolume(Ramp(5, 1, 1), {.level = 9}, {}).status().message()),
              HasSubstr("--level is 9, and the samples go from 0 to 4"));
}

TEST(PackedVolumes, AWindowIsFound) {
  // Air at 0 and a body at 100, and one sample that is far off.
  SampledVolume volume = Ramp(20, 20, 20);
  for (size_t i = 0; i < volume.samples.size(); ++i) volume.samples[i] = i % 4 == 0 ? 100 : 0;
  volume.samples[5] = 5000;
  const auto packed = PackVolume(volume, {}, {});
  ASSERT_THAT(packed, IsOk());
  const auto& grid = std::get<client::Volume>(packed->part.shape).grid;
  const auto bytes = std::get<client::Array<uint8_t>>(grid.samples).view();
  EXPECT_EQ(bytes[1], 0);
  EXPECT_GT(bytes[0], 200);
}

TEST(PackedVolumes, AWindowShowsMasksRareSamplesAndNoBackground) {
  const auto bytes_of = [](const SampledVolume& volume) {
    const auto packed = PackVolume(volume, {}, {});
    EXPECT_THAT(packed, IsOk());
    if (!packed.ok()) return std::vector<int>();
    const auto& grid = std::get<client::Volume>(packed->part.shape).grid;
    const auto bytes = std::get<client::Array<uint8_t>>(grid.samples).view();
    return std::vector<int>(bytes.begin(), bytes.end());
  };
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const struct {
    float dark, bright;
  } pairs[] = {{0, 1}, {0, 255}, {0, 1e-6f}, {-1024, 3071}, {nan, 5}, {nan, -7}, {0, 65535}};
  for (const auto& [dark, bright] : pairs) {
    SampledVolume half = Ramp(8, 8, 8);
    for (size_t i = 0; i < 512; ++i) half.samples[i] = i < 256 ? dark : bright;
    const std::vector<int> halves = bytes_of(half);
    ASSERT_EQ(halves.size(), 512u);
    EXPECT_THAT(std::vector<int>(halves.begin(), halves.begin() + 256), testing::Each(0)) << bright;
    EXPECT_THAT(std::vector<int>(halves.begin() + 256, halves.end()), testing::Each(255)) << bright;
    // One sample of 32,768.
    SampledVolume rare = Ramp(32, 32, 32);
    std::fill(rare.samples.begin(), rare.samples.end(), dark);
    rare.samples[12345] = bright;
    const std::vector<int> alone = bytes_of(rare);
    ASSERT_EQ(alone.size(), 32768u);
    EXPECT_EQ(alone[12345], 255) << bright;
    EXPECT_EQ(std::count(alone.begin(), alone.end(), 0), 32767) << bright;
  }
}

TEST(PackedVolumes, ArePlacedByTheirCorners) {
  Model model;
  model.volumes.push_back(Ramp(4, 2, 2));
  PlaceModels({&model, 1}, DisplaySpace(), {});
  EXPECT_NEAR(model.volumes[0].corners[7].x, 0.97, 1e-9);
  EXPECT_NEAR(model.volumes[0].corners[0].y, -0.485, 1e-9);
}

}  // namespace packed_volume_test
}  // namespace voxeld::voxelctl
