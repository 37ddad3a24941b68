// Tests PLY with surfaces: every way to write faces, colors and normals, and every way in which
// they may be broken.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "tests/tools/voxelctl/read_here.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/import/importer.h"

namespace voxeld::voxelctl {
namespace {

absl::StatusOr<Model> Ply(const std::string& bytes) {
  TempFolder folder;
  return ReadHere(folder.Write("a.ply", bytes), {});
}

std::string AsciiPly(const std::string& elements, const std::string& body) {
  return absl::StrCat("ply\nformat ascii 1.0\n", elements, "end_header\n", body);
}

std::string VertexElement(int count) {
  return absl::StrCat("element vertex ", count,
                      "\nproperty float x\nproperty float y\nproperty float z\n");
}

constexpr const char* kFace = "element face 1\nproperty list uchar int vertex_indices\n";
constexpr const char* kSquare = "0 0 0\n4 0 0\n4 0 1\n0 0 1\n";

// Returns twice the area of all triangles.
double AreaOf(const Part& part) {
  double area = 0;
  for (size_t i = 0; i + 2 < part.indices.size(); i += 3) {
    const Point3 &a = part.positions[part.indices[i]], &b = part.positions[part.indices[i + 1]],
                 &c = part.positions[part.indices[i + 2]];
    const Point3 u = {b.x - a.x, b.y - a.y, b.z - a.z}, v = {c.x - a.x, c.y - a.y, c.z - a.z};
    area += std::hypot(u.y * v.z - u.z * v.y, u.z * v.x - u.x * v.z, u.x * v.y - u.y * v.x);
  }
  return area;
}

void ExpectSquare(const absl::StatusOr<Model>& model) {
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->format, "PLY mesh");
  EXPECT_EQ(model->up, Up::kZ);
  EXPECT_FALSE(model->lit_already);
  ASSERT_EQ(model->parts.size(), 1u);
  const Part& part = model->parts[0];
  EXPECT_EQ(part.kind, Kind::kTriangles);
  EXPECT_EQ(part.indices.size(), 6u);
  EXPECT_EQ(part.positions.size(), 4u);
  EXPECT_NEAR(AreaOf(part), 8, 1e-9);
  for (const Point3& normal : part.normals) EXPECT_NEAR(std::abs(normal.y), 1, 1e-6);
}

TEST(PlyMesh, AQuadIsTwoTriangles) {
  ExpectSquare(Ply(AsciiPly(VertexElement(4) + kFace, absl::StrCat(kSquare, "4 0 1 2 3\n"))));
}

TEST(PlyMesh, FacesMayComeBeforeVertices) {
  ExpectSquare(Ply(AsciiPly(kFace + VertexElement(4), absl::StrCat("4 0 1 2 3\n", kSquare))));
}

TEST(PlyMesh, OtherElementsAndPicturesAreCounted) {
  const auto model = Ply(AsciiPly(
      absl::StrCat("comment TextureFile a.png\ncomment TextureFile\ncomment made by hand\n",
                   "element camera 1\nproperty float f\nproperty list uchar int l\n",
                   VertexElement(4), "element edge 2\nproperty int vertex1\nproperty int vertex2\n",
                   kFace, "element material 1\nproperty uchar m\nelement none 0\n"),
      absl::StrCat("0.5 3 7 8 9\n", kSquare, "0 1\n1 2\n4 0 1 2 3\n9\n")));
  ExpectSquare(model);
  EXPECT_EQ(model->left_out,
            (std::vector<LeftOut>{{"entries of other elements", 4}, {"pictures", 1}}));
}

TEST(PlyMesh, OtherPropertiesOfFacesAreCounted) {
  const auto model = Ply(AsciiPly(
      VertexElement(4) +
          "element face 1\nproperty uchar flags\nproperty list uchar int vertex_index\nproperty "
          "list uchar float texcoord\n",
      absl::StrCat(kSquare, "1 4 0 1 2 3 2 0.5 0.5\n")));
  ExpectSquare(model);
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"other properties of faces", 2}}));
}

TEST(PlyMesh, StripsOfTrianglesKeepTheirWinding) {
  const absl::StatusOr<Model> model =
      Ply(AsciiPly(VertexElement(6) + "element tristrips 1\nproperty list int int vertex_indices\n",
                   "0 0 0\n4 0 0\n0 0 1\n4 0 1\n0 0 9\n9 0 9\n8 0 1 2 3 -1 2 3 4\n"));
  ASSERT_THAT(model, IsOk());
  const Part& part = model->parts[0];
  ASSERT_EQ(part.indices.size(), 9u);
  for (size_t i = 0; i < 6; ++i) EXPECT_EQ(part.normals[part.indices[i]], (Point3{0, -1, 0}));
}

TEST(PlyMesh, LinesMayEndByEitherMarkOrBoth) {
  const std::string text = AsciiPly(VertexElement(4) + kFace, absl::StrCat(kSquare, "4 0 1 2 3\n"));
  for (const char* end : {"\n", "\r\n", "\r"})
    ExpectSquare(Ply(absl::StrReplaceAll(text, {{"\n", end}})));
  // Binary data may begin with a byte that is either line end.
  for (const char* end : {"\n", "\r\n", "\r"}) {
    for (const char first : {'\n', '\r'}) {
      std::string data(12, '\0');
      data[0] = first;
      const std::string head =
          absl::StrCat("ply\nformat binary_little_endian 1.0\n", VertexElement(1), "end_header\n");
      const absl::StatusOr<Model> model = Ply(absl::StrReplaceAll(head, {{"\n", end}}) + data);
      ASSERT_THAT(model, IsOk()) << static_cast<int>(first);
      EXPECT_EQ(model->parts[0].positions.size(), 1u);
    }
  }
}

TEST(PlyMesh, ACloudMayDeclareFacesThatAreNotThere) {
  const absl::StatusOr<Model> model = Ply(AsciiPly(
      VertexElement(4) + "element face 0\nproperty list uchar int vertex_indices\n", kSquare));
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->format, "PLY points");
  EXPECT_EQ(model->parts[0].positions.size(), 4u);
}

struct Binary {
  const char* name;
  bool big = false;
  const char* count_type = "uchar";
  const char* index_type = "int";
};

class PlyMeshBinary : public testing::TestWithParam<Binary> {};

template <typename T>
std::string Swapped(T value, bool big) {
  char bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  if (big) std::reverse(bytes, bytes + sizeof value);
  return {bytes, sizeof value};
}

std::string OfType(const std::string& type, int value, bool big) {
  if (type == "char" || type == "uchar") return Swapped<int8_t>(static_cast<int8_t>(value), big);
  if (type == "short" || type == "ushort")
    return Swapped<int16_t>(static_cast<int16_t>(value), big);
  return Swapped<int32_t>(value, big);
}

TEST_P(PlyMeshBinary, IsRead) {
  const auto& [name, big, count_type, index_type] = GetParam();
  std::string bytes = absl::StrCat(
      "ply\nformat ", big ? "binary_big_endian" : "binary_little_endian",
      " 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\nproperty "
      "uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\nelement edge "
      "1\nproperty int vertex1\nproperty int vertex2\nelement face 1\nproperty list ",
      count_type, " ", index_type, " vertex_index\nend_header\n");
  int at = 0;
  for (const double value : {0., 4., 4., 0.}) {
    bytes += Swapped(value, big) + Swapped(0.0, big) + Swapped(at++ < 2 ? 0.0 : 1.0, big) +
             std::string("\xff\0\0\xff", 4);
  }
  bytes += Swapped<int32_t>(0, big) + Swapped<int32_t>(1, big);
  bytes += OfType(count_type, 4, big);
  for (const int index : {0, 1, 2, 3}) bytes += OfType(index_type, index, big);
  const absl::StatusOr<Model> model = Ply(bytes);
  ExpectSquare(model);
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->parts[0].colors, std::vector<Rgb>(4, Rgb{255, 0, 0}));
}

INSTANTIATE_TEST_SUITE_P(Types, PlyMeshBinary,
                         testing::Values(Binary{"little"}, Binary{"big", true},
                                         Binary{"chars", true, "char", "char"},
                                         Binary{"uchars", false, "uchar", "uchar"},
                                         Binary{"shorts", true, "short", "short"},
                                         Binary{"ushorts", false, "ushort", "ushort"},
                                         Binary{"ints", true, "int", "int"},
                                         Binary{"uints", false, "uint", "uint"}),
                         [](const auto& info) { return info.param.name; });

// Faces with colors as floats before vertices, and a strip after both.
TEST_P(PlyMeshBinary, IsReadInAnyOrderOfElements) {
  const auto& [name, big, count_type, index_type] = GetParam();
  std::string bytes = absl::StrCat(
      "ply\nformat ", big ? "binary_big_endian" : "binary_little_endian",
      " 1.0\nelement face 1\nproperty float red\nproperty float green\nproperty float blue\n",
      "property list ", count_type, " ", index_type,
      " vertex_indices\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n",
      "element tristrips 1\nproperty list int ", index_type, " vertex_indices\nend_header\n");
  for (const float channel : {1.f, 0.5f, 0.f}) bytes += Swapped(channel, big);
  bytes += OfType(count_type, 3, big);
  for (const int index : {0, 1, 2}) bytes += OfType(index_type, index, big);
  for (const float value : {0.f, 0.f, 0.f, 4.f, 0.f, 0.f, 0.f, 0.f, 1.f, 4.f, 0.f, 1.f})
    bytes += Swapped(value, big);
  const bool restarts = index_type != std::string("uchar") && index_type != std::string("ushort");
  bytes += Swapped<int32_t>(restarts ? 7 : 3, big);
  // −1 begins a strip; as an unsigned number it has the same bits.
  for (const int index : {0, 1, 2}) bytes += OfType(index_type, index, big);
  for (const int index : {-1, 1, 3, 2}) bytes += restarts ? OfType(index_type, index, big) : "";
  const absl::StatusOr<Model> model = Ply(bytes);
  ASSERT_THAT(model, IsOk());
  ASSERT_EQ(model->parts.size(), 2u);
  EXPECT_EQ(model->parts[0].colors, std::vector<Rgb>(3, Rgb{255, 128, 0}));
  EXPECT_NEAR(AreaOf(model->parts[0]), 4, 1e-9);
  EXPECT_NEAR(AreaOf(model->parts[1]), restarts ? 8 : 4, 1e-9);
}

TEST(PlyMesh, AFacesColorGoesBeforeItsVertices) {
  const absl::StatusOr<Model> model = Ply(AsciiPly(
      VertexElement(4) + "property uchar red\nproperty uchar green\nproperty uchar blue\n" +
          "element face 2\nproperty list uchar int vertex_indices\nproperty uchar red\nproperty "
          "uchar green\nproperty uchar blue\n",
      "0 0 0 1 1 1\n4 0 0 1 1 1\n4 0 1 1 1 1\n0 0 1 1 1 1\n3 0 1 2 255 0 0\n3 0 2 3 0 0 255\n"));
  ASSERT_THAT(model, IsOk());
  const Part& part = model->parts[0];
  ASSERT_EQ(part.indices.size(), 6u);
  EXPECT_EQ(part.positions.size(), 6u) << "corners of two colors are two vertices";
  for (size_t i = 0; i < 6; ++i)
    EXPECT_EQ(part.colors[part.indices[i]], i < 3 ? (Rgb{255, 0, 0}) : (Rgb{0, 0, 255}));
  EXPECT_EQ(model->left_out,
            (std::vector<LeftOut>{{"colours of vertices whose faces have others", 4}}));
}

TEST(PlyMesh, VerticesMayHaveTheColorsOfTheirFaces) {
  const std::string colors = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  const absl::StatusOr<Model> model =
      Ply(AsciiPly(VertexElement(4) + colors + kFace + colors,
                   "0 0 0 9 8 7\n4 0 0 9 8 7\n4 0 1 9 8 7\n0 0 1 9 8 6\n4 0 1 2 3 9 8 7\n"));
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->left_out,
            (std::vector<LeftOut>{{"colours of vertices whose faces have others", 1}}));
}

TEST(PlyMesh, ColorsThatAreNotFiniteAreWhiteAndCounted) {
  const std::string colors = "property float red\nproperty float green\nproperty float blue\n";
  const std::vector<LeftOut> one = {
      {"colours and intensities that are not a number (shown white)", 1}};
  const absl::StatusOr<Model> of_vertices = Ply(AsciiPly(
      VertexElement(3) + colors + kFace, "0 0 0 nan 0 0\n4 0 0 1 0 0\n4 0 1 0 0 1\n3 0 1 2\n"));
  ASSERT_THAT(of_vertices, IsOk());
  EXPECT_EQ(of_vertices->parts[0].colors,
            (std::vector<Rgb>{{255, 255, 255}, {255, 0, 0}, {0, 0, 255}}));
  EXPECT_EQ(of_vertices->left_out, one);
  const absl::StatusOr<Model> of_faces = Ply(AsciiPly(
      VertexElement(4) + "element face 2\nproperty list uchar int vertex_indices\n" + colors,
      absl::StrCat(kSquare, "3 0 1 2 0 inf 0\n3 0 2 3 0 1 0\n")));
  ASSERT_THAT(of_faces, IsOk());
  EXPECT_EQ(of_faces->parts[0].colors[0], (Rgb{255, 255, 255}));
  EXPECT_EQ(of_faces->left_out, one);
}

TEST(PlyMesh, IntensitiesOfVerticesAreOtherProperties) {
  const absl::StatusOr<Model> model =
      Ply(AsciiPly(VertexElement(4) + "property float intensity\n" + kFace,
                   "0 0 0 1\n4 0 0 2\n4 0 1 3\n0 0 1 4\n4 0 1 2 3\n"));
  ExpectSquare(model);
  EXPECT_TRUE(model->parts.at(0).colors.empty());
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"other properties of vertices", 1}}));
}

TEST(PlyMesh, FloatColorsOfFacesGoTo1OrTo255) {
  const auto color = [](const std::string& numbers) -> absl::StatusOr<Rgb> {
    absl::StatusOr<Model> model =
        Ply(AsciiPly(VertexElement(4) + kFace +
                         "property float red\nproperty float green\nproperty float blue\n",
                     absl::StrCat(kSquare, "4 0 1 2 3 ", numbers, "\n")));
    if (!model.ok()) return model.status();
    return model->parts[0].colors.at(0);
  };
  EXPECT_EQ(*color("1 0.5 0"), (Rgb{255, 128, 0}));
  EXPECT_EQ(*color("255 64 0"), (Rgb{255, 64, 0}));
}

TEST(PlyMesh, WholeColorsOfFacesGoTo255WhereNoneIsGreater) {
  const absl::StatusOr<Model> model = Ply(AsciiPly(
      VertexElement(4) + "element face 2\nproperty list uchar int vertex_indices\nproperty ushort "
                         "red\nproperty ushort green\nproperty ushort blue\n",
      absl::StrCat(kSquare, "3 0 1 2 255 64 0\n3 0 2 3 0 0 200\n")));
  ASSERT_THAT(model, IsOk());
  const Part& part = model->parts[0];
  EXPECT_EQ(part.colors[part.indices[0]], (Rgb{255, 64, 0}));
  EXPECT_EQ(part.colors[part.indices[5]], (Rgb{0, 0, 200}));
}

TEST(PlyMesh, NormalsOfTheFileAreTaken) {
  const absl::StatusOr<Model> model = Ply(AsciiPly(
      VertexElement(3) + "property float nx\nproperty float ny\nproperty float nz\n" + kFace,
      "0 0 0 0 0 2\n1 0 0 0 0 2\n0 1 0 3 0 0\n3 0 1 2\n"));
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->parts[0].normals, (std::vector<Point3>{{0, 0, 1}, {0, 0, 1}, {1, 0, 0}}));
}

// Two squares along the x axis that meet at an angle.
absl::StatusOr<Model> Fold(double degrees) {
  const double a = degrees * M_PI / 180;
  return Ply(
      AsciiPly(VertexElement(6) + "element face 2\nproperty list uchar int vertex_indices\n",
               absl::StrCat("0 -1 0\n1 -1 0\n1 0 0\n0 0 0\n1 ", std::cos(a), " ", std::sin(a),
                            "\n0 ", std::cos(a), " ", std::sin(a), "\n4 0 1 2 3\n4 3 2 4 5\n")));
}

TEST(PlyMesh, SharpEdgesStayEdgesAndOthersAreSmooth) {
  const absl::StatusOr<Model> smooth = Fold(40), sharp = Fold(60);
  ASSERT_THAT(smooth, IsOk());
  ASSERT_THAT(sharp, IsOk());
  EXPECT_EQ(smooth->parts[0].positions.size(), 6u);
  EXPECT_EQ(sharp->parts[0].positions.size(), 8u) << "two normals at each end of the edge";
}

// The L that remains of a square of 3 without its upper right square of 2.
TEST(PlyMesh, AConcavePolygonIsFilledWithinItsOutline) {
  for (int begin = 0; begin < 6; ++begin) {
    std::string face = "6";
    for (int i = 0; i < 6; ++i) absl::StrAppend(&face, " ", (begin + i) % 6);
    const absl::StatusOr<Model> model = Ply(AsciiPly(
        VertexElement(6) + kFace, "0 0 0\n3 0 0\n3 0 1\n1 0 1\n1 0 3\n0 0 3\n" + face + "\n"));
    ASSERT_THAT(model, IsOk());
    EXPECT_EQ(model->parts[0].indices.size(), 12u);
    EXPECT_NEAR(AreaOf(model->parts[0]), 10, 1e-9) << "from corner " << begin;
    for (const Point3& normal : model->parts[0].normals)
      EXPECT_NEAR(normal.y, -1, 1e-6) << "the winding is kept";
  }
}

TEST(PlyMesh, FacesOfFewerThanThreeVerticesAreCounted) {
  const absl::StatusOr<Model> faces =
      Ply(AsciiPly(VertexElement(6) + "element face 4\nproperty list uchar int vertex_indices\n",
                   absl::StrCat(kSquare, "9 9 9\n8 8 8\n0\n1 2\n2 4 5\n4 0 1 2 3\n")));
  ExpectSquare(faces);
  EXPECT_EQ(faces->left_out, (std::vector<LeftOut>{{"faces of fewer than three vertices", 3}}));
  // A piece of two in a strip, and an end behind which nothing follows.
  const absl::StatusOr<Model> strip = Ply(
      AsciiPly(VertexElement(4) + "element tristrips 1\nproperty list uchar int vertex_indices\n",
               absl::StrCat(kSquare, "9 0 1 -1 1 0 2 3 -1 -1\n")));
  ExpectSquare(strip);
  EXPECT_EQ(strip->left_out, (std::vector<LeftOut>{{"faces of fewer than three vertices", 1}}));
}

TEST(PlyMesh, AVertexThatNoFaceHasMayBeNowhereAndIsCounted) {
  const absl::StatusOr<Model> model = Ply(
      AsciiPly(VertexElement(6) + kFace, absl::StrCat(kSquare, "nan nan nan\n7 7 7\n4 0 1 2 3\n")));
  ExpectSquare(model);
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"vertices that no face has", 2}}));
}

struct BadPlyMesh {
  const char* name;
  std::string bytes;
  Words words;
};

class BrokenPlyMesh : public testing::TestWithParam<BadPlyMesh> {};

TEST_P(BrokenPlyMesh, IsRefusedWithWords) {
  EXPECT_THAT(Ply(GetParam().bytes), Fails(GetParam().words));
}

INSTANTIATE_TEST_SUITE_P(
    Table, BrokenPlyMesh,
    testing::Values(
        BadPlyMesh{"index",
                   AsciiPly(VertexElement(4) + kFace, absl::StrCat(kSquare, "3 0 1 77\n")),
                   {"face 0 of 1", "vertex 77", "the file has 4"}},
        BadPlyMesh{"index_negative",
                   AsciiPly(VertexElement(4) + kFace, absl::StrCat(kSquare, "3 0 1 -1\n")),
                   {"face 0 of 1", "vertex -1"}},
        BadPlyMesh{"index_broken",
                   AsciiPly(VertexElement(4) + kFace, absl::StrCat(kSquare, "3 0 1 1.5\n")),
                   {"face 0 of 1", "vertex 1.5"}},
        BadPlyMesh{"index_nan",
                   AsciiPly(VertexElement(4) + kFace, absl::StrCat(kSquare, "3 0 1 nan\n")),
                   {"face 0 of 1", "vertex nan"}},
        BadPlyMesh{"count_negative",
                   AsciiPly(VertexElement(4) + kFace, absl::StrCat(kSquare, "-3 0 1 2\n")),
                   {"face 0 of 1", "list of -3 entries"}},
        BadPlyMesh{"count_nan",
                   AsciiPly(VertexElement(4) + kFace, absl::StrCat(kSquare, "nan 0 1 2\n")),
                   {"face 0 of 1", "list of nan entries"}},
        BadPlyMesh{"count_absurd",
                   AsciiPly(VertexElement(4) + kFace, absl::StrCat(kSquare, "1e30 0 1 2\n")),
                   {"face 0 of 1", "list of 1e+30 entries"}},
        BadPlyMesh{"cut",
                   AsciiPly(VertexElement(4) + kFace, absl::StrCat(kSquare, "4 0 1 2\n")),
                   {"face 0 of 1", "cut off"}},
        BadPlyMesh{"no_list",
                   AsciiPly(VertexElement(4) + "element face 1\nproperty uchar flags\n",
                            absl::StrCat(kSquare, "1\n")),
                   {"\"face\" has no list of vertices", "vertex_indices"}},
        BadPlyMesh{"no_triangle",
                   AsciiPly(VertexElement(4) + kFace, absl::StrCat(kSquare, "2 0 1\n")),
                   {"no triangle"}},
        BadPlyMesh{"vertex_nowhere",
                   AsciiPly(VertexElement(4) + kFace, "0 0 0\n1 0 0\n0 nan 0\n0 0 0\n3 0 1 2\n"),
                   {"vertex 2", "(0, nan, 0)", "finite"}},
        BadPlyMesh{"strip_index",
                   AsciiPly(VertexElement(4) +
                                "element tristrips 1\nproperty list int int vertex_indices\n",
                            absl::StrCat(kSquare, "4 0 1 2 -2\n")),
                   {"tristrips 0 of 1", "vertex -2"}}),
    [](const auto& info) { return info.param.name; });

TEST(PlyMesh, AFileCutAnywhereIsRefused) {
  const std::string whole =
      AsciiPly(VertexElement(4) + kFace, absl::StrCat(kSquare, "4 0 1 2 3\n"));
  for (size_t length = 1; length + 2 < whole.size(); ++length)
    EXPECT_FALSE(Ply(whole.substr(0, length)).ok()) << length;
}

}  // namespace
}  // namespace voxeld::voxelctl
