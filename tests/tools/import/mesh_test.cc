// Tests meshes: their orientation, real files, and broken ones.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <optional>
#include <string>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "tests/tools/import/read_here.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/import/importer.h"
#include "tools/voxelctl/scene/placement.h"

namespace voxeld::voxelctl {
namespace mesh_test {

std::string ModelFile(const std::string& name) {
  return std::string(VOXELD_MODELS_DIR) + "/" + name;
}

struct Totals {
  size_t triangles = 0, segments = 0, points = 0;
};

Totals Count(const Model& model) {
  Totals totals;
  for (const Part& part : model.parts) {
    if (part.kind == Kind::kTriangles) totals.triangles += part.indices.size() / 3;
    if (part.kind == Kind::kSegments) totals.segments += part.indices.size() / 2;
    if (part.kind == Kind::kPoints) totals.points += part.positions.size();
  }
  return totals;
}

// Returns the vertex that is farthest along a direction.
Point3 Farthest(const Model& model, const std::function<double(const Point3&)>& along) {
  Point3 best = model.parts[0].positions[0];
  for (const Part& part : model.parts) {
    for (const Point3& p : part.positions) {
      if (along(p) > along(best)) best = p;
    }
  }
  return best;
}

// ------------------------------------------------------------------------------ orientation

// The arrow has three points: 3, 2 and 1 away from its corner. The direction of each of them, by
// the axis that is up.
struct Turned {
  const char* file;
  Up up;
  Point3 three, two, one;  // directions in the display: x right, −y front, z up
};

class Upright : public testing::TestWithParam<Turned> {};

TEST_P(Upright, AndNotMirrored) {
  const Turned& expected = GetParam();
  absl::StatusOr<Model> model = ReadHere(DataFile(expected.file), {});
  ASSERT_THAT(model, IsOk());
  PlaceModels({&*model, 1}, DisplaySpace(), {.up = expected.up});

  const auto dot = [](const Point3& a, const Point3& b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
  };
  // The corner is the vertex that is farthest against all three.
  const Point3 corner = Farthest(*model, [&](const Point3& p) {
    return -dot(p, expected.three) - dot(p, expected.two) - dot(p, expected.one);
  });
  double unit = 0;
  double factor = 1;
  for (const Point3& direction : {expected.one, expected.two, expected.three}) {
    const Point3 tip = Farthest(*model, [&](const Point3& p) { return dot(p, direction); });
    const Point3 edge = {tip.x - corner.x, tip.y - corner.y, tip.z - corner.z};
    const double length = std::sqrt(dot(edge, edge));
    if (unit == 0) unit = length;
    EXPECT_NEAR(length, factor * unit, 1e-6);
    EXPECT_NEAR(dot(edge, direction), length, 1e-6)
        << "the edge of length " << factor << " points elsewhere";
    factor += 1;
  }
}

INSTANTIATE_TEST_SUITE_P(
    EveryAxis, Upright,
    testing::Values(
        // OBJ: 3 along file y, 2 along z, 1 along x. auto: y up, z in front, x right.
        Turned{"arrow.obj", Up::kAuto, {0, 0, 1}, {0, -1, 0}, {1, 0, 0}},
        Turned{"arrow.obj", Up::kY, {0, 0, 1}, {0, -1, 0}, {1, 0, 0}},
        Turned{"arrow.obj", Up::kZ, {0, 1, 0}, {0, 0, 1}, {1, 0, 0}},
        Turned{"arrow.obj", Up::kX, {0, 1, 0}, {-1, 0, 0}, {0, 0, 1}},
        // STL: 3 along file z, 2 along −y, 1 along x. auto: z up, −y in front, x right.
        Turned{"arrow.stl", Up::kAuto, {0, 0, 1}, {0, -1, 0}, {1, 0, 0}},
        Turned{"arrow.stl", Up::kZ, {0, 0, 1}, {0, -1, 0}, {1, 0, 0}},
        Turned{"arrow.stl", Up::kY, {0, -1, 0}, {0, 0, -1}, {1, 0, 0}},
        Turned{"arrow.stl", Up::kX, {-1, 0, 0}, {0, -1, 0}, {0, 0, 1}}));

TEST(Upright, NormalsTurnWithTheSurface) {
  absl::StatusOr<Model> model = ReadHere(DataFile("arrow.obj"), {});
  ASSERT_THAT(model, IsOk());
  PlaceModels({&*model, 1}, DisplaySpace(), {});
  const Part& part = model->parts[0];
  ASSERT_EQ(part.normals.size(), part.positions.size());
  for (size_t i = 0; i + 2 < part.indices.size(); i += 3) {
    // Every face points away from the middle of the tetrahedron.
    Point3 middle, face;
    for (const Point3& p : part.positions)
      middle = {middle.x + p.x / part.positions.size(), middle.y + p.y / part.positions.size(),
                middle.z + p.z / part.positions.size()};
    for (int c = 0; c < 3; ++c) {
      const Point3& p = part.positions[part.indices[i + c]];
      face = {face.x + p.x / 3, face.y + p.y / 3, face.z + p.z / 3};
    }
    const Point3& n = part.normals[part.indices[i]];
    EXPECT_GT(n.x * (face.x - middle.x) + n.y * (face.y - middle.y) + n.z * (face.z - middle.z), 0);
  }
}

// -------------------------------------------------------------------------------- real files

struct RealFile {
  const char* path;
  const char* format;
  size_t triangles, segments, points;
};

class RealFiles : public testing::TestWithParam<RealFile> {};

TEST_P(RealFiles, AreReadWhole) {
  const absl::StatusOr<Model> model = ReadHere(ModelFile(GetParam().path), {});
  ASSERT_THAT(model, IsOk()) << "tools/setup --import installs assimp-testmodels";
  EXPECT_EQ(model->format, GetParam().format);
  const Totals totals = Count(*model);
  EXPECT_EQ(totals.triangles, GetParam().triangles);
  EXPECT_EQ(totals.segments, GetParam().segments);
  EXPECT_EQ(totals.points, GetParam().points);
}

// 11160 of the engine's 121496 triangles have no area.
INSTANTIATE_TEST_SUITE_P(
    Table, RealFiles,
    testing::Values(RealFile{"glTF2/2CylinderEngine-glTF-Binary/2CylinderEngine.glb", "glTF binary",
                             110336, 0, 0},
                    RealFile{"OBJ/WusonOBJ.obj", "Wavefront OBJ", 3732, 0, 0},
                    RealFile{"PLY/Wuson.ply", "PLY mesh", 3732, 0, 0},
                    RealFile{"STL/Wuson.stl", "STL", 3732, 0, 0},
                    RealFile{"STL/Spider_ascii.stl", "STL", 1368, 0, 0},
                    RealFile{"STL/Spider_binary.stl", "STL", 1368, 0, 0},
                    RealFile{"PLY/cube_binary.ply", "PLY mesh", 12, 0, 0},
                    RealFile{"PLY/points.ply", "PLY points", 0, 0, 4},
                    RealFile{"PLY/pond.0.ply", "PLY points", 0, 0, 70051},
                    RealFile{"OBJ/point_cloud.obj", "Wavefront OBJ", 0, 0, 3},
                    RealFile{"OBJ/testline.obj", "Wavefront OBJ", 0, 18, 0},
                    RealFile{"glTF2/BoxTextured-glTF/BoxTextured.gltf", "glTF", 12, 0, 0},
                    RealFile{"glTF2/BoxTextured-glTF-Embedded/BoxTextured.gltf", "glTF", 12, 0,
                             0}));

TEST(RealFiles, MaterialsAndVertexColoursAreTaken) {
  const absl::StatusOr<Model> engine =
      ReadHere(ModelFile("glTF2/2CylinderEngine-glTF-Binary/2CylinderEngine.glb"), {});
  ASSERT_THAT(engine, IsOk());
  size_t colored = 0;
  for (const Part& part : engine->parts) colored += part.colors.empty() ? 0 : 1;
  EXPECT_EQ(colored, engine->parts.size());
  const absl::StatusOr<Model> cube = ReadHere(ModelFile("OBJ/cube_with_vertexcolors.obj"), {});
  ASSERT_THAT(cube, IsOk());
  EXPECT_THAT(cube->parts[0].colors, testing::Contains(Rgb{224, 0, 10}));
  const absl::StatusOr<Model> plain = ReadHere(ModelFile("STL/Wuson.stl"), {});
  ASSERT_THAT(plain, IsOk());
  EXPECT_TRUE(plain->parts[0].colors.empty());
}

TEST(RealFiles, TheDamagedCloudIsMendedAndSaysSo) {
  const absl::StatusOr<Model> pond = ReadHere(ModelFile("PLY/pond.0.ply"), {});
  ASSERT_THAT(pond, IsOk());
  EXPECT_THAT(pond->note, testing::HasSubstr("lost 69 bytes"));
}

struct BadModel {
  const char* path;
  Words words;
};

class BadModels : public testing::TestWithParam<BadModel> {};

TEST_P(BadModels, AreRefusedWithWords) {
  EXPECT_THAT(ReadHere(ModelFile(GetParam().path), {}), Fails(GetParam().words));
}

INSTANTIATE_TEST_SUITE_P(
    RealFiles, BadModels,
    testing::Values(
        BadModel{"invalid/empty.obj", {"empty"}}, BadModel{"invalid/empty.ply", {"empty"}},
        BadModel{"invalid/malformed.obj", {"line 23", "vertex 12", "1 to 8"}},
        BadModel{"OBJ/box_UTF16BE.obj", {"UTF-16", "UTF-8"}},
        BadModel{"glTF/BoxTextured-glTF/BoxTextured.gltf", {"version \"1.0\"", "2.0"}},
        BadModel{"glTF/BoxTextured-glTF-Binary/BoxTextured.glb", {"GLB of version 1"}},
        BadModel{"glTF2/IndexOutOfRange/IndexOutOfRange.gltf",
                 {"meshes[0].primitives[0]", "vertex 255", "24 vertices"}},
        BadModel{"glTF2/IncorrectVertexArrays/Cube.gltf", {"bufferViews[2]", "936", "514"}},
        BadModel{"glTF2/MissingBin/BoxTextured.gltf", {"buffers[0]", "BoxTextured0.bin"}},
        BadModel{"glTF2/RecursiveNodes/RecursiveNodes.gltf", {"node 0", "cycle"}},
        BadModel{"glTF2/BoxWithInfinites-glTF-Binary/BoxWithInfinites.glb", {"-inf", "finite"}},
        BadModel{"glTF2/draco/2CylinderEngine.gltf", {"KHR_draco_mesh_compression"}},
        BadModel{"glTF2/wrongTypes/badArray.gltf", {"primitives is no array"}},
        BadModel{"glTF2/wrongTypes/badObject.gltf",
                 {"materials[0].pbrMetallicRoughness is [", "an object is expected"}},
        BadModel{"glTF2/wrongTypes/badUint.gltf",
                 {"baseColorTexture.index is -1", "a whole number from 0 is expected"}},
        BadModel{"glTF2/TestNoRootNode/SceneWithoutNodes.gltf", {"no mesh"}}));

// ------------------------------------------------------------------------------ broken files

struct BadFile {
  const char* name;
  const char* file;
  std::string bytes;
  Words words;
};

class BadMeshes : public testing::TestWithParam<BadFile> {};

TEST_P(BadMeshes, AreRefusedWithWords) {
  TempFolder folder;
  const std::string path = folder.Write(GetParam().file, GetParam().bytes);
  Words words = GetParam().words;
  words.push_back(path);
  EXPECT_THAT(ReadHere(path, {}), Fails(words));
}

std::string U32(uint32_t value) {
  char bytes[4];
  std::memcpy(bytes, &value, 4);
  return {bytes, 4};
}

std::string BinaryStl(uint32_t facets, size_t bytes) {
  return std::string(80, 'b') + U32(facets) + std::string(bytes, '\0');
}

std::string Glb(const std::string& json, uint32_t length_more = 0) {
  std::string padded = json;
  while (padded.size() % 4 != 0) padded += ' ';
  return "glTF" + U32(2) + U32(static_cast<uint32_t>(20 + padded.size()) + length_more) +
         U32(static_cast<uint32_t>(padded.size())) + "JSON" + padded;
}

// Returns a triangle with the given members.
std::string Gltf(const std::string& accessors, const std::string& nodes = R"([{"mesh":0}])",
                 const std::string& extra = "") {
  return R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":)" + nodes +
         R"(,"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"buffers":[{"byteLength":36,"uri":"data:application/octet-stream;base64,)" +
         std::string(48, 'A') + R"("}],"bufferViews":[{"buffer":0,"byteLength":36}],"accessors":)" +
         accessors + extra + "}";
}

// Returns a triangle with a material (empty: none), and with white vertex colours or none.
std::string ColoredGltf(const std::string& material, bool white_vertices) {
  std::string bytes;
  for (const float value : {0.f, 0.f, 0.f, 1.f, 0.f, 0.f, 0.f, 1.f, 0.f}) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof(value));
  }
  for (int i = 0; i < 9; ++i) bytes.append("\0\0\x80\x3f", 4);
  return absl::StrCat(
      R"({"asset":{"version":"2.0"},"extensionsUsed":["KHR_materials_pbrSpecularGlossiness"],)",
      R"("scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],)",
      R"("meshes":[{"primitives":[{"attributes":{"POSITION":0)",
      white_vertices ? R"(,"COLOR_0":1)" : "", "}", material.empty() ? "" : R"(,"material":0)",
      R"(}]}],"buffers":[{"byteLength":72,"uri":"data:application/octet-stream;base64,)",
      absl::Base64Escape(bytes),
      R"("}],"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":36}],)",
      R"("accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":3,"min":[0,0,0],"max":[1,1,0]},)",
      R"({"bufferView":1,"componentType":5126,"type":"VEC3","count":3}])",
      material.empty() ? "" : absl::StrCat(R"(,"materials":[)", material, "]"), "}");
}

TEST(MeshColours, OfGltfAreMultiplied) {
  TempFolder folder;
  const auto color = [&](const std::string& material, bool white_vertices) -> std::optional<Rgb> {
    const auto model = ReadHere(folder.Write("a.gltf", ColoredGltf(material, white_vertices)), {});
    EXPECT_TRUE(model.ok()) << model.status();
    if (!model.ok() || model->parts.at(0).colors.empty()) return std::nullopt;
    return model->parts[0].colors[0];
  };
  const std::string red = R"("pbrMetallicRoughness":{"baseColorFactor":[1,0,0,1]}})";
  EXPECT_EQ(color("{" + red, true), (Rgb{255, 0, 0}));
  EXPECT_EQ(color("{" + red, false), (Rgb{255, 0, 0}));
  EXPECT_EQ(color(R"({"name":"DefaultMaterial",)" + red, false), (Rgb{255, 0, 0}));
  EXPECT_EQ(color(R"({"name":"DefaultMaterial"})", false), (Rgb{255, 255, 255}));
  EXPECT_EQ(color("", true), (Rgb{255, 255, 255}));
  EXPECT_EQ(color("", false), (Rgb{255, 255, 255})) << "the format's default";
  const std::string green =
      R"({"extensions":{"KHR_materials_pbrSpecularGlossiness":{"diffuseFactor":[0,1,0,1]}}})";
  EXPECT_EQ(color(green, false), (Rgb{0, 255, 0}));
  EXPECT_EQ(color(green, true), (Rgb{0, 255, 0}));
}

std::string Positions(const std::string& count) {
  return R"([{"bufferView":0,"componentType":5126,"type":"VEC3","count":)" + count + "}]";
}

INSTANTIATE_TEST_SUITE_P(
    Table, BadMeshes,
    testing::Values(
        BadFile{"obj_is_picture",
                "a.obj",
                std::string("\x89PNG\r\n\x1a\n\0\0", 10),
                {"a PNG picture", "Wavefront OBJ"}},
        BadFile{"obj_is_gltf", "a.obj", Glb("{}"), {"glTF binary", "Wavefront OBJ"}},
        BadFile{"obj_no_vertex", "a.obj", "# nothing\nvn 0 0 1\n", {"no vertex"}},
        BadFile{"obj_short_vertex",
                "a.obj",
                "v 1 2 3\nv 1 2\n",
                {"vertex 2", "line 2", "2 coordinates"}},
        BadFile{"obj_index",
                "a.obj",
                "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n",
                {"line 4", "vertex 9", "1 to 3"}},
        BadFile{"obj_index_zero",
                "a.obj",
                "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n",
                {"line 4", "vertex 0"}},
        BadFile{"obj_index_absurd",
                "a.obj",
                "v 0 0 0\nf 1 1 99999999999999999999\n",
                {"line 2", "99999999999999999999"}},
        BadFile{"obj_one_coordinate", "a.obj", "v 1\n", {"has 1 coordinate;"}},
        BadFile{
            "obj_index_back", "a.obj", "v 0 0 0\nf -1 -1 -2\nv 0 0 0\n", {"line 2", "vertex -2"}},
        BadFile{"obj_nan", "a.obj", "v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n", {"finite"}},
        BadFile{
            "stl_is_text", "a.stl", "hello, this is not a mesh\n", {"hello", "solid", "84 bytes"}},
        BadFile{
            "stl_short", "a.stl", BinaryStl(100, 4999), {"100 triangles", "5084 bytes", "5083"}},
        BadFile{"stl_one", "a.stl", BinaryStl(1, 49), {"announces 1 triangle (134 bytes)"}},
        BadFile{"stl_absurd",
                "a.stl",
                BinaryStl(0xffffffff, 50),
                {"4294967295 triangles", "134 bytes"}},
        BadFile{"stl_none", "a.stl", BinaryStl(0, 0), {"no triangle"}},
        BadFile{"stl_ascii_cut",
                "a.stl",
                "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0",
                {"endsolid", "truncated"}},
        BadFile{"stl_ascii_empty", "a.stl", "solid a\nendsolid a\n", {"without a facet"}},
        BadFile{"glb_cut_in_header",
                "a.glb",
                Glb("{}").substr(0, 19),
                {"ends early: it has 19 bytes", "headers alone have 20"}},
        BadFile{"glb_is_text", "a.glb", "{}", {"JSON text", "glTF"}},
        BadFile{"gltf_is_glb", "a.gltf", Glb(Gltf(Positions("3"))), {"name it .glb"}},
        BadFile{"gltf_deep", "a.gltf", std::string(100000, '['), {"nests 100000 deep"}},
        BadFile{"gltf_no_asset", "a.gltf", "{}", {"asset"}},
        BadFile{"gltf_count",
                "a.gltf",
                Gltf(Positions("4")),
                {"accessors[0]", "4 elements", "36 bytes"}},
        BadFile{"gltf_absurd_count",
                "a.gltf",
                Gltf(Positions("1000000000000")),
                {"accessors[0].count is 1000000000000"}},
        BadFile{
            "gltf_negative_count", "a.gltf", Gltf(Positions("-1")), {"accessors[0].count is -1"}},
        BadFile{"gltf_count_is_text",
                "a.gltf",
                Gltf(Positions("\"3\"")),
                {"accessors[0].count is \"3\""}},
        BadFile{"gltf_two_parents",
                "a.gltf",
                Gltf(Positions("3"), R"([{"children":[1]},{"children":[2]},{"children":[1]}])"),
                {"node 1", "two parents"}},
        BadFile{"gltf_child_out_of_range",
                "a.gltf",
                Gltf(Positions("3"), R"([{"children":[7]}])"),
                {"nodes[0].children", "7"}},
        BadFile{"gltf_view",
                "a.gltf",
                Gltf(R"([{"bufferView":5,"componentType":5126,"type":"VEC3","count":3}])"),
                {"accessors[0].bufferView is 5"}},
        BadFile{
            "ply_index",
            "a.ply",
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty "
            "float z\nelement face 1\n"
            "property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 77\n",
            {"a.ply"}}),
    [](const auto& info) { return info.param.name; });

TEST(ImportFile, AFolderWithoutSlicesIsRefused) {
  TempFolder folder;
  EXPECT_THAT(ReadHere(folder.Path("."), {}), Fails(Words{"is a folder"}));
}

TEST(ImportFile, NamesTheFormatsThatItReads) {
  TempFolder folder;
  EXPECT_THAT(ReadHere(folder.Write("a.docx", "PK\x03\x04"), {}),
              Fails(Words{".docx", ".obj", ".geojson"}));
  EXPECT_THAT(ReadHere(folder.Write("noname", "x"), {}), Fails(Words{"no extension", ".ply"}));
}

TEST(BadMeshes, ACutGlbIsSaidToEndEarlyWithBothSizes) {
  TempFolder folder;
  const std::string whole =
      ReadAll(ModelFile("glTF2/2CylinderEngine-glTF-Binary/2CylinderEngine.glb"));
  ASSERT_GT(whole.size(), 1000000u);
  // Without a CR LF, and with many LF, as any file of that length may have.
  std::string cut = whole.substr(0, whole.size() / 2);
  for (size_t at = 0; (at = cut.find("\r\n", at)) != std::string::npos;) cut[at] = ' ';
  const std::string path = folder.Write("a.glb", cut);
  const std::string message(ReadHere(path, {}).status().message());
  EXPECT_EQ(message, absl::StrCat(path, ": ends early: it has ", cut.size(),
                                  " bytes; its header announces ", whole.size()));
}

TEST(BadMeshes, TruncatedAnywhereNeverCrashes) {
  TempFolder folder;
  const std::string engine = ReadAll(ModelFile("glTF2/BoxTextured-glTF-Binary/BoxTextured.glb"));
  const std::string spider = ReadAll(ModelFile("STL/Spider_binary.stl"));
  std::string stl = ReadAll(ModelFile("STL/triangle.stl"));
  stl.resize(stl.rfind("endsolid"));  // the rest is not needed
  const std::string ply = ReadAll(ModelFile("PLY/cube_binary.ply"));
  ASSERT_GT(engine.size() + stl.size() + ply.size() + spider.size(), 5000u);
  for (const auto& [name, bytes] : {std::pair("a.glb", engine), std::pair("a.stl", stl),
                                    std::pair("b.stl", spider), std::pair("a.ply", ply)}) {
    for (size_t length = 1; length < bytes.size(); length += 1 + bytes.size() / 97) {
      const std::string path = folder.Write(name, bytes.substr(0, length));
      EXPECT_FALSE(ReadHere(path, {}).ok()) << name << " cut at " << length;
    }
  }
}

}  // namespace mesh_test
}  // namespace voxeld::voxelctl
