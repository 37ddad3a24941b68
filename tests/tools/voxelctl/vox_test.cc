// Tests MagicaVoxel's files: which faces are visible, where nodes put them, and the errors for
// broken ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <random>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/tools/voxelctl/read_here.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/import/importer.h"

namespace voxeld::voxelctl {
namespace vox_test {

using ::testing::HasSubstr;

std::string Int(int32_t value) {
  std::string out(4, '\0');
  std::memcpy(out.data(), &value, 4);
  return out;
}
std::string Text(const std::string& text) { return Int(static_cast<int32_t>(text.size())) + text; }
std::string Dictionary(const std::map<std::string, std::string>& entries) {
  std::string out = Int(static_cast<int32_t>(entries.size()));
  for (const auto& [key, value] : entries) out += Text(key) + Text(value);
  return out;
}
std::string Chunk(const std::string& id, const std::string& content) {
  return id + Int(static_cast<int32_t>(content.size())) + Int(0) + content;
}
struct V {
  uint8_t x, y, z, color;
};
std::string Model3(int32_t x, int32_t y, int32_t z, const std::vector<V>& voxels) {
  std::string xyzi = Int(static_cast<int32_t>(voxels.size()));
  for (const V& v : voxels) {
    for (const uint8_t byte : {v.x, v.y, v.z, v.color}) xyzi += static_cast<char>(byte);
  }
  return Chunk("SIZE", Int(x) + Int(y) + Int(z)) + Chunk("XYZI", xyzi);
}
std::string Vox(const std::string& chunks) {
  return "VOX " + Int(150) + "MAIN" + Int(0) + Int(static_cast<int32_t>(chunks.size())) + chunks;
}
std::string Transform(int32_t id, int32_t child, const std::map<std::string, std::string>& frame,
                      const std::map<std::string, std::string>& attributes = {}) {
  return Chunk("nTRN", Int(id) + Dictionary(attributes) + Int(child) + Int(-1) + Int(0) + Int(1) +
                           Dictionary(frame));
}
std::string Group(int32_t id, const std::vector<int32_t>& children) {
  std::string out = Int(id) + Dictionary({}) + Int(static_cast<int32_t>(children.size()));
  for (const int32_t child : children) out += Int(child);
  return Chunk("nGRP", out);
}
std::string Shape(int32_t id, int32_t model) {
  return Chunk("nSHP", Int(id) + Dictionary({}) + Int(1) + Int(model) + Dictionary({}));
}

class VoxFiles : public testing::Test {
 protected:
  absl::StatusOr<Model> Import(const std::string& bytes) {
    return ReadHere(folder_.Write("a.vox", bytes), {});
  }
  Part Read(const std::string& chunks) {
    const auto model = Import(Vox(chunks));
    EXPECT_TRUE(model.ok()) << model.status();
    return model.ok() ? model->parts.at(0) : Part();
  }
  std::string Error(const std::string& bytes) {
    return std::string(Import(bytes).status().message());
  }

  // Returns the least and the greatest coordinates of the part's vertices.
  static std::tuple<double, double, double, double, double, double> Box(const Part& part) {
    Point3 least = part.positions.at(0), most = least;
    for (const Point3& p : part.positions) {
      least = {std::min(least.x, p.x), std::min(least.y, p.y), std::min(least.z, p.z)};
      most = {std::max(most.x, p.x), std::max(most.y, p.y), std::max(most.z, p.z)};
    }
    return {least.x, least.y, least.z, most.x, most.y, most.z};
  }

  TempFolder folder_;
};

using Corners = std::tuple<double, double, double, double, double, double>;

TEST_F(VoxFiles, FacesBetweenVoxelsAreLeftOut) {
  const Part one = Read(Model3(4, 4, 4, {{2, 2, 2, 1}}));
  EXPECT_EQ(one.positions.size(), 6u * 4);
  EXPECT_EQ(one.indices.size(), 6u * 6);
  EXPECT_EQ(Box(one), Corners(0, 0, 0, 1, 1, 1)) << "the middle of a model is its origin";
  const Part two = Read(Model3(4, 4, 4, {{2, 2, 2, 1}, {3, 2, 2, 1}}));
  EXPECT_EQ(two.positions.size(), 10u * 4);
  std::vector<V> block;
  for (uint8_t x = 0; x < 3; ++x) {
    for (uint8_t y = 0; y < 3; ++y) {
      for (uint8_t z = 0; z < 3; ++z) block.push_back({x, y, z, 1});
    }
  }
  EXPECT_EQ(Read(Model3(3, 3, 3, block)).positions.size(), 54u * 4) << "nine a side";
  // Two triangles cover a face, so together they have the area of the visible faces.
  double area = 0;
  for (size_t i = 0; i + 2 < two.indices.size(); i += 3) {
    const Point3 &a = two.positions[two.indices[i]], &b = two.positions[two.indices[i + 1]],
                 &c = two.positions[two.indices[i + 2]];
    const double u[3] = {b.x - a.x, b.y - a.y, b.z - a.z}, v[3] = {c.x - a.x, c.y - a.y, c.z - a.z};
    area += std::hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                       u[0] * v[1] - u[1] * v[0]) /
            2;
  }
  EXPECT_DOUBLE_EQ(area, 10);
}

TEST_F(VoxFiles, ColoursAreThePalettes) {
  std::string palette(1024, '\0');
  palette.replace(4 * 6, 4, "\x10\x20\x30\xff");  // of colour 7
  const Part part = Read(Model3(1, 1, 1, {{0, 0, 0, 7}}) + Chunk("RGBA", palette));
  EXPECT_EQ(part.colors.at(0), (Rgb{0x10, 0x20, 0x30}));
  // The format's own table: 1 is white, 2 has less blue, 215 is the last of the cube, 216 the brightest of a red ramp.
  const auto of = [this](uint8_t color) {
    return Read(Model3(1, 1, 1, {{0, 0, 0, color}})).colors.at(0);
  };
  EXPECT_EQ(of(1), (Rgb{255, 255, 255}));
  EXPECT_EQ(of(2), (Rgb{255, 255, 204}));
  EXPECT_EQ(of(7), (Rgb{255, 204, 255}));
  EXPECT_EQ(of(37), (Rgb{204, 255, 255}));
  EXPECT_EQ(of(215), (Rgb{0, 0, 51}));
  EXPECT_EQ(of(216), (Rgb{0xee, 0, 0}));
  EXPECT_EQ(of(255), (Rgb{0x11, 0x11, 0x11}));
}

TEST_F(VoxFiles, NodesPutAndTurnModels) {
  const std::string model = Model3(4, 4, 4, {{3, 2, 2, 1}});  // from (1, 0, 0) to (2, 1, 1)
  EXPECT_EQ(Box(Read(model + Transform(0, 1, {{"_t", "10 -20 30"}}) + Shape(1, 0))),
            Corners(11, -20, 30, 12, -19, 31));
  // Row 0 takes −y, row 1 takes x, row 2 takes z: a quarter turn about z. (1 | 0 << 2 | sign of row 0.)
  EXPECT_EQ(Box(Read(model + Transform(0, 1, {{"_r", absl::StrCat(1 | 1 << 4)}}) + Shape(1, 0))),
            Corners(-1, 1, 0, 0, 2, 1));
  // Rotated first, then moved; within another that rotates what it moved.
  EXPECT_EQ(Box(Read(model + Transform(0, 1, {{"_r", absl::StrCat(1 | 1 << 4)}}) + Group(1, {2}) +
                     Transform(2, 3, {{"_t", "5 0 0"}}) + Shape(3, 0))),
            Corners(-1, 6, 0, 0, 7, 1));
}

// `_r`: two bits for the column of row 0, two for that of row 1, and the signs of the three rows.
TEST_F(VoxFiles, EveryTurnAndMirror) {
  const std::string model = Model3(4, 4, 4, {{3, 2, 1, 1}});  // from (1, 0, -1) to (2, 1, 0)
  const auto box = [&](int turn) {
    return Box(Read(model + Transform(0, 1, {{"_r", absl::StrCat(turn)}}) + Shape(1, 0)));
  };
  const auto bits = [](int row0, int row1, int signs) { return row0 | row1 << 2 | signs << 4; };
  EXPECT_EQ(box(bits(0, 1, 0)), Corners(1, 0, -1, 2, 1, 0)) << "as it is";
  EXPECT_EQ(box(bits(0, 1, 1)), Corners(-2, 0, -1, -1, 1, 0)) << "a mirror along x";
  EXPECT_EQ(box(bits(0, 1, 3)), Corners(-2, -1, -1, -1, 0, 0)) << "half a turn about z";
  EXPECT_EQ(box(bits(0, 1, 7)), Corners(-2, -1, 0, -1, 0, 1)) << "through the middle";
  EXPECT_EQ(box(bits(1, 0, 2)), Corners(0, -2, -1, 1, -1, 0)) << "the other quarter about z";
  EXPECT_EQ(box(bits(0, 2, 2)), Corners(1, 0, 0, 2, 1, 1)) << "a quarter about x";
  EXPECT_EQ(box(bits(2, 1, 4)), Corners(-1, 0, -2, 0, 1, -1)) << "a quarter about y";
  EXPECT_EQ(box(bits(2, 0, 0)), Corners(-1, 1, 0, 0, 2, 1)) << "x to y to z";
  EXPECT_EQ(box(bits(1, 2, 0)), Corners(0, -1, 1, 1, 0, 2)) << "z to y to x";
  // The middle of an odd number of voxels is the corner before its middle voxel.
  EXPECT_EQ(Box(Read(Model3(3, 1, 1, {{2, 0, 0, 1}}) +
                     Transform(0, 1, {{"_r", absl::StrCat(bits(1, 0, 1))}}) + Shape(1, 0))),
            Corners(-1, 1, 0, 0, 2, 1));
}

TEST_F(VoxFiles, GroupsHaveManyAndHiddenOnesAreNotShown) {
  const std::string model = Model3(2, 2, 2, {{1, 1, 1, 1}});
  const std::string rest = Group(1, {2, 4}) + Transform(2, 3, {}) + Shape(3, 0) +
                           Transform(4, 5, {{"_t", "9 0 0"}}, {{"_hidden", "1"}}) + Shape(5, 0);
  EXPECT_EQ(Read(model + Transform(0, 1, {}) + rest).positions.size(), 24u);
  const std::string shown = Group(1, {2, 4}) + Transform(2, 3, {}) + Shape(3, 0) +
                            Transform(4, 5, {{"_t", "9 0 0"}}) + Shape(5, 0);
  EXPECT_EQ(Read(model + Transform(0, 1, {}) + shown).positions.size(), 48u);
}

TEST_F(VoxFiles, OfKeyFramesTheFirstIsShown) {
  const std::string models =
      Model3(1, 1, 1, {{0, 0, 0, 1}}) + Model3(2, 1, 1, {{0, 0, 0, 1}, {1, 0, 0, 1}});
  const auto shape = [](int first, int second) {
    return Chunk("nSHP", Int(1) + Dictionary({}) + Int(2) + Int(0) +
                             Dictionary({{"_f", absl::StrCat(first)}}) + Int(1) +
                             Dictionary({{"_f", absl::StrCat(second)}}));
  };
  EXPECT_EQ(Read(models + Transform(0, 1, {}) + shape(0, 5)).positions.size(), 6u * 4);
  EXPECT_EQ(Read(models + Transform(0, 1, {}) + shape(7, 2)).positions.size(), 10u * 4)
      << "in another order";
  // The same applies to the place of a node.
  const std::string moving = Chunk("nTRN", Int(0) + Dictionary({}) + Int(1) + Int(-1) + Int(0) +
                                               Int(2) + Dictionary({{"_f", "3"}, {"_t", "9 0 0"}}) +
                                               Dictionary({{"_f", "0"}, {"_t", "2 0 0"}}));
  const auto model = Import(Vox(models + moving + Shape(1, 0)));
  ASSERT_THAT(model, IsOk());
  for (const Point3& p : model->parts.at(0).positions) EXPECT_LE(p.x, 3);
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"key frames after the first", 1},
                                                   {"models outside the scene", 1}}));
}

// Version 0.98 wrote an animation as several models without nodes (PACK has their number).
TEST_F(VoxFiles, OfAnAnimationWithoutNodesTheFirstFrameIsShown) {
  const std::string one = Model3(4, 1, 1, {{3, 0, 0, 1}});
  const std::string two = Model3(1, 4, 1, {{0, 3, 0, 2}});
  for (const std::string& pack : {Chunk("PACK", Int(3)), std::string()}) {
    const auto model = Import(Vox(pack + one + two + two));
    ASSERT_THAT(model, IsOk());
    EXPECT_EQ(Box(model->parts.at(0)), Corners(1, 0, 0, 2, 1, 1));
    EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"frames after the first", 2}}));
  }
}

TEST_F(VoxFiles, ModelsThatNoNodeShowsAreCounted) {
  const std::string models = Model3(1, 1, 1, {{0, 0, 0, 1}}) + Model3(1, 1, 1, {{0, 0, 0, 2}}) +
                             Model3(1, 1, 1, {{0, 0, 0, 3}});
  const auto left_out = [&](const std::string& nodes) {
    const auto model = Import(Vox(models + nodes));
    EXPECT_TRUE(model.ok()) << model.status();
    return model.ok() ? model->left_out : std::vector<LeftOut>();
  };
  using List = std::vector<LeftOut>;
  EXPECT_EQ(left_out(Transform(0, 1, {}) + Shape(1, 1)), (List{{"models outside the scene", 2}}));
  // Node 7 belongs to no group, so its model is outside the scene too.
  EXPECT_EQ(left_out(Transform(0, 1, {}) + Shape(1, 1) + Shape(7, 0)),
            (List{{"models outside the scene", 2}}));
  // Hidden nodes and key frames are counted as such, and their models are not counted again.
  EXPECT_EQ(
      left_out(Group(0, {1, 3}) + Transform(1, 2, {}, {{"_hidden", "1"}}) + Group(2, {4}) +
               Shape(4, 0) +
               Chunk("nSHP", Int(3) + Dictionary({}) + Int(2) + Int(1) + Dictionary({{"_f", "0"}}) +
                                 Int(2) + Dictionary({{"_f", "5"}}))),
      (List{{"key frames after the first", 1}, {"hidden nodes", 1}}));
}

TEST_F(VoxFiles, MaterialsAndUnknownChunksAreCounted) {
  const auto material = [](const std::string& type) {
    return Chunk("MATL", Int(7) + Dictionary({{"_type", type}}));
  };
  const std::string model = Model3(1, 1, 1, {{0, 0, 0, 1}});
  const std::string plain = material("_diffuse") + Chunk("MATL", Int(8) + Dictionary({})) +
                            Chunk("MATT", Int(9) + Int(0) + Int(0)) + Chunk("rCAM", "x") +
                            Chunk("rOBJ", "x") + Chunk("NOTE", "x") + Chunk("IMAP", "x");
  auto read = Import(Vox(Chunk("PACK", Int(1)) + model + plain));
  ASSERT_THAT(read, IsOk());
  EXPECT_THAT(read->left_out, testing::IsEmpty());
  read = Import(Vox(model + material("_emit") + material("_glass") +
                    Chunk("MATT", Int(9) + Int(3) + Int(0)) + Chunk("RSTK", "") +
                    Chunk("rAIR", "12")));
  ASSERT_THAT(read, IsOk());
  EXPECT_EQ(read->left_out, (std::vector<LeftOut>{{"materials other than diffuse", 3},
                                                  {"chunks of unknown kinds", 2}}));
  EXPECT_THAT(std::string(Import(Vox(model + Chunk("MATL", Int(7) + Int(1)))).status().message()),
              HasSubstr("its chunk MATL is cut off"));
}

TEST_F(VoxFiles, HiddenLayersAreNotShown) {
  const std::string models =
      Model3(1, 1, 1, {{0, 0, 0, 1}}) + Model3(2, 1, 1, {{0, 0, 0, 1}, {1, 0, 0, 1}});
  const auto on_layer = [](int32_t id, int32_t child, int32_t layer) {
    return Chunk("nTRN", Int(id) + Dictionary({}) + Int(child) + Int(-1) + Int(layer) + Int(1) +
                             Dictionary({}));
  };
  const std::string nodes = Transform(0, 1, {}) + Group(1, {2, 4}) + on_layer(2, 3, 0) +
                            Shape(3, 0) + on_layer(4, 5, 1) + Shape(5, 1);
  const auto layer = [](int32_t id, const std::string& hidden) {
    return Chunk("LAYR", Int(id) + Dictionary({{"_hidden", hidden}}) + Int(-1));
  };
  const auto model = Import(Vox(models + nodes + layer(0, "0") + layer(1, "1")));
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->parts.at(0).positions.size(), 6u * 4);
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"hidden nodes", 1}}));
  EXPECT_EQ(Read(models + nodes + layer(-1, "1")).positions.size(), 16u * 4) << "no layer";
  // All members of a group, whatever layers they are on; the chunks come in any order.
  const std::string group = Transform(0, 1, {}) + Group(1, {2, 6}) + on_layer(2, 3, 7) +
                            Group(3, {4}) + on_layer(4, 5, 0) + Shape(5, 0) + on_layer(6, 8, 0) +
                            Shape(8, 1);
  EXPECT_EQ(Read(layer(7, "1") + group + models).positions.size(), 10u * 4);
  EXPECT_EQ(Read(layer(7, "0") + group + models).positions.size(), 16u * 4);
  EXPECT_EQ(Read(models + nodes + layer(0, "0") + layer(1, "0")).positions.size(), 16u * 4);
}

TEST_F(VoxFiles, WhatIsWrongIsSaid) {
  EXPECT_THAT(Error("hello, world, this is no file of voxels"),
              HasSubstr("a MagicaVoxel file is expected"));
  EXPECT_THAT(Error(Vox("")), HasSubstr("has no model"));
  EXPECT_THAT(Error(Vox(Chunk("XYZI", Int(0)))), HasSubstr("has voxels before a size"));
  EXPECT_THAT(Error(Vox(Model3(4, 4, 4, {{4, 0, 0, 1}}))),
              HasSubstr("has a voxel at (4, 0, 0); its model is 4 by 4 by 4"));
  EXPECT_THAT(Error(Vox(Model3(0, 4, 4, {}))), HasSubstr("of 0 voxels along an axis"));
  EXPECT_THAT(Error(Vox(Model3(257, 4, 4, {}))), HasSubstr("of 257 voxels along an axis"));
  EXPECT_THAT(Error(Vox(Model3(4, 4, 4, {}))), HasSubstr("has no voxel that is to be seen"));
  const std::string good = Model3(4, 4, 4, {{0, 0, 0, 1}});
  EXPECT_THAT(Error(Vox(good).substr(0, 60)), HasSubstr("chunk XYZI is cut off"));
  EXPECT_THAT(Error(Vox(good + Shape(0, 1))), HasSubstr("refers to model 1; it has 1"));
  EXPECT_THAT(Error(Vox(good + Shape(0, -1))), HasSubstr("refers to model -1"));
  EXPECT_THAT(Error(Vox(good + Group(0, {5}))), HasSubstr("refers to node 5; there is none"));
  EXPECT_THAT(Error(Vox(good + Group(0, {0}))), HasSubstr("without end"));
  EXPECT_THAT(Error(Vox(good + Transform(0, 1, {{"_r", "5"}}) + Shape(1, 0))),
              HasSubstr("turned by no rotation"));
  EXPECT_THAT(Error(Vox(good + Transform(0, 1, {{"_t", "1 2"}}) + Shape(1, 0))),
              HasSubstr("by no three numbers"));
  EXPECT_THAT(Error(Vox(Chunk("SIZE", Int(1)))), HasSubstr("chunk SIZE is cut off"));
  EXPECT_THAT(Error(Vox(good + Chunk("nGRP", Int(0) + Int(0) + Int(0x7fffffff)))),
              HasSubstr("chunk nGRP is cut off"));
}

// A group of groups of groups … is 2^60 models, from 60 nodes.
TEST_F(VoxFiles, ModelsThatMultiplyEnd) {
  std::string chunks = Model3(2, 2, 2, {{1, 1, 1, 1}});
  for (int32_t i = 0; i < 60; ++i) chunks += Group(i, {i + 1, i + 1});
  EXPECT_THAT(Error(Vox(chunks + Shape(60, 0))), HasSubstr("without end"));
}

// A million times the largest model, with one voxel and with none.
TEST_F(VoxFiles, LargeModelsShownOftenEnd) {
  const std::string often = Group(0, std::vector<int32_t>(1'200'000, 1)) + Shape(1, 0);
  for (const bool filled : {true, false}) {
    const std::string model =
        Model3(256, 256, 256, filled ? std::vector<V>{{1, 1, 1, 1}} : std::vector<V>());
    EXPECT_THAT(Error(Vox(model + often)), HasSubstr("shows more than 1000000 models"));
  }
}

TEST_F(VoxFiles, DamagedOnesEndWell) {
  const std::string good =
      Vox(Model3(4, 4, 4, {{0, 0, 0, 1}, {1, 2, 3, 9}}) +
          Transform(0, 1, {{"_t", "1 2 3"}, {"_r", "4"}}) + Group(1, {2}) + Shape(2, 0));
  ASSERT_THAT(Import(good), IsOk());
  std::mt19937 random(3);
  for (int i = 0; i < 2000; ++i) {
    std::string bytes = good;
    bytes[random() % bytes.size()] = static_cast<char>(random());
    if (i % 4 == 0) bytes.resize(1 + random() % bytes.size());
    const auto model = Import(bytes);
    if (!model.ok()) {
      EXPECT_THAT(std::string(model.status().message()), HasSubstr("a.vox"));
    }
  }
}

}  // namespace vox_test
}  // namespace voxeld::voxelctl
