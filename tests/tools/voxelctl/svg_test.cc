// Drawings: paths, shapes, transforms and colours, and what is said of broken ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <random>
#include <string>

#include "absl/strings/str_cat.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/import/importer.h"
#include "tools/voxelctl/import/svg_path.h"
#include "tools/voxelctl/import/svg_style.h"

namespace voxeld::voxelctl {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string Svg(const std::string& content) {
  return absl::StrCat(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" "
      "xmlns:xlink=\"http://www.w3.org/1999/xlink\">",
      content, "</svg>");
}

class Drawings : public testing::Test {
 protected:
  absl::StatusOr<Model> Import(const std::string& bytes) {
    return ImportFile(folder_.Write("a.svg", bytes), {});
  }
  Part Read(const std::string& content) {
    const auto model = Import(Svg(content));
    EXPECT_TRUE(model.ok()) << model.status();
    return model.ok() ? model->parts.at(0) : Part();
  }
  std::string Error(const std::string& bytes) {
    return std::string(Import(bytes).status().message());
  }

  TempFolder folder_;
};

TEST_F(Drawings, ShapesAndWhichWayIsUp) {
  const Part line = Read("<line x1='1' y1='2' x2='3mm' y2='4'/>");
  EXPECT_THAT(line.positions, ElementsAre(Point3{1, -2, 0}, Point3{3 * 96 / 25.4, -4, 0}));
  EXPECT_THAT(line.indices, ElementsAre(0, 1));
  const Part square = Read("<rect x='1' y='1' width='2' height='2'/>");
  EXPECT_THAT(square.indices, ElementsAre(0, 1, 1, 2, 2, 3, 3, 0));
  for (const Point3& p : Read("<circle cx='5' cy='-5' r='2'/>").positions)
    EXPECT_NEAR(std::hypot(p.x - 5, p.y - 5), 2, 1e-3);
  EXPECT_EQ(Read("<polyline points='0,0 1,1,2-2'/>").indices.size(), 4u);
  EXPECT_EQ(Read("<polygon points='0,0 1,1 2-2'/>").indices.size(), 6u);
  EXPECT_EQ(Read("<rect width='4' height='4' rx='1'/>").positions.size(), 2u + 4 * 32 + 3);
}

TEST_F(Drawings, TransformsNest) {
  const Part part = Read(
      "<g transform='translate(10,0)'><line transform='rotate(90) scale(2)' "
      "x1='1' y1='0' x2='0' y2='1'/></g>");
  EXPECT_NEAR(part.positions[0].x, 10, 1e-12);
  EXPECT_NEAR(part.positions[0].y, -2, 1e-12);
  EXPECT_NEAR(part.positions[1].x, 8, 1e-12);
  const Part about = Read("<line transform='rotate(180 1 1), skewX(0)' x2='1' y2='1'/>");
  EXPECT_NEAR(about.positions[0].x, 2, 1e-12);
  EXPECT_EQ(Read("<defs><line id='l' x2='1'/></defs><use xlink:href='#l' x='5'/><use href='#l'/>")
                .positions.size(),
            4u);
}

TEST_F(Drawings, Colours) {
  const auto color = [this](const std::string& attributes, const std::string& before = "") {
    return Read(before + "<path d='M0 0 1 1' " + attributes + "/>").colors[0];
  };
  EXPECT_EQ(color(""), (Rgb{255, 255, 255})) << "black ink is white light";
  EXPECT_EQ(color("fill='#f00'"), (Rgb{255, 0, 0}));
  EXPECT_EQ(color("fill='#f00' stroke='teal'"), (Rgb{0, 128, 128}));
  EXPECT_EQ(color("style='fill:none;stroke:rgb(10%, 50, 60)'"), (Rgb{25, 50, 60}));
  EXPECT_EQ(color("class='a b'", "<style>/* x */ .b, .c { stroke: lime }</style>"),
            (Rgb{0, 255, 0}));
  EXPECT_EQ(color("fill='currentColor' color='gold'"), (Rgb{255, 215, 0}));
  EXPECT_THAT(
      Error(Svg("<path d='M0 0 1 1' fill='none'/><g display='none'><path d='M0 0 1 1'/></g>")),
      HasSubstr("has no line that is to be seen"));
  EXPECT_EQ(ParseCssColor("#ggg"), std::nullopt);
}

TEST(SvgPaths, EveryCommand) {
  const auto ends = [](const std::string& data) {
    const auto lines = ParseSvgPath(data, 10000);
    EXPECT_TRUE(lines.ok()) << lines.status();
    return lines.ok() ? lines->back().points.back() : Point2();
  };
  const auto expect = [&](const std::string& data, double x, double y) {
    const Point2 p = ends(data);
    EXPECT_NEAR(p.x, x, 1e-9) << data;
    EXPECT_NEAR(p.y, y, 1e-9) << data;
  };
  expect("M1 2L3,4", 3, 4);
  expect("m1 2 3 4", 4, 6);
  expect("M1 2h3v4H0V0", 0, 0);
  expect("M0 0c1 0 2 1 2 2s1 2 3 3", 5, 5);
  expect("M0 0q1 0 1 1t2-.5.5.5", 3.5, 1);
  expect("M10-1.5.5.25", 0.5, 0.25);
}

TEST(SvgPaths, CurvesAndArcs) {
  // A half circle through (1, -1): from (0, 0) to (2, 0), turning with the clock on paper.
  const auto arc = ParseSvgPath("M0 0a1 1 0 012 0", 1000);
  ASSERT_THAT(arc, IsOk()) << "flags need no gaps";
  for (const Point2& p : arc->at(0).points) {
    EXPECT_NEAR(std::hypot(p.x - 1, p.y), 1, 1e-9);
    EXPECT_LE(p.y, 1e-9);
  }
  const auto curve = ParseSvgPath("M0 0Q1 2 2 0", 1000);
  ASSERT_THAT(curve, IsOk());
  EXPECT_NEAR(curve->at(0).points[16].y, 1, 1e-9);
  const auto two = ParseSvgPath("M0 0L1 0zL5 5", 1000);
  ASSERT_THAT(two, IsOk());
  ASSERT_EQ(two->size(), 2u);
  EXPECT_TRUE(two->at(0).closed);
  EXPECT_EQ(two->at(1).points.size(), 2u);
}

TEST(SvgPaths, ThatAreWrong) {
  const auto error = [](const std::string& data) {
    return std::string(ParseSvgPath(data, 100).status().message());
  };
  EXPECT_THAT(error("L1 1"), HasSubstr("M or m is expected"));
  EXPECT_THAT(error("M0 0 L1"), HasSubstr("a number is expected"));
  EXPECT_THAT(error("M0 0 X1"), HasSubstr("has \"1\" at character 7; one of the commands"));
  EXPECT_THAT(error("M0 0 A1 1 0 2 0 1 1"), HasSubstr("0 or 1 is expected"));
  EXPECT_THAT(error("M0 0 L1e300 1"), HasSubstr("a number is expected"));
  std::string many = "M0 0";
  for (int i = 0; i < 200; ++i) many += " 1 1";
  EXPECT_THAT(error(many), HasSubstr("more than 100 points"));
}

TEST_F(Drawings, RealOnes) {
  for (const char* path : {"/usr/share/doc/prometheus-cpp-dev/html/doxygen.svg",
                           "/usr/share/doc/libtomlplusplus-dev/docs/images/logo.svg",
                           "/usr/share/doc/libtomlplusplus-dev/docs/images/badge-C++17.svg"}) {
    if (!std::filesystem::exists(path)) continue;  // images of Debian without documentation
    const auto model = ImportFile(path, {});
    ASSERT_THAT(model, IsOk()) << path;
    EXPECT_GT(model->parts.at(0).indices.size(), 10u) << path;
  }
}

TEST_F(Drawings, ThatAreWrong) {
  EXPECT_THAT(Error("hello"), HasSubstr("is no well-formed XML (line 1: "));
  EXPECT_THAT(Error("<html/>"), HasSubstr("is XML of <html>; <svg> is expected"));
  EXPECT_THAT(Error(Svg("<g>")), HasSubstr("no well-formed XML"));
  EXPECT_THAT(Error(Svg("\n\n<path d='M0 0 L1 x'/>")),
              HasSubstr("line 3: <path> has path data that are wrong; has \" x\" at character 8"));
  EXPECT_THAT(Error(Svg("<g transform='spin(5)'/>")), HasSubstr("has the transform \"spin(5)\""));
  EXPECT_THAT(Error(Svg("<use href='#a'/>")), HasSubstr("uses \"#a\"; an id of this file"));
  EXPECT_THAT(Error(Svg("<use href='http://x/y.svg#a'/>")), HasSubstr("an id of this file"));
  EXPECT_THAT(Error(Svg("<g id='a'><use href='#a'/></g>")), HasSubstr("without end"));
  EXPECT_THAT(Error(Svg("<polygon points='1 2 x'/>")), HasSubstr("among its points"));
  EXPECT_THAT(Error(Svg("<line x2='1' transform='scale(1e308) scale(1e308)'/>")),
              HasSubstr("coordinates must be finite"));
  std::string deep = "<path d='M0 0 1 1'/>";
  for (int i = 0; i < 300; ++i) deep = "<g>" + deep + "</g>";
  EXPECT_THAT(Error(Svg(deep)), testing::AnyOf(HasSubstr("depth"), HasSubstr("deep")));
  const auto model = Import(Svg("<text>hi</text><path d='M0 0 1 1'/>"));
  ASSERT_THAT(model, IsOk());
  EXPECT_THAT(model->note, HasSubstr("1 text"));
}

// Elements that use two of the ones below them, and entities made of entities.
TEST_F(Drawings, WhatMultipliesEnds) {
  std::string uses = "<path id='u0' d='M0 0 1 1'/>";
  for (int i = 1; i < 40; ++i)
    uses +=
        absl::StrCat("<g id='u", i, "'><use href='#u", i - 1, "'/><use href='#u", i - 1, "'/></g>");
  EXPECT_THAT(Error(Svg(uses)), HasSubstr("without end"));
  std::string laughs = "<!DOCTYPE svg [<!ENTITY a 'M0 0 1 1 '>";
  for (char c = 'b'; c < 'z'; ++c) {
    laughs += absl::StrCat("<!ENTITY ", std::string(1, c), " '");
    for (int i = 0; i < 10; ++i)
      laughs += absl::StrCat("&", std::string(1, static_cast<char>(c - 1)), ";");
    laughs += "'>";
  }
  EXPECT_NE(Error(laughs + "]>" + Svg("<path d='&y;'/>")), "");
  EXPECT_NE(
      Error("<!DOCTYPE svg [<!ENTITY a SYSTEM 'file:///etc/passwd'>]>" + Svg("<path d='&a;'/>")),
      "");
}

TEST_F(Drawings, DamagedOnesEndWell) {
  const std::string good =
      Svg("<style>.a{fill:red}</style><g transform='rotate(5 1 2)'><path class='a' "
          "d='M0 0c1 2 3 4 5 6a1 2 3 0 1 5 5z'/></g>");
  ASSERT_THAT(Import(good), IsOk());
  std::mt19937 random(5);
  for (int i = 0; i < 800; ++i) {
    std::string bytes = good;
    bytes[random() % bytes.size()] = static_cast<char>(random());
    if (i % 4 == 0) bytes.resize(1 + random() % bytes.size());
    (void)Import(bytes);
  }
}

}  // namespace
}  // namespace voxeld::voxelctl
