// DXF: entities, colours and blocks, worked out by hand.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "tests/tools/import/read_here.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"

namespace voxeld::voxelctl {
namespace dxf_test {

using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

// "0 LINE 8 walls 10 1.5" as groups, each in two lines.
std::string Groups(const std::string& words) {
  std::string out(absl::StripAsciiWhitespace(words));
  std::replace(out.begin(), out.end(), ' ', '\n');
  return out + "\n";
}
std::string Section(const std::string& name, const std::string& content) {
  return absl::StrCat("0\nSECTION\n2\n", name, "\n", content, "0\nENDSEC\n");
}
std::string Dxf(const std::string& entities, const std::string& before = "") {
  return absl::StrCat(before, Section("ENTITIES", Groups(entities)), "0\nEOF\n");
}

struct Box {
  double x0 = HUGE_VAL, y0 = HUGE_VAL, z0 = HUGE_VAL, x1 = -HUGE_VAL, y1 = -HUGE_VAL,
         z1 = -HUGE_VAL;
};
Box BoxOf(const Model& model) {
  Box box;
  for (const Part& part : model.parts) {
    for (const Point3& p : part.positions) {
      box = {std::min(box.x0, p.x), std::min(box.y0, p.y), std::min(box.z0, p.z),
             std::max(box.x1, p.x), std::max(box.y1, p.y), std::max(box.z1, p.z)};
    }
  }
  return box;
}
void ExpectBox(const Model& model, const Box& b) {
  const Box a = BoxOf(model);
  for (const auto& [is, expected] : {std::pair{a.x0, b.x0},
                                     {a.y0, b.y0},
                                     {a.z0, b.z0},
                                     {a.x1, b.x1},
                                     {a.y1, b.y1},
                                     {a.z1, b.z1}})
    EXPECT_NEAR(is, expected, 1e-9);
}
double LengthOf(const Part& part) {
  double length = 0;
  for (size_t i = 0; i + 1 < part.indices.size(); i += 2) {
    const Point3 &a = part.positions[part.indices[i]], &b = part.positions[part.indices[i + 1]];
    length += std::hypot(a.x - b.x, a.y - b.y, a.z - b.z);
  }
  return length;
}

class DxfFiles : public testing::Test {
 protected:
  absl::StatusOr<Model> Read(const std::string& text) {
    return ReadHere(folder_.Write("a.dxf", text), {});
  }
  Model Good(const std::string& text) {
    absl::StatusOr<Model> model = Read(text);
    EXPECT_THAT(model, IsOk()) << text;
    if (!model.ok()) return Model{.parts = {Part{.positions = {{}}, .colors = {{}}}}};
    return *std::move(model);
  }
  TempFolder folder_;
};

constexpr char kFace[] =
    "0 3DFACE 8 0 62 1 10 0 20 0 30 0 11 4 21 0 31 0 12 4 22 1 32 0 13 0 23 1 33 0";
constexpr char kLine[] = "0 LINE 8 0 10 0 20 0 30 0 11 4 21 0 31 0";

TEST_F(DxfFiles, FacesLinesAndPoints) {
  const Model model = Good(Dxf(absl::StrCat(kFace, " ", kLine, " 0 POINT 10 1 20 2 30 3")));
  ASSERT_EQ(model.parts.size(), 3u);
  EXPECT_EQ(model.parts[0].indices.size(), 6u);
  EXPECT_THAT(model.parts[0].colors, Each(Rgb{255, 0, 0}));
  EXPECT_EQ(model.parts[1].indices.size(), 2u);
  EXPECT_THAT(model.parts[1].colors, Each(Rgb{255, 255, 255})) << "the foreground";
  EXPECT_THAT(model.parts[2].positions, ElementsAre(Point3{1, 2, 3}));
  EXPECT_EQ(model.up, Up::kZ);
  EXPECT_THAT(model.left_out, IsEmpty());
  EXPECT_EQ(Good(Dxf("0 3DFACE 10 0 20 0 11 4 21 0 12 4 22 1 13 4 23 1")).parts[0].indices.size(),
            3u);
  // The corners of a SOLID go to and fro.
  const Model solid = Good(Dxf("0 SOLID 10 0 20 0 11 4 21 0 12 0 22 1 13 4 23 1"));
  double area = 0;
  for (size_t t = 0; t < 6; t += 3) {
    const auto at = [&](size_t i) {
      return solid.parts[0].positions[solid.parts[0].indices[t + i]];
    };
    area +=
        ((at(1).x - at(0).x) * (at(2).y - at(0).y) - (at(2).x - at(0).x) * (at(1).y - at(0).y)) / 2;
  }
  EXPECT_DOUBLE_EQ(area, 4);
}

TEST_F(DxfFiles, EveryEntityThatIsNotShownIsCounted) {
  EXPECT_THAT(
      Good(Dxf(absl::StrCat(kLine, " 0 TEXT 10 0 1 HI 0 TEXT 10 0 1 HO 0 SPLINE 71 3"))).left_out,
      UnorderedElementsAre(LeftOut{"entities of type TEXT", 2},
                           LeftOut{"entities of type SPLINE", 1}));
  EXPECT_THAT(
      Good(Dxf(absl::StrCat(kLine, " 60 1 ", kLine, " 67 1 ", kLine, " 39 5"))).left_out,
      UnorderedElementsAre(LeftOut{"hidden entities", 1}, LeftOut{"entities of paper space", 1},
                           LeftOut{"thicknesses of entities", 1}));
  EXPECT_THAT(Good(Dxf(absl::StrCat(kLine, " 0 INSERT 2 gone"))).left_out,
              ElementsAre(LeftOut{"insertions of missing blocks", 1}));
  EXPECT_THAT(std::string(Read(Dxf("0 TEXT 1 HI")).status().message()),
              HasSubstr("no entity that is shown"));
}

TEST_F(DxfFiles, CirclesAndArcs) {
  const Model circle = Good(Dxf("0 CIRCLE 10 1 20 2 30 3 40 5"));
  ExpectBox(circle, {-4, -3, 3, 6, 7, 3});
  EXPECT_NEAR(LengthOf(circle.parts[0]), 2 * M_PI * 5, 0.02);
  // From 270° over 0° to 90°.
  ExpectBox(Good(Dxf("0 ARC 10 0 20 0 30 0 40 2 50 270 51 90")), {0, -2, 0, 2, 2, 0});
  // In a plane whose normal is y, x points to −x, and y up.
  ExpectBox(Good(Dxf("0 ARC 10 0 20 0 30 7 40 2 50 0 51 90 210 0 220 1 230 0")),
            {-2, 7, 0, 0, 7, 2});
  ExpectBox(Good(Dxf("0 ELLIPSE 10 0 20 0 30 0 11 0 21 4 31 0 40 0.5 41 0 42 6.283185307179586")),
            {-2, -4, 0, 2, 4, 0});
}

TEST_F(DxfFiles, Polylines) {
  const Model light =
      Good(Dxf("0 LWPOLYLINE 90 4 70 0 38 6 10 0 20 0 10 4 20 0 10 4 20 1 10 0 20 1"));
  EXPECT_DOUBLE_EQ(LengthOf(light.parts[0]), 9) << "every segment";
  ExpectBox(light, {0, 0, 6, 4, 1, 6});
  EXPECT_DOUBLE_EQ(
      LengthOf(Good(Dxf("0 LWPOLYLINE 70 1 10 0 20 0 10 4 20 0 10 4 20 1 10 0 20 1")).parts[0]),
      10);
  // A bulge of 1 is half a circle, on the right of the way.
  ExpectBox(Good(Dxf("0 LWPOLYLINE 70 0 10 0 20 0 42 1 10 4 20 0")), {0, -2, 0, 4, 0, 0});
  ExpectBox(Good(Dxf("0 LWPOLYLINE 70 0 10 0 20 0 42 -1 10 4 20 0")), {0, 0, 0, 4, 2, 0});
  const std::string vertices =
      "0 VERTEX 10 0 20 0 30 0 0 VERTEX 10 4 20 0 30 1 0 VERTEX 10 4 20 1 30 2 0 SEQEND";
  ExpectBox(Good(Dxf("0 POLYLINE 66 1 70 8 " + vertices)), {0, 0, 0, 4, 1, 2});
  ExpectBox(Good(Dxf("0 POLYLINE 66 1 70 0 30 9 " + vertices)), {0, 0, 9, 4, 1, 9});
  EXPECT_THAT(Good(Dxf("0 POLYLINE 70 0 40 2 41 2 " + vertices)).left_out,
              ElementsAre(LeftOut{"widths of polylines", 1}));
  // What follows is no part of it.
  EXPECT_EQ(Good(Dxf("0 POLYLINE 70 8 " + vertices + " " + kFace)).parts.size(), 2u);
}

TEST_F(DxfFiles, MeshesAndPolyfaces) {
  const std::string grid =
      "0 VERTEX 70 64 10 0 20 0 0 VERTEX 70 64 10 0 20 1 0 VERTEX 70 64 10 1 20 0 0 VERTEX 70 64 "
      "10 1 20 1 "
      "0 VERTEX 70 64 10 2 20 0 0 VERTEX 70 64 10 2 20 1 0 SEQEND";
  EXPECT_EQ(Good(Dxf("0 POLYLINE 70 16 71 3 72 2 " + grid)).parts.at(0).indices.size(), 12u);
  EXPECT_THAT(std::string(Read(Dxf("0 POLYLINE 70 16 71 4 72 2 " + grid)).status().message()),
              HasSubstr("has 6 vertices; 4 by 2 are announced"));
  const std::string faces =
      "0 POLYLINE 70 64 0 VERTEX 70 192 10 0 20 0 0 VERTEX 70 192 10 4 20 0 0 VERTEX 70 192 10 4 "
      "20 1 "
      "0 VERTEX 70 192 10 0 20 1 0 VERTEX 70 128 71 1 72 -2 73 3 74 4 0 VERTEX 70 128 71 1 72 2 "
      "73 ";
  EXPECT_EQ(Good(Dxf(faces + "4 0 SEQEND")).parts.at(0).indices.size(), 9u);
  EXPECT_THAT(std::string(Read(Dxf(faces + "5 0 SEQEND")).status().message()),
              HasSubstr("refers to vertex 5; its polyline has 4"));
}

TEST_F(DxfFiles, Colours) {
  const auto color = [this](const std::string& entity, const std::string& layer = "62 5") {
    const std::string tables =
        Section("TABLES", Groups("0 TABLE 2 LAYER 0 LAYER 2 walls 70 0 " + layer + " 0 ENDTAB"));
    const Model model = Good(Dxf("0 LINE 8 walls 11 4 21 0 " + entity, tables));
    return model.parts.at(0).colors.empty() ? Rgb{1, 2, 3} : model.parts[0].colors[0];
  };
  EXPECT_EQ(color(""), (Rgb{0, 0, 255})) << "the layer's";
  EXPECT_EQ(color("62 256"), (Rgb{0, 0, 255})) << "the layer's, said in so many words";
  EXPECT_EQ(color("62 2"), (Rgb{255, 255, 0}));
  EXPECT_EQ(color("62 3"), (Rgb{0, 255, 0}));
  EXPECT_EQ(color("62 4"), (Rgb{0, 255, 255}));
  EXPECT_EQ(color("62 30"), (Rgb{255, 128, 0}));
  EXPECT_EQ(color("62 90"), (Rgb{0, 255, 0}));
  EXPECT_EQ(color("62 171"), (Rgb{128, 128, 255}));
  EXPECT_EQ(color("62 250"), (Rgb{51, 51, 51}));
  EXPECT_EQ(color("420 1193046"), (Rgb{0x12, 0x34, 0x56}));
  EXPECT_EQ(color("", "62 5 420 1193046"), (Rgb{0x12, 0x34, 0x56}));
  EXPECT_EQ(color("", "62 7"), (Rgb{1, 2, 3})) << "the foreground alone is no colour";
}

TEST_F(DxfFiles, LayersThatAreOffOrFrozenAreHidden) {
  for (const char* const layer : {"70 0 62 -5", "70 1 62 5"}) {
    const std::string tables =
        Section("TABLES", Groups(absl::StrCat("0 TABLE 2 LAYER 0 LAYER 2 off ", layer)));
    const Model model = Good(Dxf(absl::StrCat(kLine, " 0 LINE 8 off 10 9 20 9 11 8 21 8"), tables));
    EXPECT_EQ(model.parts.at(0).indices.size(), 2u);
    EXPECT_THAT(model.left_out, ElementsAre(LeftOut{"hidden entities", 1})) << layer;
  }
}

TEST_F(DxfFiles, BlocksWhereTheyAreInserted) {
  const std::string blocks = Section(
      "BLOCKS",
      Groups("0 BLOCK 2 inner 10 1 20 0 30 0 0 LINE 62 0 10 1 20 0 30 0 11 3 21 0 31 0 0 "
             "TEXT 1 HI 0 ENDBLK "
             "0 BLOCK 2 outer 10 0 20 0 30 0 0 INSERT 2 inner 10 0 20 5 30 0 62 0 0 ENDBLK "
             "0 BLOCK 2 empty 10 0 0 ENDBLK 0 BLOCK 2 endless 10 0 0 INSERT 2 endless 0 ENDBLK"));
  ExpectBox(Good(Dxf("0 INSERT 2 inner 10 10 20 20 30 30", blocks)), {10, 20, 30, 12, 20, 30});
  // Scaled, then turned, about the base point.
  ExpectBox(Good(Dxf("0 INSERT 2 inner 10 10 20 20 30 30 41 3 50 90", blocks)),
            {10, 20, 30, 10, 26, 30});
  const Model nested = Good(Dxf("0 INSERT 2 outer 10 0 20 0 30 0 50 90 62 6", blocks));
  ExpectBox(nested, {-5, 0, 0, -5, 2, 0});
  EXPECT_THAT(nested.parts.at(0).colors, Each(Rgb{255, 0, 255})) << "by block, through both";
  EXPECT_THAT(nested.left_out, ElementsAre(LeftOut{"entities of type TEXT", 1}));
  // Two rows and three columns.
  const Model many = Good(Dxf("0 INSERT 2 inner 10 0 20 0 70 3 71 2 44 10 45 100", blocks));
  EXPECT_EQ(many.parts.at(0).indices.size(), 12u);
  ExpectBox(many, {0, 0, 0, 22, 100, 0});
  EXPECT_THAT(std::string(Read(Dxf("0 INSERT 2 endless", blocks)).status().message()),
              HasSubstr("at most 16 are read"));
  EXPECT_THAT(
      std::string(Read(Dxf("0 INSERT 2 empty 70 30000 71 30000", blocks)).status().message()),
      HasSubstr("more than 1000000 times"));
}

TEST_F(DxfFiles, UnitsAndWhatIsWrong) {
  const auto header = [](int units) {
    return Section("HEADER", Groups(absl::StrCat("9 $ACADVER 1 AC1015 9 $INSUNITS 70 ", units)));
  };
  EXPECT_EQ(Good(Dxf(kLine, header(4))).unit, 0.001);
  EXPECT_EQ(Good(Dxf(kLine, header(1))).unit, 0.0254);
  EXPECT_EQ(Good(Dxf(kLine, header(0))).unit, 0);
  EXPECT_EQ(Good(Dxf(kLine)).unit, 0);
  const auto error = [this](const std::string& text) {
    return std::string(Read(text).status().message());
  };
  EXPECT_THAT(error("AutoCAD Binary DXF\r\n\x1a"), HasSubstr("save it as ASCII DXF"));
  EXPECT_THAT(error("hello\nworld\n"), HasSubstr("line 1 is \"hello\""));
  EXPECT_THAT(error(Dxf("0 LINE 10 zero 20 0")), HasSubstr("has \"zero\" for the group 10"));
  EXPECT_THAT(error(Dxf("0 LINE 10 nan 20 0")), HasSubstr("a finite number is expected"));
}

TEST_F(DxfFiles, DamageAnywhereEndsWell) {
  const std::string good =
      Dxf(absl::StrCat(kFace, " ", kLine,
                       " 0 INSERT 2 b 41 2 0 LWPOLYLINE 70 1 10 0 20 0 42 1 10 4 20 0"),
          Section("BLOCKS", Groups("0 BLOCK 2 b 10 0 0 CIRCLE 10 0 20 0 40 1 0 ENDBLK")));
  std::mt19937 random(7);
  for (int i = 0; i < 2000; ++i) {
    std::string bytes = good;
    bytes[random() % bytes.size()] = static_cast<char>(random() % 128);
    if (i % 4 == 0) bytes.resize(1 + random() % bytes.size());
    const auto model = Read(bytes);
    if (!model.ok()) {
      EXPECT_THAT(std::string(model.status().message()), HasSubstr("a.dxf"));
    }
  }
}

}  // namespace dxf_test
}  // namespace voxeld::voxelctl
