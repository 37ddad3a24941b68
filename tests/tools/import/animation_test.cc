// Tests the formats that assimp reads without checks of our own, in a process of its own, and
// animations.
#include "tools/voxelctl/import/import_program.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cmath>
#include <csignal>
#include <cstdlib>
#include <initializer_list>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "tests/tools/import/read_here.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/import/importer.h"

namespace voxeld::voxelctl {
namespace animation_test {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string ModelFile(const std::string& name) {
  return std::string(VOXELD_MODELS_DIR) + "/" + name;
}

struct Real {
  const char* path;
  const char* format;
  size_t indices;
};

class MoreMeshes : public testing::TestWithParam<Real> {};

TEST_P(MoreMeshes, AreReadWhole) {
  const auto model = ReadApart(ModelFile(GetParam().path));
  ASSERT_THAT(model, IsOk()) << "tools/setup --import installs assimp-testmodels";
  EXPECT_EQ(model->format, GetParam().format);
  size_t indices = 0;
  for (const Part& part : model->parts) indices += part.indices.size();
  EXPECT_EQ(indices, GetParam().indices);
}

// 56 of the FBX spider's 1368 triangles have no area, and one of the house's.
INSTANTIATE_TEST_SUITE_P(
    Table, MoreMeshes,
    testing::Values(Real{"OFF/Wuson.off", "OFF", 11196}, Real{"FBX/spider.fbx", "FBX", 3936},
                    Real{"3MF/box.3mf", "3MF", 36}, Real{"Collada/duck.dae", "COLLADA", 12636},
                    Real{"BLEND/Suzanne_248.blend", "Blender", 11616},
                    Real{"IFC/AC14-FZK-Haus.ifc", "IFC", 107715}, Real{"BVH/01_01.bvh", "BVH", 74},
                    Real{"3DS/fels.3ds", "3DS", 2304}));

TEST(MoreMeshes, ThatAreWrong) {
  TempFolder folder;
  const auto error = [&folder](const std::string& name, const std::string& bytes) {
    return std::string(ReadApart(folder.Write(name, bytes)).status().message());
  };
  EXPECT_THAT(error("a.off", "hello"), HasSubstr("a file that begins with \"OFF\" is expected"));
  EXPECT_THAT(error("a.fbx", "hello"), HasSubstr("binary or ASCII FBX is expected"));
  EXPECT_THAT(error("a.3mf", "hello"), HasSubstr("a ZIP archive"));
  EXPECT_THAT(error("a.dae", "<?xml version='1.0'?><html/>"),
              HasSubstr("is XML text; XML of <COLLADA>"));
  EXPECT_THAT(error("a.blend", "hello"), HasSubstr("a Blender file is expected"));
  EXPECT_THAT(error("a.ifc", "hello"), HasSubstr("a STEP file"));
  EXPECT_THAT(error("a.bvh", "hello"), HasSubstr("\"HIERARCHY\" is expected"));
  EXPECT_THAT(error("a.off", "OFF\n99999999 99999999 0\n1 2 3\n"),
              HasSubstr("declares 99999999 vertices and 99999999 faces but has only 30 bytes"));
  // However the header is written: with comments, a dimension, joined to the count, larger than 64
  // bits, or with letters after the digits.
  for (const char* text :
       {"COFF # 1 2\n# 1 1\n 1\r\n18446744073709551615 0\n1 2 3\n", "nOFF\n3\n1 99999999 0\n",
        "STCN4nOFF 3 99999999 1 0\n", "OFF99999999 1 1\n", "OFF\n18446744073809551615 1 0\n",
        "OFF\n99999999x 1 1\n", "OFF\n1 99999999999999999999999999 0\n"}) {
    EXPECT_THAT(error("b.off", text), HasSubstr(" faces but has only ")) << text;
  }
}

// Sizes declared in a truncated file are not trusted.
TEST(MoreMeshes, TruncatedFilesAreRejected) {
  TempFolder folder;
  const auto fbx = ReadAll(ModelFile("FBX/box.fbx"));
  for (const size_t size : {size_t{30}, fbx.size() / 2, fbx.size() - 200})
    EXPECT_FALSE(ReadApart(folder.Write("b.fbx", fbx.substr(0, size))).ok()) << size;
}

TEST(MoreMeshes, DamagedOnesEndWell) {
  TempFolder folder;
  std::mt19937 random(5);
  for (const char* path : {"FBX/box.fbx", "3MF/box.3mf", "BLEND/BlenderDefault_248.blend",
                           "Collada/cube_triangulate.dae", "OFF/Cube.off"}) {
    const std::string good = ReadAll(ModelFile(path));
    const std::string name =
        absl::StrCat("a.", std::string(path).substr(std::string(path).rfind('.') + 1));
    for (int i = 0; i < 30; ++i) {
      std::string bytes = good;
      for (int k = 0; k < 4; ++k) bytes[random() % bytes.size()] = static_cast<char>(random());
      if (i % 4 == 0) bytes.resize(1 + random() % bytes.size());
      const auto model = ReadApart(folder.Write(name, bytes));
      if (!model.ok()) {
        EXPECT_THAT(std::string(model.status().message()), HasSubstr(name));
      }
    }
  }
}

// ----------------------------------------------------------------------------------- animations

TEST(Animations, OfASkeletonAlone) {
  const auto frames = OpenAnimation(ModelFile("BVH/01_01.bvh"), 1, 20);
  ASSERT_THAT(frames, IsOk());
  EXPECT_GT((*frames)->count(), 100);
  const auto first = (*frames)->Read(0), later = (*frames)->Read((*frames)->count() - 1);
  ASSERT_THAT(first, IsOk());
  ASSERT_THAT(later, IsOk());
  const Part &a = first->parts.at(0), &b = later->parts.at(0);
  EXPECT_EQ(a.kind, Kind::kSegments);
  EXPECT_GT(a.thickness, 0);
  EXPECT_EQ(a.thickness, b.thickness);
  ASSERT_EQ(a.positions.size(), b.positions.size());
  EXPECT_NE(a.positions, b.positions);
  // Bones rotate, but do not stretch.
  for (size_t i = 2; i + 1 < a.positions.size(); i += 2) {
    const auto length = [i](const Part& part) {
      const Point3 &p = part.positions[i], &q = part.positions[i + 1];
      return std::hypot(p.x - q.x, p.y - q.y, p.z - q.z);
    };
    EXPECT_NEAR(length(a), length(b), 1e-3 + 1e-3 * length(a)) << i;
  }
}

// A root that moves, a joint, and an end, 4 apart; `order` has the channels of the rotations of
// both, `frames` their numbers, 0.05 s each.
std::string Bvh(const std::string& order, const std::vector<std::string>& frames) {
  std::string text = absl::StrCat(
      "HIERARCHY\nROOT hips\n{\n\tOFFSET 0 0 0\n\tCHANNELS 6 Xposition Yposition Zposition ", order,
      "\n\tJOINT spine\n\t{\n\t\tOFFSET 0 4 0\n\t\tCHANNELS 3 ", order,
      "\n\t\tEnd Site\n\t\t{\n\t\t\tOFFSET 0 4 0\n\t\t}\n\t}\n}\nMOTION\nFrames: ", frames.size(),
      "\nFrame Time: 0.05\n");
  for (const std::string& frame : frames) absl::StrAppend(&text, frame, "\n");
  return text;
}

// Returns where the joint and the end are in each frame of a file, at that many frames a second.
std::vector<std::pair<Point3, Point3>> Poses(const std::string& bytes, double fps) {
  TempFolder folder;
  const auto frames = OpenAnimation(folder.Write("a.bvh", bytes), 1, fps);
  EXPECT_THAT(frames, IsOk());
  std::vector<std::pair<Point3, Point3>> poses;
  for (int64_t i = 0; frames.ok() && i < (*frames)->count(); ++i) {
    const auto model = (*frames)->Read(i);
    EXPECT_THAT(model, IsOk());
    if (!model.ok()) break;
    const std::vector<Point3>& at = model->parts.at(0).positions;
    EXPECT_EQ(at.size(), 4u);
    if (at.size() == 4) poses.emplace_back(at[1], at[3]);
  }
  return poses;
}

MATCHER_P2(AreNear, joint, end, "") {
  const auto apart = [](const Point3& a, const Point3& b) {
    return std::hypot(a.x - b.x, a.y - b.y, a.z - b.z);
  };
  return apart(arg.first, joint) < 1e-4 && apart(arg.second, end) < 1e-4;
}

// A frame lasts as long as the file says, including the last one.
TEST(Animations, OfASkeletonShowEveryFrame) {
  const auto upright = AreNear(Point3{0, 4, 0}, Point3{0, 8, 0}),
             lying = AreNear(Point3{-4, 0, 0}, Point3{-8, 0, 0}),
             far = AreNear(Point3{1, 6, 3}, Point3{1, 10, 3});
  const double r = std::sqrt(0.5);
  const auto between = AreNear(Point3{-4 * r, 4 * r, 0}, Point3{-8 * r, 8 * r, 0});
  const std::string zxy = "Zrotation Xrotation Yrotation";
  const std::string two = Bvh(zxy, {"0 0 0 0 0 0 0 0 0", "0 0 0 90 0 0 0 0 0"});
  for (const std::string& bytes : {two, absl::StrReplaceAll(two, {{"\n", "\r\n"}})}) {
    EXPECT_THAT(Poses(bytes, 20), ElementsAre(upright, lying));
    EXPECT_THAT(Poses(bytes, 40), ElementsAre(upright, between, lying, lying));
    EXPECT_THAT(Poses(bytes, 10), ElementsAre(upright));
  }
  EXPECT_THAT(Poses(Bvh(zxy, {"0 0 0 0 0 0 0 0 0", "0 0 0 90 0 0 0 0 0", "1 2 3 0 0 0 0 0 0"}), 20),
              ElementsAre(upright, lying, far));
  EXPECT_THAT(Poses(Bvh(zxy, {"1 2 3 0 0 0 0 0 0"}), 20), ElementsAre(far));
}

// Rotations are applied from the last channel to the first, about the axes of the parent.
TEST(Animations, OfASkeletonTurnInTheOrderOfItsChannels) {
  const auto second = [](const std::string& order, const std::string& turns) {
    const auto poses = Poses(Bvh(order, {"0 0 0 0 0 0 0 0 0", turns}), 20);
    EXPECT_EQ(poses.size(), 2u);
    return poses.empty() ? std::pair<Point3, Point3>() : poses.back();
  };
  // About x first: y becomes z, which a rotation about z does not move.
  EXPECT_THAT(second("Zrotation Xrotation Yrotation", "1 2 3 90 90 0 0 0 0"),
              AreNear(Point3{1, 2, 7}, Point3{1, 2, 11}));
  // About z first: y becomes -x, which a rotation about x does not move.
  EXPECT_THAT(second("Xrotation Yrotation Zrotation", "1 2 3 90 0 90 0 0 0"),
              AreNear(Point3{-3, 2, 3}, Point3{-7, 2, 3}));
  EXPECT_THAT(second("Yrotation Xrotation Zrotation", "0 0 0 90 90 0 0 0 0"),
              AreNear(Point3{4, 0, 0}, Point3{8, 0, 0}));
  // The joint alone.
  EXPECT_THAT(second("Zrotation Xrotation Yrotation", "0 0 0 0 0 0 0 90 0"),
              AreNear(Point3{0, 4, 0}, Point3{0, 4, 4}));
  EXPECT_THAT(second("Zrotation Xrotation Yrotation", "0 0 0 90 0 0 0 90 0"),
              AreNear(Point3{-4, 0, 0}, Point3{-4, 0, 4}));
}

TEST(Animations, OfAMeshOnItsBones) {
  const auto frames = OpenAnimation(ModelFile("FBX/animation_with_skeleton.fbx"), 1, 10);
  ASSERT_THAT(frames, IsOk());
  ASSERT_GT((*frames)->count(), 1);
  const auto first = (*frames)->Read(0), later = (*frames)->Read((*frames)->count() / 2);
  ASSERT_THAT(first, IsOk());
  ASSERT_THAT(later, IsOk());
  EXPECT_EQ(first->parts.at(0).kind, Kind::kTriangles);
  EXPECT_EQ(first->parts[0].indices, later->parts[0].indices);
  EXPECT_NE(first->parts[0].positions, later->parts[0].positions);
}

TEST(Animations, OfAMeshFromShapeToShape) {
  const auto frames = OpenAnimation(
      ModelFile("glTF2/glTF-Sample-Models/AnimatedMorphCube-glTF/AnimatedMorphCube.gltf"), 1, 10);
  ASSERT_THAT(frames, IsOk());
  ASSERT_GT((*frames)->count(), 2);
  const auto first = (*frames)->Read(0), later = (*frames)->Read((*frames)->count() / 2);
  ASSERT_THAT(first, IsOk());
  ASSERT_THAT(later, IsOk());
  EXPECT_NE(first->parts.at(0).positions, later->parts.at(0).positions);
}

TEST(Animations, OfASkinInGltf) {
  const auto frames = OpenAnimation(ModelFile("glTF2/simple_skin/simple_skin.gltf"), 1, 10);
  ASSERT_THAT(frames, IsOk());
  const auto first = (*frames)->Read(0), later = (*frames)->Read((*frames)->count() / 4);
  ASSERT_THAT(first, IsOk());
  ASSERT_THAT(later, IsOk());
  // Two bones, of which the upper one bends: the lower end of the strip stays.
  ASSERT_EQ(first->parts.at(0).positions.size(), later->parts.at(0).positions.size());
  size_t still = 0, moved = 0;
  for (size_t i = 0; i < first->parts[0].positions.size(); ++i)
    ++(first->parts[0].positions[i] == later->parts[0].positions[i] ? still : moved);
  EXPECT_GT(still, 0u);
  EXPECT_GT(moved, 0u);
}

TEST(MoreMeshes, AFrameThatLeavesTheNumbersIsNamed) {
  // Two moments of translation: none, and infinitely far along x.
  const auto bytes = [](std::initializer_list<float> values) {
    return std::string(reinterpret_cast<const char*>(values.begin()),
                       values.size() * sizeof(float));
  };
  const std::string data = bytes({0, 0, 0, 1, 0, 0, 0, 1, 0}) + bytes({0, 1}) +
                           bytes({0, 0, 0, std::numeric_limits<float>::infinity(), 0, 0});
  TempFolder folder;
  const std::string path = folder.Write(
      "a.gltf",
      absl::StrCat(
          R"({"asset":{"version":"2.0"},"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],)"
          R"("meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"buffers":[{"byteLength":68,)"
          R"("uri":"data:application/octet-stream;base64,)",
          absl::Base64Escape(data),
          R"("}],"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":8},)"
          R"({"buffer":0,"byteOffset":44,"byteLength":24}],"accessors":[)"
          R"({"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},)"
          R"({"bufferView":1,"componentType":5126,"count":2,"type":"SCALAR","min":[0],"max":[1]},)"
          R"({"bufferView":2,"componentType":5126,"count":2,"type":"VEC3"}],"animations":[{"samplers":)"
          R"([{"input":1,"output":2,"interpolation":"STEP"}],)"
          R"("channels":[{"sampler":0,"target":{"node":0,"path":"translation"}}]}]})"));
  const auto frames = OpenAnimation(path, 1, 1);
  ASSERT_THAT(frames, IsOk());
  EXPECT_THAT((*frames)->Read(0), IsOk());
  EXPECT_THAT(std::string((*frames)->Read(1).status().message()),
              AllOf(HasSubstr("coordinates must be finite"), HasSubstr("(in frame 1)")));
}

TEST(Animations, ThatAreNotThere) {
  EXPECT_THAT(std::string(OpenAnimation(ModelFile("BVH/01_01.bvh"), 2, 20).status().message()),
              HasSubstr("has no animation 2; it has 1"));
  EXPECT_THAT(std::string(OpenAnimation(ModelFile("OBJ/spider.obj"), 1, 20).status().message()),
              HasSubstr("is .obj, which has no animations"));
  const TempFolder folder;
  const std::string drawing = folder.Write("a.svg", "<svg xmlns='http://www.w3.org/2000/svg'/>");
  EXPECT_THAT(std::string(OpenAnimation(drawing, 1, 20).status().message()),
              HasSubstr("is .svg, which has no animations"));
  const std::string mesh = folder.Write("a.stl", "solid a");
  EXPECT_THAT(std::string(OpenAnimation(mesh, 1, 20).status().message()),
              HasSubstr("is .stl, which has no animations"));
  EXPECT_THAT(std::string(OpenAnimation("/nowhere.glb", 1, 20).status().message()),
              HasSubstr("No such file"));
}

}  // namespace animation_test
}  // namespace voxeld::voxelctl
