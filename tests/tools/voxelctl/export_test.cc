// Tests files for other programs by reading them back: with numpy, and with the readers of `play`.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tests/tools/voxelctl/volumes.h"
#include "tools/child/child_process.h"
#include "tools/voxelctl/export/export_files.h"
#include "tools/voxelctl/import/importer.h"
#include "tools/voxelctl/import/vox_chunks.h"

namespace voxeld::voxelctl {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::UnorderedElementsAre;

TEST(WritePly, HasAPointInMillimetresForEachLitPixel) {
  TempFolder folder;
  Volume volume = DarkStack(4, 6, 8);
  SetPixel(&volume, 2, 3, 1, {10, 20, 30});
  SetPixel(&volume, 7, 0, 5, {0, 0, 255});
  ExportSummary summary;
  ASSERT_THAT(WritePly(folder.Path("a.ply"), volume, &summary), IsOk());
  EXPECT_EQ(summary.items, 2u);
  const std::string bytes = ReadAll(folder.Path("a.ply"));
  EXPECT_EQ(summary.bytes, bytes.size());
  const size_t end = bytes.find("end_header\n") + 11;
  EXPECT_THAT(bytes.substr(0, end), HasSubstr("element vertex 2\n"));
  ASSERT_EQ(bytes.size() - end, 2u * 15);
  float at[3];
  std::memcpy(at, bytes.data() + end, sizeof(at));
  EXPECT_THAT(at, ElementsAre(1.5, -1.5, -1.5));
  EXPECT_EQ(bytes.substr(end + 12, 3), "\x0a\x14\x1e");
  const auto model = ImportFile(folder.Path("a.ply"), {});
  ASSERT_THAT(model, IsOk());
  EXPECT_THAT(model->parts[0].positions,
              ElementsAre(Point3{1.5, -1.5, -1.5}, Point3{-1.5, 2.5, 3.5}));
  EXPECT_THAT(model->parts[0].colors, ElementsAre(Rgb{10, 20, 30}, Rgb{0, 0, 255}));
}

TEST(WritePly, OfNothingHasNoPoint) {
  TempFolder folder;
  ExportSummary summary;
  ASSERT_THAT(WritePly(folder.Path("a.ply"), DarkStack(4, 4, 4), &summary), IsOk());
  EXPECT_THAT(ReadAll(folder.Path("a.ply")), HasSubstr("element vertex 0\n"));
}

// Maps the place of each voxel of a scene, by the scene's nodes, to its colour.
using Placed = std::map<std::vector<int>, std::vector<int>>;

Placed Place(const VoxScene& scene) {
  Placed placed;
  const VoxNode& root = scene.nodes.at(0);
  const VoxNode& group = scene.nodes.at(root.children.at(0));
  EXPECT_EQ(group.kind, VoxNode::Kind::kGroup);
  for (const int child : group.children) {
    const VoxNode& move = scene.nodes.at(child);
    const VoxNode& shape = scene.nodes.at(move.children.at(0));
    const VoxGrid& grid = scene.grids.at(static_cast<size_t>(shape.children.at(0)));
    for (const VoxVoxel& v : grid.voxels) {
      const Rgb color = scene.palette[v.color];
      const bool is_new =
          placed
              .try_emplace({v.x - static_cast<int>(grid.size[0] / 2) + move.move[0],
                            v.y - static_cast<int>(grid.size[1] / 2) + move.move[1],
                            v.z - static_cast<int>(grid.size[2] / 2) + move.move[2]},
                           std::vector<int>{color.r, color.g, color.b})
              .second;
      EXPECT_TRUE(is_new);
    }
  }
  return placed;
}

TEST(WriteVox, IsReadByWhatPlayReads) {
  TempFolder folder;
  Volume volume = DarkStack(5, 7, 9);
  SetPixel(&volume, 0, 0, 0, {255, 0, 0});
  SetPixel(&volume, 8, 4, 6, {0, 255, 0});
  SetPixel(&volume, 3, 1, 2, {1, 2, 3});
  ExportSummary summary;
  ASSERT_THAT(WriteVox(folder.Path("a.vox"), volume, &summary), IsOk());
  EXPECT_EQ(summary.items, 3u);
  EXPECT_EQ(summary.models, 1u);
  EXPECT_EQ(summary.left_out, 0u);
  const auto file = ReadSourceFile(folder.Path("a.vox"));
  ASSERT_THAT(file, IsOk());
  const auto scene = ReadVoxChunks(*file);
  ASSERT_THAT(scene, IsOk());
  EXPECT_THAT(Place(*scene),
              testing::UnorderedElementsAreArray(Placed{
                  {{-2, -3, 0}, {255, 0, 0}}, {{2, 3, 8}, {0, 255, 0}}, {{-1, -1, 3}, {1, 2, 3}}}));
  const auto model = ImportFile(folder.Path("a.vox"), {});
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->parts[0].positions.size(), 3u * 6 * 4) << "three cubes that hide no face";
}

TEST(WriteVox, IsSplitWhereAModelWouldBeTooLarge) {
  TempFolder folder;
  Volume volume = DarkStack(600, 3, 300);
  const std::vector<std::array<int, 3>> lit = {
      {0, 0, 0}, {255, 1, 255}, {256, 1, 255}, {599, 2, 299}, {256, 1, 256}};
  for (const auto& [x, y, z] : lit)
    SetPixel(&volume, z, x, y, {static_cast<uint8_t>(1 + x % 255), 2, 3});
  ExportSummary summary;
  ASSERT_THAT(WriteVox(folder.Path("a.vox"), volume, &summary), IsOk());
  EXPECT_EQ(summary.models, 4u) << "dark blocks are left out";
  const auto file = ReadSourceFile(folder.Path("a.vox"));
  ASSERT_THAT(file, IsOk());
  const auto scene = ReadVoxChunks(*file);
  ASSERT_THAT(scene, IsOk());
  Placed wanted;
  for (const auto& [x, y, z] : lit) wanted[{x - 300, y - 1, z}] = {1 + x % 255, 2, 3};
  EXPECT_EQ(Place(*scene), wanted);
}

TEST(WriteVox, ManyColoursBecome255Near) {
  TempFolder folder;
  Volume volume = DarkStack(64, 64, 1);
  for (int u = 0; u < 64; ++u) {
    for (int v = 0; v < 64; ++v)
      SetPixel(&volume, 0, u, v, {static_cast<uint8_t>(u * 4), static_cast<uint8_t>(v * 4), 128});
  }
  ExportSummary summary;
  ASSERT_THAT(WriteVox(folder.Path("a.vox"), volume, &summary), IsOk());
  const auto scene = ReadVoxChunks(*ReadSourceFile(folder.Path("a.vox")));
  ASSERT_THAT(scene, IsOk());
  std::set<std::vector<int>> colors;
  for (const auto& [at, color] : Place(*scene)) {
    colors.insert(color);
    EXPECT_NEAR(color[0], (at[0] + 32) * 4, 24);
    EXPECT_NEAR(color[1], (at[1] + 32) * 4, 24);
  }
  EXPECT_GT(colors.size(), 200u);
  EXPECT_LE(colors.size(), 255u);
}

TEST(WriteVox, OfNothingIsRefused) {
  TempFolder folder;
  ExportSummary summary;
  EXPECT_THAT(WriteVox(folder.Path("a.vox"), DarkStack(4, 4, 4), &summary),
              Fails(Words{"a.vox", "no voxel is lit"}));
}

TEST(WriteVox, ARotorsPixelsAreInTheVoxelsWhereTheyAre) {
  TempFolder folder;
  display::Rotor rotor;
  rotor.slices_per_turn = 90;
  rotor.width_px = rotor.height_px = 32;
  rotor.panels.push_back({});
  Volume volume = DarkVolume({.shape = rotor, .grid = {}}, 32, 32);
  SetPixel(&volume, 0, 31, 10, {9, 9, 9});
  const display::Vec3 at = display::PixelPosition(volume.geometry, 0, 31, 10);
  ExportSummary summary;
  ASSERT_THAT(WriteVox(folder.Path("a.vox"), volume, &summary), IsOk());
  const auto scene = ReadVoxChunks(*ReadSourceFile(folder.Path("a.vox")));
  ASSERT_THAT(scene, IsOk());
  const Placed placed = Place(*scene);
  ASSERT_EQ(placed.size(), 1u);
  const auto& grid = volume.geometry.grid;
  const double middle[3] = {placed.begin()->first[0] + grid.nx / 2 + 0.5,
                            placed.begin()->first[1] + grid.ny / 2 + 0.5,
                            placed.begin()->first[2] + 0.5};
  EXPECT_NEAR(grid.origin_mm.x + middle[0] * grid.pitch_mm.x, at.x, 0.51 * grid.pitch_mm.x);
  EXPECT_NEAR(grid.origin_mm.y + middle[1] * grid.pitch_mm.y, at.y, 0.51 * grid.pitch_mm.y);
  EXPECT_NEAR(grid.origin_mm.z + middle[2] * grid.pitch_mm.z, at.z, 0.51 * grid.pitch_mm.z);
}

TEST(Exports, LightsThatAreMissingAreNowhere) {
  TempFolder folder;
  display::Lattice lattice;
  lattice.width_px = 3;
  lattice.points_mm = {display::Vec3{-5, 0, 0}, std::nullopt, display::Vec3{5, 0, 0}};
  Volume volume = DarkVolume({.shape = lattice, .grid = {}}, 3, 1);
  for (int u = 0; u < 3; ++u) SetPixel(&volume, 0, u, 0, {1, 2, 3});
  ExportSummary summary;
  ASSERT_THAT(WritePly(folder.Path("a.ply"), volume, &summary), IsOk());
  EXPECT_EQ(summary.items, 2u);
  EXPECT_EQ(summary.left_out, 1u);
  ASSERT_THAT(WriteVox(folder.Path("a.vox"), volume, &summary), IsOk());
  EXPECT_EQ(summary.items, 2u);
  EXPECT_EQ(summary.left_out, 1u);
  ASSERT_THAT(WriteNpz(folder.Path("a.npz"), volume, &summary), IsOk());
  EXPECT_EQ(summary.items, 3u) << "as many positions as lit pixels";
  EXPECT_EQ(summary.left_out, 1u);
  auto python = child::ChildProcess::Start(
      {"/usr/bin/python3", "-c",
       "import sys, numpy; print(numpy.load(sys.argv[1])['positions_mm'][:, 0].tolist())",
       folder.Path("a.npz")});
  ASSERT_THAT(python, IsOk());
  EXPECT_EQ((*python)->Wait(), 0);
  EXPECT_EQ((*python)->output(), "[-5.0, nan, 5.0]\n");
}

TEST(WriteNpz, IsReadByNumpy) {
  TempFolder folder;
  Volume volume = DarkStack(4, 6, 8);
  volume.display =
      "st\xc3\xa4"
      "ck\x1b";
  SetPixel(&volume, 2, 3, 1, {10, 20, 30});
  SetPixel(&volume, 7, 0, 5, {0, 0, 255});
  ExportSummary summary;
  const std::string path = folder.Path("a.npz");
  ASSERT_THAT(WriteNpz(path, volume, &summary), IsOk());
  EXPECT_EQ(summary.items, 2u);
  EXPECT_EQ(summary.bytes, ReadAll(path).size());
  const std::string script = folder.Write("look.py", R"(
import json, sys, zipfile
import numpy as np
with zipfile.ZipFile(sys.argv[1]) as z:
    assert z.testzip() is None
d = np.load(sys.argv[1])
assert sorted(d.files) == ["metadata", "positions_mm", "rgb"], d.files
rgb, at = d["rgb"], d["positions_mm"]
assert rgb.dtype == np.uint8 and rgb.shape == (8, 6, 4, 3), (rgb.dtype, rgb.shape)
assert at.dtype == np.float32 and at.shape == (2, 3)
s, v, u = rgb.any(axis=3).nonzero()
assert (s.tolist(), v.tolist(), u.tolist()) == ([2, 7], [1, 5], [3, 0])
assert rgb[s, v, u].tolist() == [[10, 20, 30], [0, 0, 255]]
assert at.tolist() == [[1.5, -1.5, -1.5], [-1.5, 2.5, 3.5]], at
m = json.loads(d["metadata"].item())
assert m["display"] == "st\u00e4ck\x1b" and m["volume"] == 7 and m["lit_pixels"] == 2, m
assert m["grid"] == {"voxels": [4, 6, 8], "origin_mm": [-2, -3, -4], "pitch_mm": [1, 1, 1]}, m
print("read")
)");
  auto python = child::ChildProcess::Start({"/usr/bin/python3", script, path});
  ASSERT_THAT(python, IsOk());
  EXPECT_EQ((*python)->Wait(), 0) << (*python)->output();
  EXPECT_EQ((*python)->output(), "read\n");
}

}  // namespace
}  // namespace voxeld::voxelctl
