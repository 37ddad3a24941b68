// Tests glTF: the visible features of the format, with values computed by hand for files of a few
// vertices.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "tests/tools/import/read_here.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/import/gltf_model.h"

namespace voxeld::voxelctl {
namespace gltf_test {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// One pixel.
constexpr char kPng[] =
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mP8z8DwHwAFBQIAX8jx0gAAAABJRU5ErkJg"
    "gg==";

// A document whose accessors each have a view of their own in one buffer.
class Gltf {
 public:
  template <typename T>
  int Add(const std::vector<T>& numbers, const std::string& type, const std::string& more = "") {
    static constexpr int kComponents[] = {1, 2, 3, 4, 16};
    static constexpr const char* kTypes[] = {"SCALAR", "VEC2", "VEC3", "VEC4", "MAT4"};
    int components = 0;
    for (size_t i = 0; i < 5; ++i) {
      if (type == kTypes[i]) components = kComponents[i];
    }
    const int view = View(numbers);
    accessors_.push_back(absl::StrCat(R"({"bufferView":)", view, R"(,"componentType":)",
                                      TypeOf<T>(), R"(,"type":")", type, R"(","count":)",
                                      numbers.size() / static_cast<size_t>(components), more, "}"));
    return static_cast<int>(accessors_.size()) - 1;
  }
  template <typename T>
  int View(const std::vector<T>& numbers, const std::string& more = "") {
    while (bytes_.size() % 4 != 0) bytes_ += '\0';
    const size_t size = numbers.size() * sizeof(T);
    views_.push_back(absl::StrCat(R"({"buffer":0,"byteOffset":)", bytes_.size(),
                                  R"(,"byteLength":)", size, more, "}"));
    bytes_.append(reinterpret_cast<const char*>(numbers.data()), size);
    return static_cast<int>(views_.size()) - 1;
  }
  int Accessor(const std::string& json) {
    accessors_.push_back(json);
    return static_cast<int>(accessors_.size()) - 1;
  }
  // `members` are those beside buffers, views and accessors.
  std::string Text(const std::string& members) const {
    return absl::StrCat(R"({"asset":{"version":"2.0"},"buffers":[{"byteLength":)", bytes_.size(),
                        R"(,"uri":"data:application/octet-stream;base64,)",
                        absl::Base64Escape(bytes_), R"("}],"bufferViews":[)",
                        absl::StrJoin(views_, ","), R"(],"accessors":[)",
                        absl::StrJoin(accessors_, ","), "],", members, "}");
  }
  std::string Glb(const std::string& members) const {
    std::string bytes = bytes_;
    while (bytes.size() % 4 != 0) bytes += '\0';
    std::string json =
        absl::StrCat(R"({"asset":{"version":"2.0"},"buffers":[{"byteLength":)", bytes_.size(),
                     R"(}],"bufferViews":[)", absl::StrJoin(views_, ","), R"(],"accessors":[)",
                     absl::StrJoin(accessors_, ","), "],", members, "}");
    while (json.size() % 4 != 0) json += ' ';
    const auto u32 = [](size_t value) {
      const auto number = static_cast<uint32_t>(value);
      return std::string(reinterpret_cast<const char*>(&number), 4);
    };
    return absl::StrCat("glTF", u32(2), u32(28 + json.size() + bytes.size()), u32(json.size()),
                        "JSON", json, u32(bytes.size()), std::string("BIN\0", 4), bytes);
  }

 private:
  template <typename T>
  static int TypeOf() {
    return std::is_same_v<T, int8_t>     ? 5120
           : std::is_same_v<T, uint8_t>  ? 5121
           : std::is_same_v<T, int16_t>  ? 5122
           : std::is_same_v<T, uint16_t> ? 5123
           : std::is_same_v<T, uint32_t> ? 5125
                                         : 5126;
  }

  std::string bytes_;
  std::vector<std::string> views_, accessors_;
};

constexpr char kOneNode[] = R"("scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],)";

std::string Mesh(const std::string& primitive) {
  return absl::StrCat(R"("meshes":[{"primitives":[{)", primitive, "}]}]");
}

// A triangle in the plane z = 0.
const std::vector<float> kTriangle = {0, 0, 0, 4, 0, 0, 0, 1, 0};

class GltfFiles : public testing::Test {
 protected:
  absl::StatusOr<Model> Read(const std::string& text, const std::string& name = "a.gltf") {
    return ReadHere(folder_.Write(name, text), {});
  }
  Model Good(const std::string& text, const std::string& name = "a.gltf") {
    absl::StatusOr<Model> model = Read(text, name);
    EXPECT_THAT(model, IsOk()) << text.substr(0, 2000);
    if (!model.ok()) return Model{.parts = {Part{.positions = {{}}, .colors = {{}}}}};
    return *std::move(model);
  }
  TempFolder folder_;
};

MATCHER_P3(IsAt, x, y, z, "") {
  return std::abs(arg.x - x) < 1e-6 && std::abs(arg.y - y) < 1e-6 && std::abs(arg.z - z) < 1e-6;
}

// ------------------------------------------------------------------------------------------ elements

TEST_F(GltfFiles, EveryModeOfPrimitives) {
  // A square of four corners, and an additional corner.
  const std::vector<float> five = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 9, 9, 9};
  Gltf gltf;
  const int positions = gltf.Add(five, "VEC3");
  const int indices = gltf.Add(std::vector<uint8_t>{0, 1, 2, 3}, "SCALAR");
  const auto read = [&](int mode) {
    return Good(gltf.Text(
                    kOneNode +
                    Mesh(absl::StrCat(R"("attributes":{"POSITION":)", positions, R"(},"indices":)",
                                      indices, R"(,"material":0,"mode":)", mode)) +
                    R"(,"materials":[{"extensions":{"KHR_materials_unlit":{}}}])"))
        .parts[0];
  };
  const Part points = read(0);
  EXPECT_EQ(points.kind, Kind::kPoints);
  EXPECT_EQ(points.positions.size(), 4u) << "vertices without an index are not drawn";
  EXPECT_THAT(read(1).indices, ElementsAre(0, 1, 2, 3));
  EXPECT_THAT(read(2).indices, ElementsAre(0, 1, 1, 2, 2, 3, 3, 0));
  EXPECT_THAT(read(3).indices, ElementsAre(0, 1, 1, 2, 2, 3));
  EXPECT_EQ(read(3).kind, Kind::kSegments);
  EXPECT_THAT(read(4).indices, ElementsAre(0, 1, 2)) << "a fourth corner is not a triangle";
  EXPECT_THAT(read(5).indices, ElementsAre(0, 1, 2, 1, 3, 2)) << "winding alternates";
  EXPECT_THAT(read(6).indices, ElementsAre(0, 1, 2, 0, 2, 3));
  const auto seven = Read(gltf.Text(kOneNode + Mesh(R"("attributes":{"POSITION":0},"mode":7)")));
  EXPECT_THAT(seven, Fails(Words{"primitives[0].mode is 7", "0 to 6"}));
}

TEST_F(GltfFiles, SparsePositionsAndViewsWithAStride) {
  Gltf gltf;
  // Positions and normals interleaved: 24 bytes a vertex.
  const int view =
      gltf.View(std::vector<float>{0, 0, 0, 0, 0, 1, 4, 0, 0, 0, 0, 1, 0, 1, 0, 0, 0, 1},
                R"(,"byteStride":24)");
  const int at = gltf.View(std::vector<uint16_t>{2});
  const int with = gltf.View(std::vector<float>{7, 8, 9});
  gltf.Accessor(
      absl::StrCat(R"({"bufferView":)", view,
                   R"(,"componentType":5126,"type":"VEC3","count":3,"sparse":{"count":1,)",
                   R"("indices":{"bufferView":)", at,
                   R"(,"componentType":5123},"values":{"bufferView":)", with, "}}}"));
  gltf.Accessor(absl::StrCat(R"({"bufferView":)", view,
                             R"(,"byteOffset":12,"componentType":5126,"type":"VEC3","count":3})"));
  const Model model = Good(gltf.Text(kOneNode + Mesh(R"("attributes":{"POSITION":0,"NORMAL":1})")));
  EXPECT_THAT(model.parts[0].positions, ElementsAre(IsAt(0, 0, 0), IsAt(4, 0, 0), IsAt(7, 8, 9)));
  EXPECT_THAT(model.parts[0].normals, ElementsAre(IsAt(0, 0, 1), IsAt(0, 0, 1), IsAt(0, 0, 1)));
}

TEST_F(GltfFiles, ZerosThatTheFileDoesNotHaveAreRefused) {
  const std::string text = absl::StrCat(
      R"({"asset":{"version":"2.0"},"accessors":[{"componentType":5126,"type":"VEC3","count":30000000}],)",
      R"("nodes":[{"mesh":0}],)", Mesh(R"("attributes":{"POSITION":0})"), "}");
  EXPECT_THAT(Read(text), Fails(Words{"30000000 elements without a view"}));
}

TEST_F(GltfFiles, QuantizedPositions) {
  // As VEC3 with a stride of 8 bytes; normalised: 32767 is 1, and -32768 is -1 too.
  const auto text = [&](bool normalized) {
    Gltf one;
    const int view = one.View(std::vector<int16_t>{0, 0, 0, 0, 32767, 0, 0, 0, 0, -32768, 0, 0},
                              R"(,"byteStride":8)");
    one.Accessor(absl::StrCat(R"({"bufferView":)", view,
                              R"(,"componentType":5122,"type":"VEC3","count":3,"normalized":)",
                              normalized ? "true" : "false", "}"));
    return one.Text(absl::StrCat(R"("extensionsRequired":["KHR_mesh_quantization"],)", kOneNode,
                                 Mesh(R"("attributes":{"POSITION":0})")));
  };
  EXPECT_THAT(Good(text(true)).parts[0].positions,
              ElementsAre(IsAt(0, 0, 0), IsAt(1, 0, 0), IsAt(0, -1, 0)));
  EXPECT_THAT(Good(text(false)).parts[0].positions,
              ElementsAre(IsAt(0, 0, 0), IsAt(32767, 0, 0), IsAt(0, -32768, 0)));
}

TEST_F(GltfFiles, SurfacesWithoutNormalsAreFlat) {
  Gltf gltf;
  // Two triangles that share an edge, at a right angle.
  gltf.Add(std::vector<float>{0, 0, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1}, "VEC3");
  gltf.Add(std::vector<uint8_t>{0, 2, 1, 0, 1, 3}, "SCALAR");
  const Part part =
      Good(gltf.Text(kOneNode + Mesh(R"("attributes":{"POSITION":0},"indices":1)"))).parts[0];
  EXPECT_EQ(part.positions.size(), 6u);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_THAT(part.normals[part.indices[i]], IsAt(0, 0, 1));
    EXPECT_THAT(part.normals[part.indices[3 + i]], IsAt(1, 0, 0));
  }
}

// -------------------------------------------------------------------------------------------- colours

TEST_F(GltfFiles, ColoursOfEveryTypeAreFactorsOfTheMaterial) {
  const auto color = [&](auto numbers, const std::string& type, const std::string& more) {
    Gltf gltf;
    gltf.Add(kTriangle, "VEC3");
    gltf.Add(numbers, type, more);
    return Good(gltf.Text(absl::StrCat(
                    kOneNode, Mesh(R"("attributes":{"POSITION":0,"COLOR_0":1},"material":0)"),
                    R"(,"materials":[{"pbrMetallicRoughness":{"baseColorFactor":[1,0.5,1,1]}}])")))
        .parts[0]
        .colors[0];
  };
  // Linear light: half of it is 188 of 255, a quarter 137.
  const std::string normalized = R"(,"normalized":true)";
  EXPECT_EQ(color(std::vector<float>{1, 0.5, 0, 1, 0.5, 0, 1, 0.5, 0}, "VEC3", ""),
            (Rgb{255, 137, 0}));
  EXPECT_EQ(color(std::vector<float>{1, 0.5, 0, .3f, 1, 0.5, 0, 1, 1, 0.5, 0, 1}, "VEC4", ""),
            (Rgb{255, 137, 0}));
  EXPECT_EQ(color(std::vector<uint16_t>{65535, 65535, 0, 65535, 65535, 0, 65535, 65535, 0}, "VEC3",
                  normalized),
            (Rgb{255, 188, 0}));
  EXPECT_EQ(color(std::vector<uint8_t>{255, 255, 0, 9, 255, 255, 0, 9, 255, 255, 0, 9}, "VEC4",
                  normalized),
            (Rgb{255, 188, 0}));
  // Three bytes or shorts a vertex, each vertex at a multiple of four bytes, as the format
  // requires.
  const auto apart = [&](auto numbers, int type, int stride) {
    Gltf gltf;
    gltf.Add(kTriangle, "VEC3");
    const int view = gltf.View(numbers, absl::StrCat(R"(,"byteStride":)", stride));
    gltf.Accessor(absl::StrCat(R"({"bufferView":)", view, R"(,"componentType":)", type,
                               R"(,"type":"VEC3","count":3,"normalized":true})"));
    return Good(gltf.Text(kOneNode + Mesh(R"("attributes":{"POSITION":0,"COLOR_0":1})")))
        .parts[0]
        .colors;
  };
  const auto three = ElementsAre(Rgb{255, 0, 0}, Rgb{0, 255, 0}, Rgb{0, 0, 255});
  EXPECT_THAT(apart(std::vector<uint8_t>{255, 0, 0, 9, 0, 255, 0, 9, 0, 0, 255, 9}, 5121, 4),
              three);
  EXPECT_THAT(apart(std::vector<uint16_t>{65535, 0, 0, 9, 0, 65535, 0, 9, 0, 0, 65535, 9}, 5123, 8),
              three);
}

TEST_F(GltfFiles, EmissionIsAdded) {
  const auto color = [&](const std::string& material) {
    Gltf gltf;
    gltf.Add(kTriangle, "VEC3");
    return Good(
               gltf.Text(absl::StrCat(kOneNode, Mesh(R"("attributes":{"POSITION":0},"material":0)"),
                                      R"(,"materials":[)", material, "]")))
        .parts[0]
        .colors[0];
  };
  const std::string red = R"("pbrMetallicRoughness":{"baseColorFactor":[1,0,0,1]})";
  EXPECT_EQ(color("{" + red + R"(,"emissiveFactor":[0,0.5,0]})"), (Rgb{255, 188, 0}));
  EXPECT_EQ(color("{" + red + R"(,"emissiveFactor":[0,0.25,0],"extensions":)" +
                  R"({"KHR_materials_emissive_strength":{"emissiveStrength":2}}})"),
            (Rgb{255, 188, 0}));
}

TEST_F(GltfFiles, UnlitSurfacesHaveNoNormalsAndInvisibleOnesAreNotDrawn) {
  const auto text = [](const std::string& material) {
    Gltf gltf;
    gltf.Add(kTriangle, "VEC3");
    return gltf.Text(absl::StrCat(
        kOneNode,
        R"("meshes":[{"primitives":[{"attributes":{"POSITION":0},"material":0},{"attributes":{"POSITION":0}}]}])",
        R"(,"materials":[)", material, "]"));
  };
  const Model unlit = Good(text(R"({"extensions":{"KHR_materials_unlit":{}}})"));
  EXPECT_THAT(unlit.parts[0].normals, IsEmpty());
  EXPECT_EQ(unlit.parts[1].normals.size(), 3u);
  const std::string clear = R"("pbrMetallicRoughness":{"baseColorFactor":[1,0,0,0.2]}})";
  const Model opaque = Good(text("{" + clear));
  EXPECT_EQ(opaque.parts.size(), 2u) << "alpha counts only in the modes that say so";
  EXPECT_THAT(opaque.left_out, IsEmpty());
  const Model mask = Good(text(R"({"alphaMode":"MASK",)" + clear));
  EXPECT_EQ(mask.parts.size(), 1u);
  EXPECT_THAT(mask.left_out, ElementsAre(LeftOut{"fully transparent surfaces", 1}));
  const Model blend = Good(text(R"({"alphaMode":"BLEND",)" + clear));
  EXPECT_EQ(blend.parts.size(), 2u);
  EXPECT_THAT(blend.left_out, ElementsAre(LeftOut{"transparency of materials", 1}));
}

// A quad of two triangles and a third beside it; `alphas` of its nine vertices.
TEST_F(GltfFiles, VerticesAlphaHidesElements) {
  const auto read = [this](const std::string& material, const std::vector<float>& alphas,
                           int mode = 4) {
    Gltf gltf;
    std::vector<float> positions, colors;
    for (size_t v = 0; v < 9; ++v) {
      const auto x = static_cast<float>(v), y = static_cast<float>(v % 3 == 1);
      positions.insert(positions.end(), {x, y, 0});
      colors.insert(colors.end(), {1, 0, 0, alphas[v]});
    }
    gltf.Add(positions, "VEC3");
    gltf.Add(colors, "VEC4");
    return ReadHere(
        folder_.Write("a.gltf",
                      gltf.Text(absl::StrCat(
                          kOneNode,
                          Mesh(absl::StrCat(R"("attributes":{"POSITION":0,"COLOR_0":1},"mode":)",
                                            mode, R"(,"material":0)")),
                          R"(,"materials":[)", material, "]"))),
        {});
  };
  const std::string blend = R"({"alphaMode":"BLEND"})", mask = R"({"alphaMode":"MASK"})";
  const std::vector<float> none(9, 0.f),
      first = {0, 0, 0, 1, 1, 1, 1, 1, 1},
      faint = {0.4f, 0.4f, 0.4f, 0.4f, 0.4f, 0.9f, 0.5f, 0.5f, 0.5f};
  for (const std::string& material : {blend, mask})
    EXPECT_THAT(read(material, none), Fails(Words{"shows no mesh"})) << material;
  const auto opaque = read("{}", none);
  ASSERT_THAT(opaque, IsOk());
  EXPECT_EQ(opaque->parts.at(0).indices.size(), 9u) << "alpha counts only in the modes that say so";
  EXPECT_THAT(opaque->left_out, IsEmpty());
  const auto blended = read(blend, first);
  ASSERT_THAT(blended, IsOk());
  EXPECT_EQ(blended->parts.at(0).indices.size(), 6u);
  EXPECT_EQ(blended->parts[0].positions.size(), 6u);
  EXPECT_THAT(blended->left_out, ElementsAre(LeftOut{"transparency of materials", 1},
                                             LeftOut{"fully transparent elements of surfaces", 1}));
  // The material's alpha is a factor: 0.9 · 0.5 is below the cutoff, too.
  const auto masked =
      read(R"({"alphaMode":"MASK","pbrMetallicRoughness":{"baseColorFactor":[1,1,1,0.9]}})", faint);
  ASSERT_THAT(masked, IsOk());
  EXPECT_EQ(masked->parts.at(0).indices.size(), 3u);
  EXPECT_THAT(masked->left_out,
              ElementsAre(LeftOut{"fully transparent elements of surfaces", 2},
                          LeftOut{"partly transparent elements of surfaces, drawn opaque", 1}));
  const auto points = read(mask, first, 0);
  ASSERT_THAT(points, IsOk());
  EXPECT_EQ(points->parts.at(0).positions.size(), 6u);
  EXPECT_THAT(points->left_out, ElementsAre(LeftOut{"fully transparent elements of surfaces", 3}));
}

TEST_F(GltfFiles, WhatNoSceneHoldsIsCounted) {
  const auto left_out = [this](const std::string& scenes, const std::string& nodes) {
    Gltf gltf;
    gltf.Add(kTriangle, "VEC3");
    const std::string primitives = R"({"primitives":[{"attributes":{"POSITION":0}}]})";
    return Good(gltf.Text(absl::StrCat(R"("scene":0,"scenes":)", scenes, R"(,"nodes":)", nodes,
                                       R"(,"meshes":[)", primitives, ",", primitives, "]")))
        .left_out;
  };
  const std::string both = R"([{"mesh":0},{"mesh":1,"translation":[0,5,0]}])";
  EXPECT_THAT(left_out(R"([{"nodes":[0,1]}])", both), IsEmpty());
  EXPECT_THAT(left_out(R"([{"nodes":[0]}])", both),
              ElementsAre(LeftOut{"meshes outside the scenes", 1}));
  // A second use of a mesh that is shown, a child of a node outside, and a mesh that no node has.
  EXPECT_THAT(left_out(R"([{"nodes":[0]}])",
                       R"([{"mesh":0},{"children":[2]},{"mesh":0,"translation":[0,5,0]}])"),
              ElementsAre(LeftOut{"meshes outside the scenes", 2}));
  EXPECT_THAT(left_out(R"([{"nodes":[0]},{"nodes":[1]}])", both),
              ElementsAre(LeftOut{"other scenes", 1}));
}

// ------------------------------------------------------------------------------------------- pictures

std::string Textured(const std::string& texture_info, const std::string& sampler,
                     const std::string& image, const std::vector<float>& uv) {
  Gltf gltf;
  gltf.Add(kTriangle, "VEC3");
  gltf.Add(uv, "VEC2");
  gltf.Add(std::vector<uint16_t>{0, 0, 65535, 0, 0, 65535}, "VEC2", R"(,"normalized":true)");
  return gltf.Text(absl::StrCat(
      kOneNode, Mesh(R"("attributes":{"POSITION":0,"TEXCOORD_0":1,"TEXCOORD_1":2},"material":0)"),
      R"(,"materials":[{"pbrMetallicRoughness":{"baseColorFactor":[1,0,0,1],"baseColorTexture":)",
      texture_info, R"(}}],"textures":[{"source":0,"sampler":0}],"samplers":[)", sampler,
      R"(],"images":[)", image, "]"));
}

const std::string kEmbedded = absl::StrCat(R"({"uri":"data:image/png;base64,)", kPng, R"("})");

using Place = std::array<float, 2>;

MATCHER_P2(IsOn, u, v, "") { return std::abs(arg[0] - u) < 1e-6 && std::abs(arg[1] - v) < 1e-6; }

TEST_F(GltfFiles, TexturesAreKeptAsTheyAreAndMultiplied) {
  const Model model = Good(Textured(R"({"index":0})", "{}", kEmbedded, {0, 0, 2, 0, 0, 0.5}));
  ASSERT_EQ(model.pictures.size(), 1u);
  EXPECT_EQ(model.pictures[0].substr(1, 3), "PNG");
  const Part& part = model.parts[0];
  EXPECT_EQ(part.picture, 0u);
  EXPECT_EQ(part.colors[0], (Rgb{255, 0, 0}));
  EXPECT_THAT(part.texture_coordinates, ElementsAre(IsOn(0, 0), IsOn(2, 0), IsOn(0, 0.5)));
  EXPECT_THAT(model.left_out, IsEmpty());
  EXPECT_THAT(Good(Textured(R"({"index":0,"texCoord":1})", "{}", kEmbedded, {0, 0, 2, 0, 0, 2}))
                  .parts[0]
                  .texture_coordinates,
              ElementsAre(IsOn(0, 0), IsOn(1, 0), IsOn(0, 1)));
}

TEST_F(GltfFiles, TexturesAreMovedTurnedAndScaled) {
  const auto places = [&](const std::string& transform) {
    return Good(Textured(absl::StrCat(R"({"index":0,"extensions":{"KHR_texture_transform":)",
                                      transform, "}}"),
                         "{}", kEmbedded, {0, 0, 1, 0, 0, 1}))
        .parts[0]
        .texture_coordinates;
  };
  EXPECT_THAT(places(R"({"offset":[0.5,0.25],"scale":[2,3]})"),
              ElementsAre(IsOn(0.5, 0.25), IsOn(2.5, 0.25), IsOn(0.5, 3.25)));
  // Counter-clockwise by 90° where v increases downwards: right becomes up.
  EXPECT_THAT(places(R"({"rotation":1.5707963267948966})"),
              ElementsAre(IsOn(0, 0), IsOn(0, -1), IsOn(1, 0)));
  EXPECT_THAT(places(R"({"texCoord":1,"scale":[0.5,0.5]})"),
              ElementsAre(IsOn(0, 0), IsOn(0.5, 0), IsOn(0, 0.5)));
}

TEST_F(GltfFiles, PicturesThatDoNotRepeat) {
  const std::string clamp = R"({"wrapS":33071,"wrapT":33071})";
  const std::string mirror = R"({"wrapS":33648,"wrapT":33648})";
  const auto read = [&](const std::string& sampler, const std::vector<float>& uv) {
    return Good(Textured(R"({"index":0})", sampler, kEmbedded, uv));
  };
  const Model within = read(clamp, {0, 0, 1, 0, 0, 1});
  EXPECT_THAT(within.left_out, IsEmpty());
  EXPECT_THAT(within.parts[0].texture_coordinates, ElementsAre(IsOn(0, 0), IsOn(1, 0), IsOn(0, 1)));
  const Model beyond = read(clamp, {1.5, 0, 3, 0.5, 2, 1});
  EXPECT_THAT(beyond.left_out, IsEmpty());
  EXPECT_THAT(beyond.parts[0].texture_coordinates,
              ElementsAre(IsOn(1, 0), IsOn(1, 0.5), IsOn(1, 1)));
  EXPECT_THAT(
      read(clamp, {0, 0, 3, 0.5, 2, 1}).left_out,
      ElementsAre(LeftOut{"triangles across the edge of a picture that does not repeat", 1}));
  const Model mirrored = read(mirror, {1, 0, 2, 0.5, 1.25, 1});
  EXPECT_THAT(mirrored.left_out, IsEmpty());
  EXPECT_THAT(mirrored.parts[0].texture_coordinates,
              ElementsAre(IsOn(1, 0), IsOn(0, 0.5), IsOn(0.75, 1)));
}

TEST_F(GltfFiles, TexturesThatCannotBeShownAreCounted) {
  const std::vector<float> uv = {0, 0, 1, 0, 0, 1};
  const auto left_out = [&](const std::string& image) {
    const Model model = Good(Textured(R"({"index":0})", "{}", image, uv));
    EXPECT_THAT(model.pictures, IsEmpty());
    EXPECT_EQ(model.parts[0].colors[0], (Rgb{255, 0, 0}));
    return model.left_out;
  };
  EXPECT_THAT(left_out(R"({"uri":"missing.png"})"),
              ElementsAre(LeftOut{"textures that cannot be read", 1}));
  EXPECT_THAT(left_out(R"({"uri":"data:image/webp;base64,UklGRg=="})"),
              ElementsAre(LeftOut{"textures that are neither PNG nor JPEG", 1}));
  EXPECT_THAT(left_out(R"({"bufferView":99,"mimeType":"image/png"})"),
              ElementsAre(LeftOut{"textures that cannot be read", 1}));
  EXPECT_THAT(Read(Textured(R"({"index":3})", "{}", kEmbedded, uv)),
              Fails(Words{"baseColorTexture.index is 3", "there are 1"}));
  // In a file beside it, whose name has a blank.
  std::string png;
  ASSERT_TRUE(absl::Base64Unescape(kPng, &png));
  folder_.Write("a b.png", png);
  EXPECT_THAT(Good(Textured(R"({"index":0})", "{}", R"({"uri":"a%20b.png"})", uv)).pictures,
              ElementsAre(png));
}

// ----------------------------------------------------------------------------------------------- nodes

TEST_F(GltfFiles, NodesInDoublePrecision) {
  Gltf gltf;
  gltf.Add(kTriangle, "VEC3");
  // Survey coordinates: single precision would be half a unit off there.
  const Model model = Good(gltf.Text(
      absl::StrCat(R"("scenes":[{"nodes":[1]}],"nodes":[{"mesh":0,"scale":[0.01,0.01,0.01]},)",
                   R"({"children":[0],"translation":[4600000.25,0,0]}],)",
                   Mesh(R"("attributes":{"POSITION":0})"))));
  EXPECT_NEAR(model.parts[0].positions[1].x - model.parts[0].positions[0].x, 0.04, 1e-8);
}

TEST_F(GltfFiles, OtherScenesCamerasAndLightsAreCounted) {
  Gltf gltf;
  gltf.Add(kTriangle, "VEC3");
  const Model model = Good(gltf.Text(absl::StrCat(
      R"("scene":1,"scenes":[{"nodes":[0]},{"nodes":[1]},{"nodes":[2]}],"nodes":[{"mesh":0},)",
      R"({"mesh":0,"translation":[7,0,0],"camera":0,"extensions":{"KHR_lights_punctual":{"light":0}}},{}],)",
      R"("cameras":[{"type":"perspective","perspective":{"yfov":1,"znear":1}}],)",
      R"("extensions":{"KHR_lights_punctual":{"lights":[{"type":"point"},{"type":"point"}]},)",
      R"("ACME_smoke":{"puffs":[{"extensions":{"ACME_ring":{}}},{"extensions":{"ACME_ring":{}}}]}},)",
      Mesh(R"("attributes":{"POSITION":0})"))));
  ASSERT_EQ(model.parts.size(), 1u);
  EXPECT_THAT(model.parts[0].positions[0], IsAt(7, 0, 0));
  EXPECT_THAT(model.left_out,
              testing::UnorderedElementsAre(
                  LeftOut{"other scenes", 2}, LeftOut{"cameras", 1}, LeftOut{"lights", 2},
                  LeftOut{"ACME_smoke extensions", 1}, LeftOut{"ACME_ring extensions", 2}));
}

TEST_F(GltfFiles, InstancesAndHiddenNodes) {
  Gltf gltf;
  gltf.Add(kTriangle, "VEC3");
  gltf.Add(std::vector<float>{0, 0, 0, 10, 0, 0}, "VEC3");
  gltf.Add(std::vector<float>{1, 1, 1, -2, 2, 2}, "VEC3");
  const Model model = Good(gltf.Text(absl::StrCat(
      R"("scenes":[{"nodes":[0,1]}],"nodes":[{"mesh":0,"extensions":{"EXT_mesh_gpu_instancing":)",
      R"({"attributes":{"TRANSLATION":1,"SCALE":2}}}},)",
      R"({"mesh":0,"extensions":{"KHR_node_visibility":{"visible":false}}}],)",
      Mesh(R"("attributes":{"POSITION":0})"))));
  ASSERT_EQ(model.parts.size(), 1u);
  EXPECT_THAT(model.parts[0].positions, ElementsAre(IsAt(0, 0, 0), IsAt(4, 0, 0), IsAt(0, 1, 0),
                                                    IsAt(10, 0, 0), IsAt(2, 0, 0), IsAt(10, 2, 0)));
  EXPECT_THAT(model.parts[0].normals[5], IsAt(0, 0, 1)) << "not reversed by a mirror";
  EXPECT_THAT(model.left_out, ElementsAre(LeftOut{"hidden nodes", 1}));
}

TEST_F(GltfFiles, AttributesOfOneNumberAreKeptIfAsked) {
  Gltf gltf;
  gltf.Add(kTriangle, "VEC3");
  gltf.Add(std::vector<float>{20, 21.5, 23}, "SCALAR");
  const std::string path = folder_.Write(
      "a.gltf", gltf.Text(kOneNode + Mesh(R"("attributes":{"POSITION":0,"_HEAT":1})")));
  EXPECT_THAT(ReadHere(path, {})->parts[0].attributes, IsEmpty());
  const auto model = ReadHere(path, {.attributes = true});
  ASSERT_THAT(model, IsOk());
  ASSERT_EQ(model->parts[0].attributes.size(), 1u);
  EXPECT_EQ(model->parts[0].attributes[0].name, "_HEAT");
  EXPECT_THAT(model->parts[0].attributes[0].values, ElementsAre(20, 21.5, 23));
}

// -------------------------------------------------------------------------------- skins, shapes, motion

// A triangle on two joints: the first vertex on joint 0, the second on joint 1, the third half on
// each.
std::string Skinned(Gltf gltf, const std::string& bind, const std::string& more) {
  return gltf.Text(absl::StrCat(
      R"("scenes":[{"nodes":[0,1,2]}],"nodes":[{"mesh":0,"skin":0,"translation":[100,0,0]},)",
      R"({"translation":[0,0,1]},{"translation":[0,0,3],"scale":[2,2,2]}],)",
      Mesh(R"("attributes":{"POSITION":0,"JOINTS_0":1,"WEIGHTS_0":2})"),
      R"(,"skins":[{"joints":[1,2])", bind, "}]", more));
}

Gltf OnJoints(const std::vector<uint8_t>& joints) {
  Gltf gltf;
  gltf.Add(kTriangle, "VEC3");
  gltf.Add(joints, "VEC4");
  gltf.Add(std::vector<float>{1, 0, 0, 0, 1, 0, 0, 0, .5f, .5f, 0, 0}, "VEC4");
  return gltf;
}

TEST_F(GltfFiles, SkinsAtRest) {
  Gltf gltf = OnJoints({0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0});
  // The node's own place is ignored. Without matrices, they are the identity.
  EXPECT_THAT(Good(Skinned(gltf, "", "")).parts[0].positions,
              ElementsAre(IsAt(0, 0, 1), IsAt(8, 0, 3), IsAt(0, 1.5, 2)));
  // With matrices (columns) that move joint 1 back by (0, 0, 3) before its scale.
  gltf.Add(std::vector<float>{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0,  1,
                              1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, -3, 1},
           "MAT4");
  EXPECT_THAT(Good(Skinned(gltf, R"(,"inverseBindMatrices":3)", "")).parts[0].positions,
              ElementsAre(IsAt(0, 0, 1), IsAt(8, 0, -3), IsAt(0, 1.5, -1)));
  EXPECT_THAT(Read(Skinned(gltf, R"(,"inverseBindMatrices":0)", "")),
              Fails(Words{"inverseBindMatrices has 3 elements of 3", "MAT4"}));
  EXPECT_THAT(Read(Skinned(OnJoints({0, 0, 0, 0, 7, 0, 0, 0, 0, 1, 0, 0}), "", "")),
              Fails(Words{"joint 7", "2 joints"}));
}

std::string Morphed(const std::string& mesh_weights, const std::string& node_weights) {
  Gltf gltf;
  gltf.Add(kTriangle, "VEC3");
  gltf.Add(std::vector<float>{0, 0, 0, 4, 0, 0, 0, 0, 0}, "VEC3");
  const int at = gltf.View(std::vector<uint8_t>{2});
  const int with = gltf.View(std::vector<float>{0, 0, 6});
  gltf.Accessor(
      absl::StrCat(R"({"componentType":5126,"type":"VEC3","count":3,"sparse":{"count":1,)",
                   R"("indices":{"bufferView":)", at,
                   R"(,"componentType":5121},"values":{"bufferView":)", with, "}}}"));
  return gltf.Text(absl::StrCat(
      R"("scenes":[{"nodes":[0]}],"nodes":[{"mesh":0)", node_weights,
      R"(}],"meshes":[{"primitives":[{"attributes":{"POSITION":0},"targets":[{"POSITION":1},{"POSITION":2}]}])",
      mesh_weights, "}]"));
}

TEST_F(GltfFiles, ShapesAtRest) {
  const auto positions = [&](const std::string& mesh, const std::string& node) {
    return Good(Morphed(mesh, node)).parts[0].positions;
  };
  EXPECT_THAT(positions("", ""), ElementsAre(IsAt(0, 0, 0), IsAt(4, 0, 0), IsAt(0, 1, 0)));
  EXPECT_THAT(positions(R"(,"weights":[0.5,1])", ""),
              ElementsAre(IsAt(0, 0, 0), IsAt(6, 0, 0), IsAt(0, 1, 6)));
  EXPECT_THAT(positions(R"(,"weights":[0.5,1])", R"(,"weights":[0,0.5])"),
              ElementsAre(IsAt(0, 0, 0), IsAt(4, 0, 0), IsAt(0, 1, 3)));
}

// Animations, by the positions of the only triangle's first vertex in each quarter of a second.
class GltfMotion : public GltfFiles {
 protected:
  std::vector<Point3> Moves(const std::vector<float>& times, const std::vector<float>& values,
                            const std::string& type, const std::string& path,
                            const std::string& interpolation) {
    Gltf gltf;
    gltf.Add(std::vector<float>{1, 0, 0, 4, 0, 0, 0, 1, 0}, "VEC3");
    gltf.Add(times, "SCALAR");
    gltf.Add(values, type);
    const std::string text = gltf.Text(absl::StrCat(
        kOneNode, Mesh(R"("attributes":{"POSITION":0})"),
        R"(,"animations":[{"name":"go","samplers":[{"input":1,"output":2,"interpolation":")",
        interpolation, R"("}],"channels":[{"sampler":0,"target":{"node":0,"path":")", path,
        R"("}},{"sampler":0,"target":{"path":"pointer","extensions":{"KHR_animation_pointer":{"pointer":"/x"}}}}]}])"));
    std::vector<Point3> moves;
    const auto file = ReadSourceFile(folder_.Write("a.gltf", text));
    EXPECT_THAT(file, IsOk());
    const auto frames = OpenGltfAnimation(*file, 1, 4);
    EXPECT_THAT(frames, IsOk());
    if (!frames.ok()) return {};
    for (int64_t frame = 0; frame < (*frames)->count(); ++frame) {
      const auto model = (*frames)->Read(frame);
      EXPECT_THAT(model, IsOk());
      if (!model.ok()) break;
      EXPECT_THAT(model->left_out,
                  ElementsAre(LeftOut{"animation channels of other properties", 1}));
      moves.push_back(model->parts[0].positions[0]);
    }
    return moves;
  }
};

TEST_F(GltfMotion, EveryInterpolation) {
  EXPECT_THAT(Moves({0, 1}, {0, 0, 0, 8, 0, 0}, "VEC3", "translation", "LINEAR"),
              ElementsAre(IsAt(1, 0, 0), IsAt(3, 0, 0), IsAt(5, 0, 0), IsAt(7, 0, 0)));
  EXPECT_THAT(Moves({0, 0.5, 1}, {0, 0, 0, 8, 0, 0, 9, 0, 0}, "VEC3", "translation", "STEP"),
              ElementsAre(IsAt(1, 0, 0), IsAt(1, 0, 0), IsAt(9, 0, 0), IsAt(9, 0, 0)));
  // From 0 to 8 with flat tangents: 8 (3t² − 2t³) is 1.25, 4, 6.75.
  EXPECT_THAT(Moves({0, 1}, {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 8, 0, 0, 0, 0, 0}, "VEC3",
                    "translation", "CUBICSPLINE"),
              ElementsAre(IsAt(1, 0, 0), IsAt(2.25, 0, 0), IsAt(5, 0, 0), IsAt(7.75, 0, 0)));
  // Half a turn about z in two seconds: quarters of a quarter turn each frame.
  const double r = std::sqrt(0.5);
  EXPECT_THAT(Moves({0, 2}, {0, 0, 0, 1, 0, 0, 1, 0}, "VEC4", "rotation", "LINEAR")[4],
              IsAt(0, 1, 0));
  EXPECT_THAT(Moves({0, 2}, {0, 0, 0, 1, 0, 0, 1, 0}, "VEC4", "rotation", "LINEAR")[2],
              IsAt(r, r, 0));
  EXPECT_THAT(Moves({0, 1}, {1, 1, 1, 3, 1, 1}, "VEC3", "scale", "LINEAR"),
              ElementsAre(IsAt(1, 0, 0), IsAt(1.5, 0, 0), IsAt(2, 0, 0), IsAt(2.5, 0, 0)));
}

TEST_F(GltfMotion, BeforeTheFirstKeyAndAlongTheShorterArc) {
  EXPECT_THAT(Moves({0.5, 1}, {6, 0, 0, 8, 0, 0}, "VEC3", "translation", "LINEAR"),
              ElementsAre(IsAt(7, 0, 0), IsAt(7, 0, 0), IsAt(7, 0, 0), IsAt(8, 0, 0)));
  // The end is the beginning with the opposite sign: nothing rotates.
  EXPECT_THAT(Moves({0, 1}, {0, 0, 0, 1, 0, 0, 0, -1}, "VEC4", "rotation", "LINEAR")[2],
              IsAt(1, 0, 0));
}

TEST_F(GltfFiles, WeightsMove) {
  Gltf gltf;
  gltf.Add(kTriangle, "VEC3");
  gltf.Add(std::vector<float>{4, 0, 0, 0, 0, 0, 0, 0, 0}, "VEC3");
  gltf.Add(std::vector<float>{0, 1}, "SCALAR");
  gltf.Add(std::vector<float>{0, 1}, "SCALAR");
  const std::string text = gltf.Text(absl::StrCat(
      kOneNode,
      R"("meshes":[{"primitives":[{"attributes":{"POSITION":0},"targets":[{"POSITION":1}]}]}],)",
      R"("animations":[{"samplers":[{"input":2,"output":3}],"channels":[{"sampler":0,"target":{"node":0,"path":"weights"}}]}])"));
  const auto file = ReadSourceFile(folder_.Write("a.gltf", text));
  const auto frames = OpenGltfAnimation(*file, 1, 2);
  ASSERT_THAT(frames, IsOk());
  EXPECT_EQ((*frames)->count(), 2);
  EXPECT_THAT((*frames)->Read(1)->parts[0].positions[0], IsAt(2, 0, 0));
  EXPECT_THAT(Good(text).left_out, ElementsAre(LeftOut{"animations", 1}));
  EXPECT_THAT(OpenGltfAnimation(*file, 2, 2), Fails(Words{"no animation 2", "it has 1"}));
}

TEST_F(GltfFiles, AByteOrderMarkIsRefusedInWords) {
  Gltf gltf;
  gltf.Add(kTriangle, "VEC3");
  EXPECT_THAT(Read("\xef\xbb\xbf" + gltf.Text(kOneNode + Mesh(R"("attributes":{"POSITION":0})"))),
              Fails(Words{"byte order mark", "without one"}));
}

TEST_F(GltfFiles, BinaryIsTheSame) {
  Gltf gltf;
  gltf.Add(kTriangle, "VEC3");
  const Model model = Good(gltf.Glb(kOneNode + Mesh(R"("attributes":{"POSITION":0})")), "a.glb");
  EXPECT_EQ(model.format, "glTF binary");
  EXPECT_THAT(model.parts[0].positions, ElementsAre(IsAt(0, 0, 0), IsAt(4, 0, 0), IsAt(0, 1, 0)));
}

TEST_F(GltfFiles, DamagedReferencesAreRefused) {
  struct Bad {
    std::string members;
    Words words;
  };
  Gltf gltf;
  gltf.Add(kTriangle, "VEC3");
  gltf.Add(std::vector<float>{1, 2}, "SCALAR");
  const std::string mesh = Mesh(R"("attributes":{"POSITION":0})");
  for (const Bad& bad : std::vector<Bad>{
           {R"("nodes":[{"mesh":4}],)" + mesh, {"nodes[0].mesh is 4"}},
           {R"("nodes":[{"mesh":0,"skin":0}],)" + mesh, {"nodes[0].skin is 0", "there are 0"}},
           {R"("nodes":[{"mesh":0,"translation":[1,2]}],)" + mesh, {"translation has 2 numbers"}},
           {R"("scene":3,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],)" + mesh, {"scene is 3"}},
           {R"("scenes":[{"nodes":[8]}],"nodes":[{"mesh":0}],)" + mesh, {"node of the scene is 8"}},
           {kOneNode + Mesh(R"("attributes":{"POSITION":0,"NORMAL":1})"),
            {"NORMAL has 2 elements", "3 positions"}},
           {kOneNode + Mesh(R"("attributes":{"POSITION":1})"), {"POSITION has 1 components"}},
           {kOneNode + Mesh(R"("attributes":{"POSITION":0},"indices":1)"),
            {"indices are not whole numbers"}},
           {kOneNode + Mesh(R"("attributes":{"POSITION":0},"material":0)"), {"material is 0"}},
           {R"("nodes":[{"mesh":0,"rotation":"x"}],)" + mesh, {"nodes[0].rotation is \"x\""}},
           {R"("nodes":[{"mesh":0,"scale":[1,null,1]}],)" + mesh, {"nodes[0].scale is [1,null,1]"}},
           {R"("nodes":[{"mesh":0.5}],)" + mesh, {"nodes[0].mesh is 0.5"}},
           {R"("nodes":[{}],)" + mesh, {"shows no mesh"}},
           {R"("nodes":[{}],"meshes":[])", {"holds no mesh"}}})
    EXPECT_THAT(Read(gltf.Text(bad.members)), Fails(bad.words)) << bad.members;
}

// Every member of a file that uses everything known to this reader is damaged in turn: the file is
// read, or refused with a message that names it.
TEST_F(GltfFiles, DamageAnywhereEndsWell) {
  Gltf gltf = OnJoints({0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0});
  gltf.Add(std::vector<float>{0, 0, 1, 0, 0, 1}, "VEC2");
  gltf.Add(std::vector<float>{0, 1}, "SCALAR");
  gltf.Add(std::vector<float>{0, 0, 0, 5, 5, 5}, "VEC3");
  const std::string members = absl::StrCat(
      R"("scene":0,"scenes":[{"nodes":[0,1,2]},{}],"nodes":[{"mesh":0,"skin":0,"weights":[0.5]},)",
      R"({"rotation":[0,0,0,1]},{"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1],"extensions":)",
      R"({"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":5}}},"mesh":0}],"meshes":[{"primitives":)",
      R"([{"mode":5,"attributes":{"POSITION":0,"JOINTS_0":1,"WEIGHTS_0":2,"TEXCOORD_0":3,"COLOR_0":2},)",
      R"("material":0,"targets":[{"POSITION":0}]}],"weights":[1]}],"materials":[{"emissiveFactor":[0,1,0],)",
      R"("pbrMetallicRoughness":{"baseColorTexture":{"index":0,"extensions":{"KHR_texture_transform":)",
      R"({"rotation":1}}}}}],"textures":[{"source":0,"sampler":0}],"samplers":[{"wrapS":33071}],"images":[)",
      kEmbedded,
      R"(],"skins":[{"joints":[1,2]}],"animations":[{"samplers":[{"input":4,"output":5}],)",
      R"("channels":[{"sampler":0,"target":{"node":0,"path":"translation"}}]}])");
  std::mt19937 random(31);
  size_t good = 0;
  for (const bool binary : {false, true}) {
    const std::string whole = binary ? gltf.Glb(members) : gltf.Text(members);
    const std::string name = binary ? "a.glb" : "a.gltf";
    ASSERT_THAT(Read(whole, name), IsOk());
    static constexpr char kBytes[] = "0123456789-.,:[]{}\"eE \xff";
    for (int i = 0; i < 500; ++i) {
      std::string bytes = whole;
      for (uint32_t k = 1 + random() % 3; k > 0; --k)
        bytes[random() % bytes.size()] = random() % 4 == 0
                                             ? static_cast<char>(random())
                                             : kBytes[random() % (sizeof(kBytes) - 1)];
      if (i % 8 == 0) bytes.resize(1 + random() % bytes.size());
      const std::string path = folder_.Write(name, bytes);
      const absl::StatusOr<Model> model = ReadHere(path, {});
      good += model.ok() ? 1 : 0;
      if (!model.ok()) {
        EXPECT_THAT(std::string(model.status().message()), testing::StartsWith(path));
      }
      const auto file = ReadSourceFile(path);
      const auto frames = OpenGltfAnimation(*file, 1, 2);
      if (frames.ok()) (void)(*frames)->Read(0);
    }
  }
  EXPECT_GT(good, 50u) << "the damage should not only hit the JSON's form";
}

}  // namespace gltf_test
}  // namespace voxeld::voxelctl
