// Tests STL: ASCII and binary files as written by different programs, their colors, and broken
// ones.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "tests/tools/voxelctl/read_here.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/import/importer.h"

namespace voxeld::voxelctl {
namespace {

template <typename T>
std::string Raw(T value) {
  char bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  return {bytes, sizeof value};
}

std::string Facet(const std::vector<float>& numbers, uint16_t attribute) {
  std::string bytes;
  for (const float number : numbers) bytes += Raw(number);
  return bytes + Raw(attribute);
}

std::string Title(std::string text) {
  text.resize(80, ' ');
  return text;
}

// A rectangle 4 wide and 1 deep.
std::string Rectangle(const std::string& title, uint16_t first = 0, uint16_t second = 0,
                      float normal_z = 1) {
  return Title(title) + Raw<uint32_t>(2) +
         Facet({0, 0, normal_z, 0, 0, 0, 4, 0, 0, 4, 1, 0}, first) +
         Facet({0, 0, normal_z, 0, 0, 0, 4, 1, 0, 0, 1, 0}, second);
}

constexpr const char* kFacet1 =
    "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 4 0 0\nvertex 4 1 0\nendloop\nendfacet\n";
constexpr const char* kFacet2 =
    "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 4 1 0\nvertex 0 1 0\nendloop\nendfacet\n";

std::string Ascii() { return absl::StrCat("solid a\n", kFacet1, kFacet2, "endsolid a\n"); }

absl::StatusOr<Model> Stl(const std::string& bytes) {
  TempFolder folder;
  return ReadHere(folder.Write("a.stl", bytes), {});
}

void ExpectRectangle(const std::string& bytes) {
  const absl::StatusOr<Model> model = Stl(bytes);
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->format, "STL");
  EXPECT_EQ(model->up, Up::kZ);
  ASSERT_EQ(model->parts.size(), 1u);
  const Part& part = model->parts[0];
  EXPECT_EQ(part.positions, (std::vector<Point3>{{0, 0, 0}, {4, 0, 0}, {4, 1, 0}, {0, 1, 0}}));
  EXPECT_EQ(part.indices, (std::vector<uint32_t>{0, 1, 2, 0, 2, 3}));
  EXPECT_EQ(part.normals, std::vector<Point3>(4, Point3{0, 0, 1}));
  EXPECT_TRUE(part.colors.empty());
}

TEST(StlBinary, IsReadWhateverItsHeaderBeginsWith) {
  ExpectRectangle(Rectangle("exported by a CAD program"));
  ExpectRectangle(Rectangle("solid exported by a CAD program"));
}

TEST(StlBinary, BytesBehindTheTrianglesAreIgnored) {
  ExpectRectangle(Rectangle("binary") + std::string(10, '\0'));
  ExpectRectangle(Rectangle("solid binary") + std::string(10, '\0'));
  ExpectRectangle(Rectangle("solid binary") + "a title of the exporter");
}

TEST(StlBinary, AZeroNormalIsReplacedByTheWinding) { ExpectRectangle(Rectangle("", 0, 0, 0)); }

TEST(StlAscii, IsReadInAnyCaseAndWithAnyLineEnds) {
  ExpectRectangle(Ascii());
  ExpectRectangle(absl::StrReplaceAll(absl::AsciiStrToUpper(Ascii()), {{"\n", "\r\n"}}));
  ExpectRectangle(absl::StrReplaceAll(Ascii(), {{"\n", "\r"}}));
  ExpectRectangle(absl::StrReplaceAll(Ascii(), {{"\n", "\n\t  "}}));
  ExpectRectangle(absl::StrReplaceAll(Ascii(), {{" 4 ", " +4.0e+00 "}}));
}

TEST(StlAscii, BlanksAndAByteOrderMarkMayComeBeforeSolid) {
  ExpectRectangle(" " + Ascii());
  ExpectRectangle("\xef\xbb\xbf" + Ascii());
}

TEST(StlAscii, SolidsOfOneFileAreOneModel) {
  ExpectRectangle(
      absl::StrCat("solid a\n", kFacet1, "endsolid a\nsolid b b\n", kFacet2, "endsolid b b\n"));
}

TEST(StlAscii, ANameMayHoldWordsOfTheFormat) {
  ExpectRectangle(absl::StrCat("solid facet of a solid\n", kFacet1, kFacet2, "endsolid facet\n"));
}

TEST(StlAscii, ANormalThatIsNoNumberIsReplacedByTheWinding) {
  ExpectRectangle(absl::StrReplaceAll(Ascii(), {{"normal 0 0 1", "normal -nan(ind) 0 0"}}));
  ExpectRectangle(absl::StrReplaceAll(Ascii(), {{"normal 0 0 1", "normal 0 0 0"}}));
}

TEST(StlAscii, AFacetOfFourVerticesIsTwoTriangles) {
  ExpectRectangle(
      "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 4 0 0\nvertex 4 1 0\nvertex 0 "
      "1 0\nendloop\nendfacet\nendsolid\n");
}

TEST(StlAscii, ColorLinesAreCounted) {
  const std::string facet =
      "facet normal 0 0 1\nCOLOR 1 0 0\nouter loop\nvertex 0 0 0\nvertex 4 0 0\nvertex 4 1 0\n"
      "endloop\nendfacet\n";
  const TempFolder folder;
  const auto model = ReadHere(
      folder.Write("a.stl", "solid color\n" + facet + "color 0 1 0\n" + facet + "endsolid color\n"),
      {});
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"colours of ASCII facets", 3}}));
}

TEST(StlColor, OfVisCamHasRedInTheHighBits) {
  const absl::StatusOr<Model> model = Stl(Rectangle("binary", 0xfc00, 0x801f));
  ASSERT_THAT(model, IsOk());
  ASSERT_EQ(model->parts.size(), 1u);
  EXPECT_EQ(model->parts[0].colors[0], (Rgb{255, 0, 0}));
  EXPECT_THAT(model->parts[0].colors, testing::Contains(Rgb{0, 0, 255}));
}

TEST(StlColor, OfSomeFacetsLeavesTheOthersWithTheModels) {
  const absl::StatusOr<Model> model = Stl(Rectangle("binary", 0x83e0, 0));
  ASSERT_THAT(model, IsOk());
  ASSERT_EQ(model->parts.size(), 2u);
  EXPECT_EQ(model->parts[0].colors, std::vector<Rgb>(3, Rgb{0, 255, 0}));
  EXPECT_TRUE(model->parts[1].colors.empty());
}

TEST(StlColor, OfMagicsHasRedInTheLowBitsAndOneForTheWhole) {
  const absl::StatusOr<Model> model =
      Stl(Rectangle(std::string("COLOR=\x10\x20\x30\xff", 10), 0x001f, 0x8000));
  ASSERT_THAT(model, IsOk());
  ASSERT_EQ(model->parts.size(), 1u);
  EXPECT_EQ(model->parts[0].colors[0], (Rgb{255, 0, 0}));
  EXPECT_EQ(model->parts[0].colors.back(), (Rgb{0x10, 0x20, 0x30}));
}

TEST(StlColor, AttributesWithoutItsBitAreNoColor) { ExpectRectangle(Rectangle("x", 7, 0x7fff)); }

TEST(StlSurface, CornersAtOnePlaceWithOneNormalAreOneVertex) {
  const absl::StatusOr<Model> model = ReadHere(DataFile("arrow.stl"), {});
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->parts[0].indices.size(), 12u);
  EXPECT_EQ(model->parts[0].positions.size(), 12u) << "the faces of a tetrahedron share no normal";
  const absl::StatusOr<Model> zero =
      Stl(Title("") + Raw<uint32_t>(2) + Facet({0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0}, 0) +
          Facet({0, 0, 1, -0.0f, 0, 0, -1, 0, 0, 0, -1, 0}, 0));
  ASSERT_THAT(zero, IsOk());
  EXPECT_EQ(zero->parts[0].positions.size(), 5u) << "0 and -0 are one place";
}

struct BadStl {
  const char* name;
  std::string bytes;
  Words words;
};

class BrokenStl : public testing::TestWithParam<BadStl> {};

TEST_P(BrokenStl, IsRefusedWithWords) {
  EXPECT_THAT(Stl(GetParam().bytes), Fails(GetParam().words));
}

INSTANTIATE_TEST_SUITE_P(
    Table, BrokenStl,
    testing::Values(
        BadStl{"text", "hello, this is not a mesh\n", {"a.stl", "hello", "solid", "84 bytes"}},
        BadStl{"utf16", "\xff\xfe" + std::string(200, 's'), {"UTF-16 text", "202 bytes"}},
        BadStl{"lines_that_returns_end",
               absl::StrReplaceAll(Ascii(), {{"vertex 4 0 0", "vertex inf 0 0"}, {"\n", "\r"}}),
               {"line 5", "\"inf\""}},
        BadStl{"lines_of_two_marks",
               absl::StrReplaceAll(Ascii(), {{"vertex 4 0 0", "vertex inf 0 0"}, {"\n", "\r\n"}}),
               {"line 5", "\"inf\""}},
        BadStl{"decimal_comma",
               absl::StrReplaceAll(Ascii(), {{"vertex 4 1 0", "vertex 4,0 1,0 0,0"}}),
               {"line 6", "\"4,0\"", "decimal marks"}},
        BadStl{"infinite_vertex",
               absl::StrReplaceAll(Ascii(), {{"vertex 4 0 0", "vertex inf 0 0"}}),
               {"line 5", "\"inf\"", "finite"}},
        BadStl{"word_for_a_number",
               absl::StrReplaceAll(Ascii(), {{"vertex 4 0 0", "vertex 4 0"}}),
               {"line 6", "\"vertex\""}},
        BadStl{"two_vertices",
               absl::StrReplaceAll(Ascii(), {{"vertex 4 0 0\n", ""}}),
               {"facet in line 2", "2 vertices", "three"}},
        BadStl{"no_endfacet",
               absl::StrReplaceAll(Ascii(), {{"endfacet\n", ""}}),
               {"facet in line 2", "no \"endfacet\""}},
        BadStl{"cut_in_facet", Ascii().substr(0, 60), {"endsolid", "truncated"}},
        BadStl{"cut_behind_facet", absl::StrCat("solid\n", kFacet1), {"endsolid", "truncated"}},
        BadStl{
            "infinite_binary_vertex",
            Title("") + Raw<uint32_t>(1) + Facet({0, 0, 1, 0, 0, 0, HUGE_VALF, 0, 0, 0, 1, 0}, 0),
            {"facet 1", "inf", "finite"}},
        BadStl{"binary_of_one_byte_less",
               Rectangle("solid").substr(0, 183),
               {"2 triangles (184 bytes)", "183 bytes", "truncated"}}),
    [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace voxeld::voxelctl
