// Drawings: paths, shapes, transforms and colours, and what is said of broken ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "tests/tools/import/read_here.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/import/svg_fill.h"
#include "tools/import/svg_path.h"
#include "tools/import/svg_style.h"
#include "tools/voxelctl/import/importer.h"

namespace voxeld::voxelctl {
namespace svg_test {

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
    return ReadHere(folder_.Write("a.svg", bytes), {});
  }
  Model ReadAll(const std::string& content) {
    const auto model = Import(Svg(content));
    EXPECT_TRUE(model.ok()) << model.status();
    return model.ok() ? *model : Model{.parts = {Part()}};
  }
  // Of its only level, or of one of them.
  Part Read(const std::string& content, Kind kind = Kind::kSegments, int level = -1) {
    for (const Part& part : ReadAll(content).parts) {
      if (part.kind == kind && (level < 0 || part.level == level)) return part;
    }
    ADD_FAILURE() << "there is no such part: " << content;
    return {};
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
  EXPECT_EQ(Read("<polyline points='0,0 1,1,2-2' fill='none' stroke='red'/>").indices.size(), 4u);
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

double Cross(const Point3& a, const Point3& b, const Point3& c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

double AreaOf(const Part& part) {
  double area = 0;
  for (size_t i = 0; i < part.indices.size(); i += 3) {
    area += std::abs(Cross(part.positions[part.indices[i]], part.positions[part.indices[i + 1]],
                           part.positions[part.indices[i + 2]])) /
            2;
  }
  return area;
}

TEST_F(Drawings, AreasByTheirRules) {
  const auto area = [this](const std::string& element) {
    return AreaOf(Read(element, Kind::kTriangles));
  };
  EXPECT_NEAR(area("<rect width='4' height='3'/>"), 12, 1e-9);
  EXPECT_NEAR(area("<circle r='2'/>"), 4 * std::numbers::pi, 0.01);
  EXPECT_NEAR(area("<path d='M0 0h2v2'/>"), 2, 1e-9)
      << "what is open is filled as if it were closed";
  EXPECT_NEAR(area("<g transform='scale(2 3)'><rect width='1' height='1'/></g>"), 6, 1e-9);
  // A square in a square, drawn the same way round, and the other.
  const std::string same = "M0 0h10v10h-10z M2 2h4v4h-4z", other = "M0 0h10v10h-10z M2 2v4h4v-4z";
  EXPECT_NEAR(area("<path d='" + same + "'/>"), 100, 1e-9);
  EXPECT_NEAR(area("<path d='" + other + "'/>"), 84, 1e-9);
  EXPECT_NEAR(area("<path fill-rule='evenodd' d='" + same + "'/>"), 84, 1e-9);
  EXPECT_NEAR(area("<g style='fill-rule:evenodd'><path d='" + same + "'/></g>"), 84, 1e-9);
  // Five points of a star: the pentagon in the middle has been gone round twice. By its radius R = 1 the star without it is
  // 5·sin 36° times the triangle's height; the pentagon has a radius of cos 72° / cos 36°.
  std::string star = "<polygon points='";
  for (int i = 0; i < 5; ++i) {
    const double at = 4 * std::numbers::pi * i / 5;
    absl::StrAppend(&star, absl::StrFormat("%.15f,%.15f ", std::cos(at), std::sin(at)));
  }
  const double deg = std::numbers::pi / 180;
  const double inner = std::cos(72 * deg) / std::cos(36 * deg);
  const double pentagon = 2.5 * inner * inner * std::sin(72 * deg);
  const double whole = 5 * inner * std::sin(36 * deg);
  EXPECT_NEAR(area(star + "'/>"), whole, 1e-6);
  EXPECT_NEAR(area(star + "' fill-rule='evenodd'/>"), whole - pentagon, 1e-6);
}

// Curves at random that cross themselves, against how often each of many places is gone round.
TEST(SvgFills, CoverWhatIsGoneRound) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> in(0, 1);
  for (int round = 0; round < 60; ++round) {
    std::vector<Polyline> curves(1 + random() % 3);
    for (Polyline& curve : curves) {
      curve.closed = true;
      for (size_t i = 3 + random() % 9; i > 0; --i)
        curve.points.push_back({in(random), in(random)});
    }
    FillBudget budget;
    for (const FillRule rule : {FillRule::kNonZero, FillRule::kEvenOdd}) {
      const auto filled = FillCurves(curves, rule, &budget);
      ASSERT_TRUE(filled);
      for (int i = 0; i < 300; ++i) {
        const Point2 at = {in(random), in(random)};
        int winding = 0;
        for (const Polyline& curve : curves) {
          for (size_t k = 0; k < curve.points.size(); ++k) {
            const Point2 &p = curve.points[k], &q = curve.points[(k + 1) % curve.points.size()];
            if ((p.y <= at.y) == (q.y <= at.y)) continue;
            if (p.x + (at.y - p.y) / (q.y - p.y) * (q.x - p.x) > at.x)
              winding += p.y <= at.y ? 1 : -1;
          }
        }
        int covered = 0;
        for (size_t k = 0; k < filled->indices.size(); k += 3) {
          const auto corner = [&](size_t c) {
            const Point2& p = filled->points[filled->indices[k + c % 3]];
            return Point3{p.x, p.y, 0};
          };
          int left = 0;
          for (size_t c = 0; c < 3; ++c)
            left += Cross(corner(c), corner(c + 1), {at.x, at.y, 0}) > 0 ? 1 : -1;
          covered += std::abs(left) == 3 ? 1 : 0;
        }
        const bool inside = rule == FillRule::kNonZero ? winding != 0 : winding % 2 != 0;
        ASSERT_EQ(covered, inside ? 1 : 0) << round << ": " << at.x << " " << at.y;
      }
    }
  }
}

TEST(SvgFills, WhatCrossesItselfTooOftenIsLeftAlone) {
  Polyline scribble;
  std::mt19937 random(3);
  for (int i = 0; i < 20000; ++i)
    scribble.points.push_back({static_cast<double>(random()), static_cast<double>(random())});
  FillBudget budget;
  EXPECT_FALSE(FillCurves({scribble}, FillRule::kNonZero, &budget));
}

TEST_F(Drawings, PaintOfAreas) {
  const auto color = [this](const std::string& attributes, const std::string& before = "") {
    return Read(before + "<rect width='1' height='1' " + attributes + "/>", Kind::kTriangles)
        .colors[0];
  };
  EXPECT_EQ(color("fill='red'"), (Rgb{255, 0, 0}));
  EXPECT_EQ(color("fill='red' fill-opacity='0.5'"), (Rgb{128, 0, 0}));
  EXPECT_EQ(color("style='fill: red; opacity: 50%'"), (Rgb{128, 0, 0}));
  EXPECT_EQ(color("fill='currentColor'", "<!-- --><style>rect { color: #00ff00 }</style>"),
            (Rgb{0, 255, 0}));
  const std::string stops =
      "<stop offset='0' stop-color='#f00'/><stop offset='1' style='stop-color:#00f'/>";
  EXPECT_EQ(
      color("fill='url(#b)'", "<defs><linearGradient id='a'>" + stops +
                                  "</linearGradient><radialGradient id='b' href='#a'/></defs>"),
      (Rgb{127, 0, 127}))
      << "the mean of the stops";
  EXPECT_EQ(color("fill='url(#none) lime'"), (Rgb{0, 255, 0}));
  EXPECT_EQ(color("fill='url(#a)'",
                  "<linearGradient id='a' href='#b'/><linearGradient id='b' href='#a'/>"),
            (Rgb{255, 255, 255}))
      << "gradients of each other";
  const Model group = ReadAll(
      "<g opacity='.5' fill='#fff'><g opacity='.5'><rect width='1' height='1'/></g>"
      "<rect x='5' width='1' height='1' visibility='hidden'/></g>");
  ASSERT_EQ(group.parts.size(), 2u);
  EXPECT_EQ(group.parts[0].colors[0], (Rgb{64, 64, 64}));
  EXPECT_EQ(Read("<g visibility='hidden'><rect width='1' height='1' visibility='visible'/></g>")
                .colors.size(),
            4u);
}

TEST_F(Drawings, WhatIsPaintedLaterIsAbove) {
  const std::string red = "<rect width='8' height='8' fill='red'/>",
                    blue = "<rect x='2' y='2' width='4' height='4' fill='blue' stroke='lime'/>",
                    far = "<rect x='90' y='90' width='4' height='4' fill='gold'/>";
  const Model model = ReadAll(red + blue + far);
  std::map<std::pair<int, Kind>, Rgb> colors;
  for (const Part& part : model.parts) colors[{part.level, part.kind}] = part.colors.front();
  EXPECT_EQ((colors[{0, Kind::kTriangles}]), (Rgb{255, 0, 0})) << "and what lies apart";
  EXPECT_EQ((colors[{1, Kind::kTriangles}]), (Rgb{0, 0, 255}));
  EXPECT_EQ((colors[{2, Kind::kSegments}]), (Rgb{0, 255, 0})) << "a stroke is over its own area";
  EXPECT_EQ(model.parts.back().level, 2);
  // More than there are levels.
  std::string many;
  for (int i = 0; i < 300; ++i)
    absl::StrAppend(&many, "<rect width='9' height='9' fill='", i % 2 == 0 ? "red" : "blue", "'/>");
  const Model high = ReadAll(many);
  EXPECT_EQ(high.parts.back().level, kMostLevel);
  EXPECT_THAT(high.note, HasSubstr("more than 127 layers"));
}

TEST_F(Drawings, InkAndPaper) {
  const std::string sheet = "<rect width='100' height='50' fill='#fff'/>",
                    ink = "<rect x='10' y='10' width='5' height='5'/>";
  const Model written = ReadAll(sheet + ink);
  EXPECT_THAT(written.note, HasSubstr("the white sheet behind all is left out"));
  ASSERT_EQ(written.parts.size(), 2u);
  EXPECT_EQ(written.parts[0].colors[0], (Rgb{255, 255, 255}));
  EXPECT_NEAR(AreaOf(Read(sheet + ink, Kind::kTriangles)), 25, 1e-9);
  const std::string flag = sheet + "<circle cx='50' cy='25' r='15' fill='#bc002d'/>";
  EXPECT_EQ(ReadAll(flag).note, "");
  EXPECT_NEAR(AreaOf(Read(flag, Kind::kTriangles, 0)), 5000, 1e-9);
  const Part penguin =
      Read(ink + "<rect x='90' width='5' height='5' fill='orange'/>", Kind::kTriangles, 0);
  EXPECT_EQ(penguin.colors.front(), (Rgb{0, 0, 0})) << "there is something else to be seen";
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

// Of pymol-data, which tools/setup installs.
TEST_F(Drawings, RealOnes) {
  const std::string folder = "/usr/share/pymol/data/";
  for (const char* name : {"openvr/hints_vive_controller.svg", "openvr/menu_splash.svg",
                           "pmg_qt/icons/refresh.svg", "pymol/icons/icon2.svg"}) {
    const auto model = ReadHere(folder + name, {});
    ASSERT_THAT(model, IsOk()) << name;
    double area = 0;
    for (const Part& part : model->parts) area += part.kind == Kind::kTriangles ? AreaOf(part) : 0;
    EXPECT_GT(area, 0) << name;
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

// Rules, and text that is used again and again.
TEST_F(Drawings, WhatIsParsedAgainEnds) {
  std::string selectors = "b";
  for (int i = 0; i < 100'000; ++i) selectors += ",a";
  std::string body;
  for (int i = 0; i < 4000; ++i) body += "fill:red;";
  ASSERT_THAT(Import(Svg("<style>" + selectors + "{" + body + "}</style><path d='M0 0 1 1'/>")),
              IsOk());
  const auto repeated = [](const std::string& text, int times) {
    std::string all;
    for (int i = 0; i < times; ++i) all += text;
    return all;
  };
  // 131,072 times a megabyte, each of another kind, in half of the visits that are allowed.
  const std::string line = "<path id='u0' d='M0 0 1 1' ";
  for (const std::string& element : {"<path id='u0' d='M0 0" + std::string(500'000, 'z') + "'/>",
                                     line + "transform='" + repeated("scale(1)", 120'000) + "'/>",
                                     line + "class='" + repeated("a ", 500'000) + "'/>",
                                     line + "class='" + repeated("none ", 200'000) + "'/>",
                                     line + "fill='" + std::string(1'000'000, 'x') + "'/>",
                                     "<g id='u0'>" + repeated("<!---->", 150'000) + "</g>"}) {
    std::string uses = "<style>.a{fill:red}</style>" + element;
    for (int i = 1; i < 18; ++i)
      uses += absl::StrCat("<g id='u", i, "'><use href='#u", i - 1, "'/><use href='#u", i - 1,
                           "'/></g>");
    EXPECT_THAT(Error(Svg("<defs>" + uses + "</defs><use href='#u17'/>")), HasSubstr("without end"))
        << element.substr(0, 60);
  }
  // Gradients that have their stops of one that has many.
  std::string gradients = "<linearGradient id='g'>" + repeated("<stop/>", 100'000);
  gradients += "</linearGradient>";
  for (int i = 0; i < 10'000; ++i)
    gradients += absl::StrCat("<linearGradient id='g", i,
                              "' href='#g'/><path d='M0 0 1 1' fill=\"url(#g", i, ")\"/>");
  EXPECT_THAT(Error(Svg(gradients)), HasSubstr("without end"));
}

// What is handed down to a hundred elements within each other is not a hundred times as long as the file.
TEST(SvgStyles, PaintOfNoUseIsNotHandedDown) {
  SvgStyle style;
  style.Set("fill", "red");
  style.Set("fill", std::string(2000, 'x'));
  EXPECT_EQ(style.fill, "red");
  style.Set("fill", "url(#" + std::string(500, 'x') + ")");
  EXPECT_EQ(style.fill.size(), 506u);
}

// Much that is used once is no work without end.
TEST_F(Drawings, ManyElementsAreRead) {
  std::string body = "<style>.a{fill:red}.b{stroke:none}#c{opacity:1}</style>";
  for (int i = 0; i < 100'000; ++i)
    body += "<g class='a b' transform='translate(1 2)' fill='#ff0000' stroke='none'/>\n";
  body += "<path d='M0 0 1 1 2 0z'/>";
  ASSERT_THAT(Import(Svg(body)), IsOk());
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

}  // namespace svg_test
}  // namespace voxeld::voxelctl
