// Tests drawings: which colour is visible where, what is left out, and the errors for broken ones.
#include <fontconfig/fontconfig.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "tests/tools/import/read_here.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/import/rsvg_drawing.h"

namespace voxeld::voxelctl {
namespace svg_test {

using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::ElementsAre;
using ::testing::Gt;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

constexpr Rgb kRed = {255, 0, 0}, kGreen = {0, 255, 0}, kBlue = {0, 0, 255},
              kWhite = {255, 255, 255}, kNothing = {};

// PNG of 2 by 2 red pixels, by Python's struct and zlib.
constexpr char kRedPng[] =
    "iVBORw0KGgoAAAANSUhEUgAAAAIAAAACCAIAAAD91JpzAAAAEElEQVR4nGP4z8AARAwQCgAf7gP9i18U1AAAAABJRU5E"
    "rkJggg==";

std::string Svg(const std::string& content,
                const std::string& attributes = "viewBox='0 0 100 100'") {
  return absl::StrCat(
      "<svg xmlns='http://www.w3.org/2000/svg' xmlns:xlink='http://www.w3.org/1999/xlink' ",
      attributes, ">", content, "</svg>");
}

std::string Times(const std::string& text, int count) {
  std::string all;
  for (int i = 0; i < count; ++i) all += text;
  return all;
}

class Drawings : public testing::Test {
 protected:
  static void SetUpTestSuite() { (void)PrepareDrawings(); }

  absl::StatusOr<Model> Import(const std::string& bytes, uint32_t pixels = 64) {
    ImportOptions options;
    options.pixels = {pixels, pixels};
    return ReadHere(folder_.Write("a.svg", bytes), options);
  }
  Model ReadAll(const std::string& bytes, uint32_t pixels = 64) {
    const auto model = Import(bytes, pixels);
    EXPECT_TRUE(model.ok()) << model.status() << "\n" << bytes;
    if (model.ok() && model->volumes.size() == 1) return *model;
    Model nothing;
    nothing.volumes.push_back({.size = {1, 1, 1}, .samples = {0}, .colors = {Rgb{1, 2, 3}}});
    return nothing;
  }
  std::string Error(const std::string& bytes) {
    return std::string(Import(bytes).status().message());
  }

  // Returns the colour at a part of the width from the left, and of the height from the top.
  static Rgb At(const Model& model, double x, double y) {
    const SampledVolume& volume = model.volumes[0];
    const auto index = [](double share, uint32_t size) {
      return std::min(size - 1, static_cast<uint32_t>(share * size));
    };
    return volume
        .colors[size_t{index(y, volume.size[1])} * volume.size[0] + index(x, volume.size[0])];
  }
  Rgb Seen(const std::string& content, double x = 0.5, double y = 0.5) {
    return At(ReadAll(Svg(content)), x, y);
  }
  // Returns how many pixels have the colour.
  static int64_t Count(const Model& model, const Rgb& color) {
    return std::count(model.volumes[0].colors.begin(), model.volumes[0].colors.end(), color);
  }

  TempFolder folder_;
};

// The picture is upright: x is to the right, and z is up after the rotation that makes y point up.
TEST_F(Drawings, LieUprightInOnePlane) {
  const Model model =
      ReadAll(Svg("<rect width='20' height='10' fill='red'/>", "width='40' height='10'"));
  EXPECT_EQ(model.up, Up::kY);
  const SampledVolume& volume = model.volumes[0];
  EXPECT_THAT(volume.size, ElementsAre(64, 16, 1));
  EXPECT_EQ(volume.samples.size(), 64u * 16);
  EXPECT_EQ(At(model, 0.25, 0.5), kRed);
  EXPECT_EQ(At(model, 0.75, 0.5), kNothing);
  // Pixel 0 is at the upper left corner.
  EXPECT_NEAR(volume.corners[0].x, 0, 1e-9);
  EXPECT_NEAR(volume.corners[0].y, 0, 1e-9);
  EXPECT_NEAR(volume.corners[3].x, 40, 1e-9);
  EXPECT_NEAR(volume.corners[3].y, -10, 1e-9);
}

TEST_F(Drawings, ViewBoxesOfInnerDrawings) {
  const std::string frame =
      "<rect width='100' height='100' fill='none' stroke='#0000ff' stroke-width='4'/>";
  const auto quarter = [&](const std::string& content) {
    const Model model = ReadAll(Svg(frame + content));
    EXPECT_EQ(At(model, 0.75, 0.75), kRed) << content;
    EXPECT_EQ(At(model, 0.52, 0.52), kRed) << content;
    EXPECT_EQ(At(model, 0.45, 0.75), kNothing) << content;
    EXPECT_EQ(At(model, 0.75, 0.45), kNothing) << content;
    EXPECT_EQ(At(model, 0.0, 0.3), kBlue) << content;
  };
  const std::string square = "<rect width='10' height='10' fill='#ff0000'/>";
  quarter("<svg x='50' y='50' width='50' height='50' viewBox='0 0 10 10'>" + square + "</svg>");
  quarter("<svg x='50%' y='50%' width='50%' height='50%' viewBox='0 0 10 10'>" + square + "</svg>");
  const std::string symbol = "<symbol id='s' viewBox='0 0 10 10'>" + square + "</symbol>";
  quarter(symbol + "<use href='#s' x='50' y='50' width='50' height='50'/>");
  quarter(symbol + "<use xlink:href='#s' x='50%' y='50%' width='50%' height='50%'/>");
  quarter(
      symbol +
      "<g transform='translate(50,50) scale(.5)'><use href='#s' width='100' height='100'/></g>");
  // The wider box is fitted into the square in different ways.
  const auto in_square = [&](const std::string& aspect) {
    return ReadAll(Svg("<svg width='100' height='100' viewBox='0 0 20 10' preserveAspectRatio='" +
                       aspect +
                       "'><rect width='10' height='10' fill='red'/><rect x='10' width='10' "
                       "height='10' fill='lime'/></svg>"));
  };
  Model model = in_square("xMidYMid meet");
  EXPECT_EQ(At(model, 0.25, 0.1), kNothing);
  EXPECT_EQ(At(model, 0.25, 0.5), kRed);
  EXPECT_EQ(At(model, 0.75, 0.7), kGreen);
  model = in_square("xMinYMin meet");
  EXPECT_EQ(At(model, 0.25, 0.1), kRed);
  EXPECT_EQ(At(model, 0.25, 0.6), kNothing);
  model = in_square("xMaxYMax");
  EXPECT_EQ(At(model, 0.25, 0.4), kNothing);
  EXPECT_EQ(At(model, 0.75, 0.9), kGreen);
  model = in_square("xMaxYMid slice");
  EXPECT_EQ(At(model, 0.1, 0.1), kGreen);
  model = in_square("xMinYMid slice");
  EXPECT_EQ(At(model, 0.9, 0.9), kRed);
  model = in_square("none");
  EXPECT_EQ(At(model, 0.25, 0.05), kRed);
  EXPECT_EQ(At(model, 0.75, 0.95), kGreen);
}

TEST_F(Drawings, SizesOfThePage) {
  const std::string square = "<rect width='100' height='100' fill='red'/>";
  const auto size = [&](const std::string& attributes) {
    const Model model = ReadAll(Svg(square, attributes));
    EXPECT_GT(Count(model, kRed), 0) << attributes;
    return std::vector<uint32_t>{model.volumes[0].size[0], model.volumes[0].size[1]};
  };
  const std::string box = " viewBox='0 0 100 100'";
  EXPECT_THAT(size("width='200' height='100' preserveAspectRatio='none'" + box),
              ElementsAre(64, 32));
  EXPECT_THAT(size("width='200' height='100'" + box), ElementsAre(64, 32));
  EXPECT_THAT(size("width='1in' height='48px'" + box), ElementsAre(64, 32));
  EXPECT_THAT(size("width='25.4mm' height='72pt'" + box), ElementsAre(64, 64));
  EXPECT_THAT(size("width='100%' height='100%' viewBox='0 0 50 100'"), ElementsAre(32, 64));
  EXPECT_THAT(size("viewBox='0 0 400 100'"), ElementsAre(64, 16));
  EXPECT_EQ(Count(ReadAll(Svg(square, "width='200' height='100' preserveAspectRatio='none'" + box)),
                  kRed),
            64 * 32);
  // Without a size, it is as large as its contents, wherever they are.
  const Model model = ReadAll(Svg("<rect x='-70' y='900' width='20' height='10' fill='red'/>", ""));
  EXPECT_THAT(model.volumes[0].size, ElementsAre(64, 32, 1));
  EXPECT_EQ(Count(model, kRed), 64 * 32);
  EXPECT_NEAR(model.volumes[0].corners[0].x, -70, 1e-6);
  EXPECT_NEAR(model.volumes[0].corners[0].y, -900, 1e-6);
  // Also where librsvg draws a part on a surface of its own, and with percentages.
  for (const char* offset : {"0", "-70", "900"}) {
    const Model half = ReadAll(Svg(absl::StrCat("<g opacity='.5'><rect x='", offset,
                                                "' y='5' width='.2' height='.1' fill='red'/></g>"),
                                   ""));
    EXPECT_EQ(Count(half, Rgb{128, 0, 0}), 64 * 32) << offset;
  }
  const std::string half =
      "<g opacity='.5'><rect x='-7' y='5' width='2' height='1' fill='red'/></g>";
  for (const char* before : {"", "<?xml version='1.0'?>\n<!-- <svg> ' -->", "\xef\xbb\xbf",
                             "<?a <svg?><!DOCTYPE svg SYSTEM \"]>[\" [ <!ENTITY a \"'\"> <!-- ' "
                             "> --> <?b ] > ?> ]>"}) {
    EXPECT_EQ(Count(ReadAll(before + Svg(half, "")), Rgb{128, 0, 0}), 64 * 32) << before;
  }
  EXPECT_EQ(Count(ReadAll("<s:svg xmlns:s='http://www.w3.org/2000/svg'><s:g opacity='.5'><s:rect "
                          "x='-7' width='2' height='1' "
                          "fill='red'/></s:g></s:svg>"),
                  Rgb{128, 0, 0}),
            64 * 32);
  EXPECT_EQ(Count(ReadAll(Svg("<rect width='50%' height='25%' fill='red'/>", "")), kRed), 64 * 32);
  const Model line = ReadAll(Svg("<path d='M0 0H9' stroke='red'/>", ""));
  EXPECT_GT(Count(line, kRed), 60);
  EXPECT_THAT(Error(Svg(square, "width='0' height='5'")), HasSubstr("is 0 wide and 5 high"));
  EXPECT_THAT(ReadAll(Svg(square), 0).volumes[0].size, ElementsAre(1, 1, 1));
}

TEST_F(Drawings, ColoursOfCss) {
  const auto color = [this](const std::string& paint) {
    return Seen("<rect width='100' height='100' fill='" + paint + "'/>");
  };
  EXPECT_EQ(color("hsl(120,100%,50%)"), kGreen);
  EXPECT_EQ(color("hsl(0 100% 50%)"), kRed);
  EXPECT_EQ(color("hsla(240, 100%, 50%, 1)"), kBlue);
  EXPECT_EQ(color("hsl(-120,100%,50%)"), kBlue);
  EXPECT_EQ(color("rgb(100%,0%,0%)"), kRed);
  EXPECT_EQ(color("rgb(0,255,0)"), kGreen);
  EXPECT_EQ(color("#00F"), kBlue);
  EXPECT_EQ(color("RebeccaPurple"), (Rgb{0x66, 0x33, 0x99}));
  EXPECT_EQ(color("darkslategrey"), (Rgb{47, 79, 79}));
  EXPECT_EQ(Seen("<g color='#ff0000'><rect width='100' height='100' fill='currentColor'/></g>"),
            kRed);
  // Half opaque means half as bright.
  for (const char* half :
       {"fill='rgba(255,0,0,.5)'", "fill='#ff000080'", "fill='red' fill-opacity='.5'",
        "fill='red' opacity='50%'", "style='fill:red;opacity:.5'"}) {
    const Rgb seen = Seen(absl::StrCat("<rect width='100' height='100' ", half, "/>"));
    EXPECT_NEAR(seen.r, 128, 1) << half;
    EXPECT_EQ(seen.g, 0) << half;
  }
  const std::string green = "<rect width='100' height='100' fill='#00ff00'/>",
                    over = "<rect x='25' y='25' width='50' height='50' fill='";
  EXPECT_EQ(Seen(green + over + "#ff000000'/>"), kGreen);
  EXPECT_EQ(Seen(green + over + "#f000'/>"), kGreen);
  EXPECT_EQ(Seen(green + over + "transparent'/>"), kGreen);
  EXPECT_EQ(Seen(green + over + "none'/>"), kGreen);
  EXPECT_EQ(Seen(green + over + "rgba(255,0,0,0)'/>"), kGreen);
  EXPECT_EQ(Seen(green + over + "red'/>"), kRed);
}

// Where two shapes in a group cover each other, the lower one is not visible through the upper.
TEST_F(Drawings, OpacityOfGroups) {
  const Rgb seen = Seen(
      "<g opacity='.5'><rect width='100' height='100' fill='red'/>"
      "<rect width='100' height='100' fill='lime'/></g>");
  EXPECT_EQ(seen.r, 0);
  EXPECT_NEAR(seen.g, 128, 1);
}

TEST_F(Drawings, WhatIsNotDisplayed) {
  const std::string green = "<rect width='100' height='100' fill='#00ff00'/>",
                    red = "<rect width='100' height='100' fill='#ff0000' display='inline'/>";
  for (const std::string& content :
       {"<g display='none'>" + red + "</g>", "<g style='display:none'>" + red + "</g>",
        "<style>.h{display:none}</style><g class='h'>" + red + "</g>",
        "<g visibility='hidden'>" + red + "</g>", "<defs>" + red + "</defs>",
        "<symbol id='s'>" + red + "</symbol>", "<marker id='m'>" + red + "</marker>",
        "<pattern id='p' width='10' height='10'>" + red + "</pattern>",
        "<clipPath id='c'>" + red + "</clipPath>", "<mask id='k'>" + red + "</mask>",
        std::string("<linearGradient id='g'><stop stop-color='#ff0000'/></linearGradient>"),
        "<switch><g systemLanguage='xx'>" + red + "</g></switch>"}) {
    const Model model = ReadAll(Svg(green + content));
    EXPECT_EQ(Count(model, kGreen), 64 * 64) << content;
    EXPECT_THAT(model.left_out, IsEmpty()) << content;
  }
  EXPECT_EQ(Seen(green + "<g visibility='hidden'><rect width='100' height='100' fill='red' "
                         "visibility='visible'/></g>"),
            kRed);
}

TEST_F(Drawings, SelectorsOfStyleSheets) {
  const auto two = [this](const std::string& style) {
    const Model model =
        ReadAll(Svg("<style>" + style +
                    "</style><g class='a' id='i'><rect width='40' height='100'/></g>"
                    "<rect class='b d' x='60' width='40' height='100' fill='yellow'/>"));
    EXPECT_EQ(At(model, 0.2, 0.5), kRed) << style;
    EXPECT_EQ(At(model, 0.8, 0.5), kGreen) << style;
    EXPECT_THAT(model.left_out, IsEmpty()) << style;
  };
  two("g.a rect { fill: #ff0000 } @media print { rect { fill: #0000ff } } rect.b, .c > rect { "
      "fill: #00ff00 }");
  two(".a > rect {fill:red} .b.d {fill:lime}");
  two("#i rect {fill:red} g + rect {fill:lime}");
  two("rect {fill:red} [class~='d'] {fill:lime}");
  two("rect {fill:lime} rect:first-child {fill:red}");
  two("/* x */ * {fill:red} rect.b {fill:lime} .b {fill:blue}");
  two("<![CDATA[ .a rect {fill:red!important} .a rect {fill:blue} .b {fill:lime} ]]>");
  // A style attribute takes precedence over a rule, and a rule over an attribute.
  EXPECT_EQ(Seen("<style>rect{fill:blue}</style><rect width='100' height='100' fill='lime' "
                 "style='fill:red'/>"),
            kRed);
}

TEST_F(Drawings, EntitiesOfText) {
  const std::string svg =
      "<?xml version='1.0' encoding='utf-8'?>\n<!DOCTYPE svg PUBLIC '-//W3C//DTD SVG 1.0//EN' "
      "'http://www.w3.org/TR/2001/REC-SVG-20010904/DTD/svg10.dtd' [ <!ENTITY ns_svg "
      "'http://www.w3.org/2000/svg'> "
      "<!ENTITY st0 'fill:#FF0000;'> <!ENTITY st1 'fill:#00FF00;'> ]>\n"
      "<svg xmlns='&ns_svg;' viewBox='0 0 100 100'><rect style='&st0;' width='40' height='100'/>"
      "<rect style='&st1;' x='60' width='40' height='100'/></svg>";
  const Model model = ReadAll(svg);
  EXPECT_EQ(At(model, 0.2, 0.5), kRed);
  EXPECT_EQ(At(model, 0.8, 0.5), kGreen);
}

TEST_F(Drawings, ShapesAndPercentages) {
  // For a circle of radius 40 in 100: π·40² of 100² pixels.
  const auto is_circle = [this](const std::string& circle) {
    const Model model = ReadAll(Svg(circle));
    EXPECT_EQ(At(model, 0.5, 0.5), kRed) << circle;
    EXPECT_EQ(At(model, 0.5, 0.15), kRed) << circle;
    EXPECT_EQ(At(model, 0.15, 0.15), kNothing) << circle;
    double light = 0;
    for (const Rgb& c : model.volumes[0].colors) light += c.r / 255.0;
    EXPECT_NEAR(light / (64 * 64), 0.5027, 0.01) << circle;
  };
  is_circle("<circle cx='50%' cy='50%' r='40' fill='#ff0000'/>");
  is_circle("<circle cx='50' cy='50' r='40%' fill='#ff0000'/>");
  is_circle("<ellipse cx='50%' cy='50' rx='40' ry='40%' fill='#ff0000'/>");
  is_circle("<rect x='10' y='10%' width='80%' height='80' rx='40' fill='#ff0000'/>");
  is_circle("<rect x='10' y='10' width='80' height='80' rx='auto' ry='40' fill='#ff0000'/>");
  is_circle("<rect x='10' y='10' width='80' height='80' rx='99' ry='99' fill='#ff0000'/>");
  is_circle("<circle cx='50' cy='50' r='20' fill='none' stroke='red' stroke-width='40'/>");
  for (const char* flags :
       {"a40 40 0 0180 0a40 40 0 01-80 0z", "a 40 40 0 0 1 80 0 a 40 40 0 0 1 -80 0 z",
        "a40,40,0,0,1,80,0a40,40,0,0,1,-80,0", "a40 40 0 01 80 0 40 40 0 01-80 0",
        "a40 40 0 1180,0a4e1.4e2 0 11-80 0z"}) {
    is_circle(absl::StrCat("<path d='M10 50", flags, "' fill='#ff0000'/>"));
  }
  const std::string star = "<path d='M50 0L79 90 2 35 98 35 21 90z' fill='red' fill-rule='";
  EXPECT_EQ(Seen(star + "nonzero'/>"), kRed);
  EXPECT_EQ(Seen(star + "evenodd'/>"), kNothing);
}

// Errors in path data: everything before them is drawn.
TEST_F(Drawings, PathsEndWhereTheyAreWrong) {
  const std::string square = "M0 0L100 0L100 100L0 100z";
  for (const char* error :
       {" M20 20 L 30 oops", " L", " M1", "x", " A1 1 0 2 0 5 5", " C1 1 2 2", "\xc3\xa9"}) {
    const Model model = ReadAll(Svg("<path d='" + square + error + "' fill='#ff0000'/>"));
    EXPECT_EQ(Count(model, kRed), 64 * 64) << error;
  }
  EXPECT_EQ(Seen("<path d='L9 9' fill='red'/><rect width='100' height='100' fill='lime'/>"),
            kGreen);
}

TEST_F(Drawings, PaintServersClipsMasksAndMarkers) {
  const std::string area = "<rect width='100' height='100' ";
  const std::string stops =
      "<stop offset='0' stop-color='red'/><stop offset='1' stop-color='blue'/>";
  const Model gradient = ReadAll(
      Svg("<linearGradient id='g'>" + stops + "</linearGradient>" + area + "fill='url(#g)'/>"));
  EXPECT_GT(At(gradient, 0, 0.5).r, 240);
  EXPECT_GT(At(gradient, 1, 0.5).b, 240);
  EXPECT_NEAR(At(gradient, 0.5, 0.5).r, 127, 4);
  EXPECT_EQ(Seen("<radialGradient id='a'>" + stops +
                     "</radialGradient><radialGradient id='g' r='.1' xlink:href='#a'/>" + area +
                     "fill='url(#g)'/>",
                 0.9, 0.9),
            kBlue);
  EXPECT_EQ(Seen(area + "fill='url(#none) lime'/>"), kGreen);
  const Model tiles =
      ReadAll(Svg("<pattern id='p' width='50' height='50' patternUnits='userSpaceOnUse'><rect "
                  "width='25' height='50' fill='red'/></pattern>" +
                  area + "fill='url(#p)'/>"));
  EXPECT_EQ(At(tiles, 0.6, 0.9), kRed);
  EXPECT_EQ(At(tiles, 0.9, 0.1), kNothing);
  const Model clip = ReadAll(Svg("<clipPath id='c'><circle cx='50' cy='50' r='40'/></clipPath>" +
                                 area + "fill='red' clip-path='url(#c)'/>"));
  EXPECT_EQ(At(clip, 0.5, 0.5), kRed);
  EXPECT_EQ(At(clip, 0.1, 0.1), kNothing);
  const Model mask =
      ReadAll(Svg("<mask id='m'><rect width='50' height='100' fill='white'/></mask>" + area +
                  "fill='red' mask='url(#m)'/>"));
  EXPECT_EQ(At(mask, 0.25, 0.5), kRed);
  EXPECT_EQ(At(mask, 0.75, 0.5), kNothing);
  const Model marker =
      ReadAll(Svg("<marker id='m' markerUnits='userSpaceOnUse' markerWidth='20' markerHeight='20' "
                  "refX='10' refY='10'>"
                  "<rect width='20' height='20' fill='lime'/></marker><path d='M10 50H90' "
                  "stroke='red' stroke-width='8' marker-end='url(#m)'/>"));
  EXPECT_EQ(At(marker, 0.5, 0.5), kRed);
  EXPECT_EQ(At(marker, 0.9, 0.43), kGreen);
  EXPECT_EQ(At(marker, 0.1, 0.43), kNothing);
}

// A stroke that is thinner than a pixel is as bright as one that fills it, but a half-opaque one is
// not.
TEST_F(Drawings, ThinStrokesAreBright) {
  const auto brightest = [this](const std::string& stroke) {
    const Model model =
        ReadAll(Svg("<path d='M10 10L90 43' fill='none' stroke='red' " + stroke + "/>"));
    uint8_t most = 0;
    for (const Rgb& c : model.volumes[0].colors) most = std::max(most, c.r);
    return most;
  };
  EXPECT_EQ(brightest("stroke-width='.4'"), 255) << "a quarter of a pixel";
  EXPECT_GT(brightest("stroke-width='.1'"), 60);
  EXPECT_NEAR(brightest("stroke-width='.4' stroke-opacity='.5'"), 128, 2);
  EXPECT_NEAR(brightest("stroke-width='5' stroke-opacity='.5'"), 128, 2);
  // Along a row of pixels, at any position.
  for (int i = 0; i < 16; ++i) {
    const Model model = ReadAll(
        Svg(absl::StrCat("<path d='M0 ", 50 + i * 0.1, "H100' stroke='red' stroke-width='1'/>")));
    uint8_t most = 0;
    for (int y = 0; y < 64; ++y) most = std::max(most, At(model, 0.5, (y + 0.5) / 64).r);
    EXPECT_GE(most, 250) << i;
  }
  // Edges of areas stay where they are: three eighths of a pixel are partially covered.
  const Model area = ReadAll(Svg("<rect x='12.5' width='50.5859375' height='100' fill='red'/>"));
  EXPECT_NEAR(At(area, 40.5 / 64, 0.5).r, 96, 8);
}

TEST_F(Drawings, InkAndPaper) {
  const std::string sheet = "<rect width='100' height='100' fill='#fff'/>",
                    ink = "<rect x='10' y='10' width='30' height='30'/>",
                    red = "<rect x='60' y='60' width='30' height='30' fill='red'/>";
  Model model = ReadAll(Svg(ink));
  EXPECT_EQ(At(model, 0.25, 0.25), kWhite) << "black ink is white light";
  EXPECT_EQ(At(model, 0.75, 0.75), kNothing);
  EXPECT_THAT(model.note, HasSubstr("all of it is dark, so it is shown in white"));
  model =
      ReadAll(Svg("<rect x='10' y='10' width='30' height='30' fill='#111' fill-opacity='.5'/>"));
  EXPECT_NEAR(At(model, 0.25, 0.25).r, 128, 1);
  // Dark grey with soft edges, and almost nothing else.
  model = ReadAll(Svg(
      "<circle cx='50' cy='50' r='40' fill='#2e3436'/><rect width='2' height='2' fill='red'/>"));
  EXPECT_EQ(At(model, 0.5, 0.5), kWhite);
  EXPECT_EQ(At(model, 0, 0), kRed);
  EXPECT_EQ(model.note, "all of it is dark, so it is shown in white");
  model = ReadAll(Svg(sheet + ink + red));
  EXPECT_THAT(model.note, HasSubstr("the white sheet behind all is left out"));
  EXPECT_EQ(At(model, 0.25, 0.25), kWhite);
  EXPECT_EQ(At(model, 0.75, 0.75), kRed);
  EXPECT_EQ(At(model, 0.5, 0.5), kNothing);
  EXPECT_EQ(At(model, 0, 0), kNothing);
  // A sheet that does not fill the page, and one of nearly white.
  model = ReadAll(Svg("<rect x='5' y='5' width='90' height='70' fill='#f8f8f8'/>" + ink));
  EXPECT_EQ(At(model, 0.25, 0.25), kWhite);
  EXPECT_EQ(Count(model, kWhite), Count(ReadAll(Svg(ink)), kWhite));
  // Thin lines of a plot, and grey ones.
  model = ReadAll(
      Svg(sheet + "<path d='M10 10V90H90' fill='none' stroke='black' stroke-width='.5'/>" + red));
  EXPECT_GT(At(model, 0.1, 0.5).r, 200);
  EXPECT_EQ(At(model, 0.5, 0.5), kNothing);
  // A flag has nothing dark; its white is intended.
  model = ReadAll(Svg(sheet + red));
  EXPECT_EQ(model.note, "");
  EXPECT_EQ(At(model, 0.2, 0.2), kWhite);
  // A black page with white on it is unchanged.
  model =
      ReadAll(Svg("<rect width='100' height='100'/><circle cx='50' cy='50' r='20' fill='white'/>"));
  EXPECT_EQ(At(model, 0.5, 0.5), kWhite);
  EXPECT_EQ(At(model, 0.1, 0.1), kNothing);
  EXPECT_THAT(model.note,
              HasSubstr("87 % of what is painted is dark, which a display does not show"));
  // Transparent paper with black and red on it.
  model = ReadAll(Svg(ink + red));
  EXPECT_EQ(At(model, 0.75, 0.75), kRed);
  EXPECT_THAT(model.note, HasSubstr("50 % of what is painted is dark"));
}

TEST_F(Drawings, TextsAreDrawnWithFonts) {
  const std::string text = "<text x='5' y='80' font-size='90' fill='red'>M</text>";
  const Model drawn = ReadAll(Svg(text));
  EXPECT_GT(Count(drawn, kRed), 200);
  EXPECT_THAT(drawn.left_out, IsEmpty());
  // If no font is found, texts are counted.
  FcConfig* const all = FcConfigReference(nullptr);
  FcConfig* const none = FcConfigCreate();
  ASSERT_NE(FcConfigSetCurrent(none), FcFalse);
  const auto left_out = Import(Svg(text + text + "<rect width='9' height='9' fill='red'/>"));
  const std::string error = Error(Svg(text));
  EXPECT_NE(FcConfigSetCurrent(all), FcFalse);
  FcConfigDestroy(all);
  ASSERT_THAT(left_out, IsOk());
  EXPECT_THAT(left_out->left_out, ElementsAre(LeftOut{"texts", 2}));
  EXPECT_THAT(error, HasSubstr("has nothing that is to be seen (left out: texts (1))"));
}

// librsvg would terminate the process, or need minutes.
TEST_F(Drawings, TextsThatAreTooLargeOrTooLongAreCounted) {
  const std::string area = "<rect width='100' height='100' fill='lime'/>";
  for (const std::string& text :
       {std::string("<text font-size='1e30'>H</text>"),
        std::string("<text font-size='9999999'>H</text>"),
        std::string("<text font-size='99999in'>H</text>"),
        std::string("<text style='font-size : 99999920px'>H</text>"),
        std::string("<text style='font:bold 99999920px/1 serif'>H</text>"),
        std::string("<style>text{font-size:3000000}</style><text>H</text>"),
        Times("<g font-size='2em'>", 40) + "<text>H</text>" + Times("</g>", 40),
        Times("<g style='font-size:300%'>", 40) + "<text>H</text>" + Times("</g>", 40),
        "<text>" + Times("H", 20'000) + "</text>",
        "<text>" + Times("<tspan>H </tspan>", 2000) + "</text>"}) {
    const Model model = ReadAll(Svg(area + text));
    EXPECT_EQ(Count(model, kGreen), 64 * 64) << text.substr(0, 80);
    EXPECT_THAT(model.left_out, ElementsAre(LeftOut{"texts", 1})) << text.substr(0, 80);
  }
  for (const std::string& text :
       {std::string("<text font-size='1e3'>H</text>"),
        std::string("<text font-size='2in' style='font:italic 1.2em/2 serif'>H</text>"),
        Times("<g font-size='90%'>", 40) + "<text>H</text>" + Times("</g>", 40),
        "<text>" + Times("H ", 500) + "</text><desc>" + Times("H", 20'000) + "</desc>"}) {
    EXPECT_THAT(ReadAll(Svg(area + text)).left_out, IsEmpty()) << text.substr(0, 80);
  }
}

// The program that reads untrusted files reads fonts, and nothing else.
TEST_F(Drawings, TextsAreDrawnInTheSandbox) {
  for (const OtherFiles others : {OtherFiles::kBelow, OtherFiles::kNone}) {
    ImportOptions options;
    options.other_files = others;
    options.pixels = {64, 64};
    const auto model = ImportFile(
        folder_.Write("a.svg", Svg("<text x='5' y='80' font-size='90' fill='red'>M</text>")),
        options);
    ASSERT_THAT(model, IsOk());
    EXPECT_GT(Count(*model, kRed), 200);
    EXPECT_THAT(model->left_out, IsEmpty());
  }
}

TEST_F(Drawings, WhatIsNotDrawnIsCounted) {
  const std::string area = "<rect width='100' height='100' fill='lime'/>";
  const auto left_out = [&](const std::string& content) {
    const Model model = ReadAll(Svg(area + content));
    EXPECT_GT(Count(model, kGreen), 0) << content;
    return model.left_out;
  };
  EXPECT_THAT(left_out("<script>1</script><script href='a.js'/>"),
              ElementsAre(LeftOut{"scripts", 2}));
  EXPECT_THAT(
      left_out("<rect width='9' height='9' fill='red'><animate attributeName='x'/><set/></rect>"
               "<circle r='1' "
               "fill='red'><animateTransform/><animateMotion><mpath/></animateMotion></circle>"),
      ElementsAre(LeftOut{"animations", 4}));
  EXPECT_THAT(left_out("<foreignObject><p xmlns='http://www.w3.org/1999/xhtml'>a<svg "
                       "xmlns='http://www.w3.org/2000/svg'>"
                       "<script/></svg></p></foreignObject><script/>"),
              ElementsAre(LeftOut{"foreign objects", 1}, LeftOut{"scripts", 1}));
  EXPECT_THAT(
      left_out("<switch><foreignObject "
               "requiredExtensions='http://ns.adobe.com/AdobeIllustrator/10.0/'/><g/></switch>"),
      IsEmpty());
  EXPECT_THAT(left_out("<path id='p' d='M0 0H9'/><text><textPath href='#p'>a</textPath></text>"),
              ElementsAre(LeftOut{"texts along paths", 1}));
  EXPECT_THAT(
      left_out(
          "<filter id='f'><feTurbulence numOctaves='2000000000'/></filter><rect width='9' "
          "height='9' "
          "fill='red' filter='url(#f)'/><g style='fill:red; filter : blur(2px)'/><g filter='none'/>"
          "<style>g{filter:url(#f)} a{filter:none} b{backdrop-filter:x}</style>"),
      ElementsAre(LeftOut{"filters", 3}, LeftOut{"backdrop-filter properties", 1}));
  EXPECT_THAT(
      left_out("<hatch/><hatch><hatchpath/></hatch><meshgradient/>"),
      UnorderedElementsAre(LeftOut{"<hatch> elements", 2}, LeftOut{"<meshgradient> elements", 1}));
  EXPECT_THAT(left_out("<use href='#nobody'/><use href='b.svg#a'/>"),
              UnorderedElementsAre(LeftOut{"uses of elements that are missing", 1},
                                   LeftOut{"elements of other files", 1}));
  EXPECT_THAT(
      left_out("<style>@import url(a.css); @font-face{font-family:a} @media screen{rect{fill:red}} "
               "@media print{a{}} @media (prefers-color-scheme: dark){a{}} @keyframes k{} "
               "a{fill:var(--x)}</style>"),
      UnorderedElementsAre(LeftOut{"imported style sheets", 1}, LeftOut{"fonts", 1},
                           LeftOut{"@media rules", 1}, LeftOut{"animations", 1},
                           LeftOut{"values with var()", 1}));
  EXPECT_THAT(
      left_out("<metadata><a xmlns='x:y'/></metadata><title>a</title><desc/><view/>"
               "<n:namedview xmlns:n='http://sodipodi.sourceforge.net/DTD/sodipodi-0.dtd'/>"),
      IsEmpty());
  std::string many;
  for (int i = 0; i < 100; ++i) absl::StrAppend(&many, "<x", i, "/>");
  EXPECT_THAT(left_out(many),
              AllOf(testing::SizeIs(21), testing::Contains(LeftOut{"other elements", 80})));
}

// Features of SVG 2 and CSS that librsvg 2.54 ignores, in attributes, styles and style sheets.
TEST_F(Drawings, PropertiesThatAreNotDrawnAreCounted) {
  const auto left_out = [&](const std::string& content, const std::string& page = "") {
    return ReadAll(Svg("<rect width='100' height='100' fill='lime'/>" + content,
                       "viewBox='0 0 100 100' " + page))
        .left_out;
  };
  const auto rect = [](const std::string& attributes) {
    return "<rect width='9' height='9' fill='red' " + attributes + "/>";
  };
  const auto one = [](const std::string& kind) { return ElementsAre(LeftOut{kind, 1}); };
  EXPECT_THAT(left_out(rect("transform='scale(0.5)' transform-origin='100 100'")),
              one("transform-origin attributes"));
  EXPECT_THAT(left_out(rect("style='transform-origin: center;'")),
              one("transform-origin properties"));
  EXPECT_THAT(left_out(rect("vector-effect='non-scaling-stroke'")),
              one("vector-effect attributes"));
  EXPECT_THAT(left_out(rect("style='clip-path: circle(10px at 20px 20px)'")),
              one("values with circle()"));
  EXPECT_THAT(left_out(rect("clip-path='inset(3px)'")), one("values with inset()"));
  EXPECT_THAT(left_out(rect("style='fill:red; mask: linear-gradient(red, blue)'")),
              one("values with linear-gradient()"));
  EXPECT_THAT(left_out("<path style=\"d: path('M50 50; H100')\"/>"), one("d properties"));
  EXPECT_THAT(left_out(rect("style='width: calc(50%)'")), one("values with calc()"));
  EXPECT_THAT(left_out("<g fill='var(--a, blue)'/>"), one("values with var()"));
  EXPECT_THAT(left_out("<g stroke='oklch(60% .2 200)'/>"), one("values with oklch()"));
  EXPECT_THAT(left_out(rect("style='rotate:30deg;zoom:1'")), one("rotate properties"));
  EXPECT_THAT(left_out(rect("style='transform:translate(10%)'")), one("transform properties"));
  EXPECT_THAT(left_out(rect("transform='scale(2)' style='transform:translate(1px)'")),
              one("transform properties"));
  EXPECT_THAT(left_out("<path d='M0 0H9' pathLength='1'/>"), one("pathLength attributes"));
  EXPECT_THAT(left_out("<symbol refX='3'/>"), one("refX attributes"));
  EXPECT_THAT(left_out("<text textLength='90'>a</text>"), one("textLength attributes"));
  EXPECT_THAT(left_out("<text><tspan rotate='30'>a</tspan></text>"), one("rotate attributes"));
  EXPECT_THAT(left_out("<text x='1 2 3' y='4'>abc</text>"), one("positions of single letters"));
  EXPECT_THAT(left_out("<text style='dominant-baseline:hanging'>a</text>"),
              one("dominant-baseline properties"));
  EXPECT_THAT(left_out("", "style='background: #000'"), one("background properties"));
  EXPECT_THAT(
      left_out("<style>/* d: 1; */ svg{background-color:red} a:hover , b{ vector-effect : "
               "fixed-position !important; fill:url(#a;b(c))} c{d:none;zoom:2} "
               "@media print{e{zoom:3}} f{fill:color-mix(in srgb, red, rgb(0,0,0))}</style>"),
      UnorderedElementsAre(LeftOut{"background-color properties", 1},
                           LeftOut{"vector-effect properties", 1}, LeftOut{"zoom properties", 1},
                           LeftOut{"values with color-mix()", 1}));
  std::string many;
  for (int i = 0; i < 100; ++i) absl::StrAppend(&many, "<g fill='f", i, "()'/>");
  EXPECT_THAT(left_out(many),
              AllOf(testing::SizeIs(41), testing::Contains(LeftOut{"other properties", 60})));
}

// Initial values, as Inkscape writes them, and properties that do not affect a still picture.
TEST_F(Drawings, PropertiesWithoutEffectAreNotCounted) {
  const std::string style =
      "font-variant-caps:normal;word-spacing:0px;white-space:normal;inline-size:0;"
      "vector-effect:none;dominant-baseline:auto;transform-origin:0 0;color-interpolation:sRGB;"
      "clip-path:none;mask:none;-inkscape-font-specification:\"a(b)\";cursor:pointer;"
      "animation:a 2s cubic-bezier(1,2,3,4);--own:calc(1px);background:#fff;"
      "fill:rgb(0 0 0);stroke:url(#a) hsl(1,2%,3%);transform:translateX(3px) rotate(3deg)";
  EXPECT_THAT(ReadAll(Svg("<rect width='100' height='100' fill='lime'/><g style='" + style +
                          "' data-name='a (calc(1))' onclick='f()'><text x=' 5 ' rotate='0'/></g>"
                          "<g transform='rotate(3)'/><style>g{" +
                          style + "} @keyframes k{}</style>"))
                  .left_out,
              ElementsAre(LeftOut{"animations", 1}));
}

TEST_F(Drawings, PicturesOfTheFileAreDrawnAndOthersAreNot) {
  const std::string image = "<image width='100' height='100' ";
  const std::string png = absl::StrCat("data:image/png;base64,", kRedPng);
  const Model drawn =
      ReadAll(Svg(image + "href='" + png + "'/>" + image + "xlink:href=' " + png + "'/>"));
  EXPECT_EQ(At(drawn, 0.5, 0.5), kRed);
  EXPECT_THAT(drawn.left_out, IsEmpty());
  // A PNG file beside the drawing, referred to in every way; nothing red appears.
  std::string bytes;
  ASSERT_TRUE(absl::Base64Unescape(kRedPng, &bytes));
  const std::string path = folder_.Write("red.png", bytes);
  folder_.Write("red.css", "rect{fill:red}");
  folder_.Write("red.svg", Svg("<rect id='r' width='100' height='100' fill='red'/>"));
  const std::string area = "<rect width='100' height='100' fill='lime'/>";
  for (const std::string& content :
       {image + "href='red.png'/>", image + "href='" + path + "'/>",
        image + "xlink:href='file://" + path + "'/>", image + "href='http://127.0.0.1:1/red.png'/>",
        image + "href='./red.png?.png'/>",
        std::string("<style>@import url(red.css); @import 'red.css';</style>"),
        std::string("<use href='red.svg#r'/>"),
        std::string("<rect width='100' height='100' fill='url(red.svg#r) none'/>"),
        "<filter id='f'><feImage href='" + path + "'/></filter><g filter='url(#f)'>" + area +
            "</g>",
        image + "href='data:image/svg+xml;base64," +
            absl::Base64Escape(Svg("<rect width='9' height='9' fill='red'/>")) + "'/>",
        image + "href='data:image/gif;base64,R0lGODlhAQABAIAAAP8AAP///"
                "yH5BAAAAAAALAAAAAABAAEAAAICRAEAOw=='/>",
        image + "href='" + png.substr(0, 60) + "'/>",
        image + "href='data:image/png;base64,/9j/'/>"}) {
    const Model model = ReadAll(Svg(area + content));
    EXPECT_EQ(Count(model, kGreen), 64 * 64) << content;
    EXPECT_TRUE(!model.left_out.empty() || content.find("fill='url(red.svg") != std::string::npos)
        << content;
  }
  EXPECT_THAT(ReadAll("<?xml-stylesheet href='red.css'?>" + Svg(area)).left_out,
              ElementsAre(LeftOut{"style sheets in other files", 1}));
  EXPECT_THAT(Error("<!DOCTYPE svg [<!ENTITY a SYSTEM 'red.css'>]>" + Svg("<path d='&a;'/>")),
              HasSubstr("is not well-formed XML"));
}

TEST_F(Drawings, CompressedOnesAreRead) {
  const std::string text = Svg("<rect width='100' height='100' fill='red'/>");
  const auto gzip = [](const std::string& plain) {
    z_stream stream = {};
    deflateInit2(&stream, 9, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY);
    std::string packed(plain.size() + 1000, '\0');
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(plain.data()));
    stream.avail_in = static_cast<uInt>(plain.size());
    stream.next_out = reinterpret_cast<Bytef*>(packed.data());
    stream.avail_out = static_cast<uInt>(packed.size());
    deflate(&stream, Z_FINISH);
    packed.resize(stream.total_out);
    deflateEnd(&stream);
    return packed;
  };
  for (const char* name : {"a.svgz", "a.svg", "a.SVGZ"}) {
    const auto model = ReadHere(folder_.Write(name, gzip(text)));
    ASSERT_THAT(model, IsOk()) << name;
    EXPECT_EQ(At(*model, 0.5, 0.5), kRed);
  }
  EXPECT_THAT(ReadHere(folder_.Write("b.svgz", text)), IsOk()) << "which it is not";
  EXPECT_THAT(Error(gzip(text).substr(0, 40)), HasSubstr("a.svg: "));
  EXPECT_THAT(Error(gzip(std::string(70'000'000, ' '))),
              HasSubstr("has more than 67108864 bytes of text"));
  EXPECT_THAT(Error(gzip(gzip(text))), HasSubstr("is not well-formed XML"));
}

// Drawings of pymol-data, which tools/setup installs.
TEST_F(Drawings, RealOnes) {
  const std::string folder = "/usr/share/pymol/data/";
  for (const char* name : {"openvr/hints_vive_controller.svg", "openvr/menu_splash.svg",
                           "pmg_qt/icons/refresh.svg", "pymol/icons/icon2.svg"}) {
    const auto model = ReadHere(folder + name);
    ASSERT_THAT(model, IsOk()) << name;
    const SampledVolume& volume = model->volumes[0];
    EXPECT_EQ(std::max(volume.size[0], volume.size[1]), kDrawingPixels);
    EXPECT_GT(static_cast<int64_t>(volume.colors.size()) - Count(*model, kNothing), 1000) << name;
  }
}

TEST_F(Drawings, ThatAreWrong) {
  EXPECT_THAT(Error("hello"), HasSubstr("is not well-formed XML (line 1: "));
  EXPECT_THAT(Error(" "), HasSubstr("is not well-formed XML"));
  EXPECT_THAT(Error("<html/>"), HasSubstr("is XML of <html>; <svg> is expected"));
  EXPECT_THAT(Error(Svg("\n<g>")), HasSubstr("is not well-formed XML (line 2: "));
  EXPECT_THAT(
      Error(Svg("")),
      HasSubstr("has nothing that is to be seen; at least one path, shape or text is expected"));
  EXPECT_THAT(Error(Svg("", "")), HasSubstr("has nothing that is to be seen"));
  EXPECT_THAT(Error(Svg("<defs><font/></defs>", "")),
              HasSubstr("has nothing that is to be seen (left out: fonts (1))"));
  EXPECT_THAT(
      Error(Svg("<path d='M0 0 1 1' fill='none'/><g display='none'><path d='M0 0 9 9'/></g>")),
      HasSubstr("has nothing that is to be seen"));
  EXPECT_THAT(
      Error(Svg(
          "<pattern id='p' width='1e6' height='1e6' patternUnits='userSpaceOnUse'><rect width='1' "
          "height='1'/></pattern><rect fill='url(#p)' width='9' height='9'/>")),
      HasSubstr("cannot be drawn by librsvg ("));
}

// Nothing nests more deeply, or is drawn more often, than stack and time allow.
TEST_F(Drawings, WhatNestsOrMultipliesEnds) {
  EXPECT_THAT(Error(Svg(Times("<g>", 240) + "<path d='M0 0 9 9 0 9'/>" + Times("</g>", 240))),
              HasSubstr("more than 200 deep"));
  EXPECT_THAT(Error(Svg(Times("<g>", 1000) + Times("</g>", 1000))), HasSubstr("depth"));
  EXPECT_THAT(Import(Svg(Times("<g>", 150) + "<path d='M0 0 9 9 0 9'/>" + Times("</g>", 150))),
              IsOk());
  EXPECT_THAT(Error(Svg("<g id='a'><use href='#a'/></g>")), HasSubstr("without end"));
  EXPECT_THAT(Error(Svg("<mask id='a'><g mask='url(#a)'/></mask><g mask='url(#a)'/>")),
              HasSubstr("without end"));
  const auto chain = [](const std::string& first, const std::string& of, const std::string& last,
                        int count) {
    std::string all = first;
    for (int i = 1; i < count; ++i) {
      std::string one = of;
      for (size_t at = one.find('@'); at != std::string::npos; at = one.find('@'))
        one.replace(at, 1, std::to_string(i));
      for (size_t at = one.find('%'); at != std::string::npos; at = one.find('%'))
        one.replace(at, 1, std::to_string(i - 1));
      all += one;
    }
    return Svg(all + absl::StrCat(last, count - 1, ")'/>"));
  };
  for (const char* kind : {"pattern", "mask", "marker", "clipPath"}) {
    const std::string tag = kind;
    const std::string use = tag == "pattern"  ? "fill"
                            : tag == "marker" ? "marker-start"
                            : tag == "mask"   ? "mask"
                                              : "clip-path";
    const std::string of =
        absl::StrCat("<", tag, " id='a@' width='1' height='1'><path d='M0 0H9V9' ", use,
                     "='url(#a%)'/></", tag, ">");
    const std::string last = absl::StrCat("<path d='M0 0H9V9' ", use, "='url(#a");
    EXPECT_THAT(Error(chain("", of, last, 10'000)), HasSubstr("more than 200 deep")) << tag;
    EXPECT_THAT(Error(chain("", of, last, 20)),
                AnyOf(IsEmpty(), HasSubstr("nothing that is to be seen")))
        << tag;
  }
  // The same with a style sheet, which may apply to anything.
  std::string style = "<style>", patterns;
  for (int i = 1; i < 1000; ++i) {
    absl::StrAppend(&style, ".c", i, "{fill:url(#p", i - 1, ")}");
    absl::StrAppend(&patterns, "<pattern id='p", i, "' width='1' height='1'><rect class='c", i,
                    "' width='1' height='1'/></pattern>");
  }
  EXPECT_THAT(
      Error(Svg(style + "</style>" + patterns + "<rect class='c999' width='9' height='9'/>")),
      HasSubstr("more than 200 deep"));
  // Many gradients in one style sheet are not nested in each other.
  std::string gradients = "<style>.a{fill:url(#g1)}";
  for (int i = 0; i < 1000; ++i) absl::StrAppend(&gradients, ".c", i, "{fill:url(#g", i, ")}");
  gradients += "</style>";
  for (int i = 0; i < 1000; ++i)
    absl::StrAppend(&gradients, "<linearGradient id='g", i,
                    "'><stop stop-color='red'/></linearGradient>");
  EXPECT_THAT(Import(Svg(gradients + "<rect class='a' width='9' height='9'/>")), IsOk());
  // Elements that use two of the ones below them.
  std::string uses = "<path id='u0' d='M0 0 9 9 0 9'/>";
  for (int i = 1; i < 40; ++i)
    absl::StrAppend(&uses, "<g id='u", i, "'><use href='#u", i - 1, "'/><use href='#u", i - 1,
                    "'/></g>");
  EXPECT_THAT(Error(Svg("<defs>" + uses + "</defs><use href='#u39'/>")),
              HasSubstr("use each other too often"));
  EXPECT_THAT(
      Error(Svg("<marker id='m'><path d='M" + Times("1 1 ", 30'000) +
                "'/></marker><path marker-mid='url(#m)' d='M" + Times("1 1 ", 30'000) + "'/>")),
      HasSubstr("use each other too often"));
  std::string laughs = "<!DOCTYPE svg [<!ENTITY a 'M0 0 1 1 '>";
  for (char c = 'b'; c < 'z'; ++c) {
    laughs += absl::StrCat(
        "<!ENTITY ", std::string(1, c), " '",
        Times(absl::StrCat("&", std::string(1, static_cast<char>(c - 1)), ";"), 10), "'>");
  }
  EXPECT_THAT(Error(laughs + "]>" + Svg("<path d='&y;'/>")), HasSubstr("is not well-formed XML"));
  EXPECT_THAT(Error("<!DOCTYPE svg [<!ENTITY a '<use href=\"#b\"/>'>]>" + Svg("<g id='b'>&a;</g>")),
              HasSubstr("defines the entity \"a\" with elements"));
  EXPECT_THAT(Error(Svg("<style>" + Times(":not(", 10'000) +
                        "a{fill:red}</style><path d='M0 0 9 9 0 9'/>")),
              HasSubstr("brackets 10001 deep"));
  EXPECT_THAT(Error(Svg(Times("<g/>", 1'000'001))), HasSubstr("has more than 1000000 elements"));
}

// Many elements that are used once each do not count as endless work.
TEST_F(Drawings, ManyElementsAreRead) {
  std::string body = "<style>.a{fill:red}.b{stroke:none}#c{opacity:1}</style>";
  for (int i = 0; i < 50'000; ++i)
    body += "<g class='a b' transform='translate(1 2)' fill='#ff0000' stroke='none'/>\n";
  body += "<path class='a' d='M0 0 90 0 90 90z'/>";
  ASSERT_THAT(Import(Svg(body)), IsOk());
}

TEST_F(Drawings, DamagedOnesEndWell) {
  const std::vector<std::string> drawings = {
      Svg("<style>.a{fill:red}</style><g transform='rotate(5 1 2)'><path class='a' d='M0 0c1 2 3 4 "
          "5 6a1 2 3 0 1 5 5z'/></g>"),
      Svg("<defs><linearGradient id='g'><stop offset='0' stop-color='red'/><stop offset='1' "
          "stop-color='hsl(9,90%,50%)'/></linearGradient>"
          "<clipPath id='c'><circle cx='5%' r='40'/></clipPath><mask id='m'><rect width='50' "
          "height='90' fill='#fff8'/></mask>"
          "<pattern id='p' width='9' height='9' patternUnits='userSpaceOnUse'><rect width='4' "
          "height='5' fill='lime'/></pattern>"
          "<marker id='k' orient='auto' markerWidth='3' markerHeight='3'><path d='M0 0L3 "
          "3'/></marker></defs>"
          "<rect width='90' height='90' fill='url(#g)' clip-path='url(#c)' opacity='.7'/><rect "
          "width='50' height='50' fill='url(#p)' mask='url(#m)'/>"
          "<polyline points='1,2 3,4 50,60' stroke='#00f' stroke-dasharray='3 1' stroke-width='2' "
          "marker-end='url(#k)' fill='none'/>"),
      absl::StrCat(
          "<?xml version='1.0' encoding='utf-8'?><!DOCTYPE svg [<!ENTITY a 'fill:red'>]>",
          Svg(absl::StrCat(
              "<symbol id='s' viewBox='0 0 9 9' preserveAspectRatio='xMinYMax slice'><path "
              "style='&a;' d='M0 0H9V9z'/></symbol>"
              "<use href='#s' x='9' width='50' height='40'/><svg x='10%' width='40' height='1in' "
              "viewBox='0 0 1 1'><rect width='1' height='1' rx='.2'/></svg>"
              "<text x='5' y='50' font-size='20'>Hi <tspan fill='red' "
              "dy='1em'>you</tspan></text><image width='9' height='9' href='data:image/png;base64,",
              kRedPng, "'/>")))};
  std::mt19937 random(5);
  for (const std::string& good : drawings) {
    ASSERT_THAT(Import(good), IsOk());
    for (int i = 0; i < 250; ++i) {
      std::string bytes = good;
      bytes[random() % bytes.size()] = static_cast<char>(random());
      if (i % 4 == 1) bytes[random() % bytes.size()] = "0129<>#-.%e'&;"[random() % 14];
      if (i % 4 == 0) bytes.resize(1 + random() % bytes.size());
      const auto model = Import(bytes, 32);
      if (!model.ok()) {
        EXPECT_THAT(std::string(model.status().message()),
                    AllOf(HasSubstr("a.svg: "), HasSubstr("; ")));
      }
    }
  }
}

}  // namespace svg_test
}  // namespace voxeld::voxelctl
