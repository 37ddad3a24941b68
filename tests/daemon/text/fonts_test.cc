// Tests letters of the fonts on the tests' machines (fonts-dejavu-core).
#include "daemon/text/fonts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace voxeld::text {
namespace {

using ::testing::HasSubstr;

class FontsTest : public ::testing::Test {
 protected:
  LaidOut Lay(std::string_view utf8, const Layout& layout = {}) {
    absl::StatusOr<LaidOut> laid = fonts_.Lay(utf8, layout);
    EXPECT_TRUE(laid.ok()) << laid.status();
    return laid.ok() ? *std::move(laid) : LaidOut();
  }

  Fonts fonts_;
};

struct Extent {
  double left = 1e9, right = -1e9, bottom = 1e9, top = -1e9;
};
Extent ExtentOf(const PlacedGlyph& placed) {
  Extent e;
  for (const Contour& contour : placed.glyph->contours) {
    for (const OutlinePoint& p : contour) {
      e.left = std::min(e.left, placed.x + p.x);
      e.right = std::max(e.right, placed.x + p.x);
      e.bottom = std::min(e.bottom, placed.y + p.y);
      e.top = std::max(e.top, placed.y + p.y);
    }
  }
  return e;
}

TEST_F(FontsTest, CapitalsAreOneHighAndLettersFollowOneAnother) {
  const LaidOut laid = Lay("HIE");
  ASSERT_EQ(laid.glyphs.size(), 3u);
  for (const PlacedGlyph& glyph : laid.glyphs) {
    EXPECT_NEAR(ExtentOf(glyph).bottom, 0, 1e-9);
    EXPECT_NEAR(ExtentOf(glyph).top, 1, 1e-2);
  }
  EXPECT_LT(ExtentOf(laid.glyphs[0]).right, ExtentOf(laid.glyphs[1]).left);
  EXPECT_LT(ExtentOf(laid.glyphs[1]).right, ExtentOf(laid.glyphs[2]).left);
}

TEST_F(FontsTest, ContoursAreClosedCurvesThatMeet) {
  for (const PlacedGlyph& placed : Lay("&Og8").glyphs) {
    for (const Contour& contour : placed.glyph->contours) {
      ASSERT_EQ(contour.size() % 4, 0u);
      for (size_t i = 0; i < contour.size(); i += 4) {
        const OutlinePoint& end = contour[i + 3];
        const OutlinePoint& next = contour[(i + 4) % contour.size()];
        EXPECT_EQ(end.x, next.x);
        EXPECT_EQ(end.y, next.y);
      }
    }
  }
  EXPECT_EQ(Lay("B").glyphs[0].glyph->contours.size(), 3u) << "with its holes";
}

TEST_F(FontsTest, TheSameLetterIsTheSame) {
  const LaidOut laid = Lay("oo");
  EXPECT_EQ(laid.glyphs[0].glyph, laid.glyphs[1].glyph);
}

TEST_F(FontsTest, LinesAreAlignedAndOneBelowTheOther) {
  const LaidOut laid = Lay("l\nl", {.alignment = Alignment::kRight, .line_spacing = 2});
  ASSERT_EQ(laid.glyphs.size(), 2u);
  EXPECT_LT(ExtentOf(laid.glyphs[0]).right, 0);
  const double step = laid.glyphs[0].y - laid.glyphs[1].y;
  const LaidOut single = Lay("l\nl");
  EXPECT_NEAR(step, 2 * (single.glyphs[0].y - single.glyphs[1].y), 1e-9);
  EXPECT_GT(step, 2);
  const LaidOut middle = Lay("HHH", {.alignment = Alignment::kCenter});
  EXPECT_NEAR(ExtentOf(middle.glyphs[0]).left, -ExtentOf(middle.glyphs[2]).right, 1e-2);
}

TEST_F(FontsTest, LongLinesAreBrokenBetweenWords) {
  const LaidOut laid = Lay("aaa bbb ccc", {.width = 6});
  ASSERT_EQ(laid.glyphs.size(), 9u);
  std::vector<double> bases;
  for (const PlacedGlyph& glyph : laid.glyphs) {
    EXPECT_LT(ExtentOf(glyph).right, 6);
    if (bases.empty() || bases.back() != glyph.y) bases.push_back(glyph.y);
  }
  EXPECT_GE(bases.size(), 2u);
}

TEST_F(FontsTest, ArabicJoinsAndRunsFromRightToLeft) {
  // beh alone, and beh before beh, which has another form.
  const LaidOut alone = Lay("\xD8\xA8"), two = Lay("\xD8\xA8\xD8\xA8");
  ASSERT_EQ(alone.glyphs.size(), 1u);
  ASSERT_EQ(two.glyphs.size(), 2u);
  EXPECT_NE(two.glyphs[0].glyph, alone.glyphs[0].glyph);
  EXPECT_NE(two.glyphs[0].glyph, two.glyphs[1].glyph);
  // Hebrew: alef, then bet, which is to the left of it; digits in between keep their order.
  const LaidOut hebrew = Lay("\xD7\x90\xD7\x91"), alef = Lay("\xD7\x90");
  ASSERT_EQ(hebrew.glyphs.size(), 2u);
  EXPECT_EQ(hebrew.glyphs[1].glyph, alef.glyphs[0].glyph);
  const LaidOut mixed = Lay("\xD7\x90 12"), one = Lay("1");
  ASSERT_EQ(mixed.glyphs.size(), 3u);
  EXPECT_EQ(mixed.glyphs[0].glyph, one.glyphs[0].glyph) << "12 is to the left, its 1 first";
  EXPECT_EQ(mixed.glyphs[2].glyph, alef.glyphs[0].glyph);
}

TEST_F(FontsTest, WhatNoFontHasIsSaid) {
  // U+10FFFE is a noncharacter.
  EXPECT_EQ(fonts_.Lay("a\xF4\x8F\xBF\xBE", {}).status(),
            absl::InvalidArgumentError("has U+10fffe, which no font of the server has"));
  EXPECT_EQ(Lay("a\xE2\x80\x8D\tb").glyphs.size(), 2u) << "joiners and tabs are invisible";
  EXPECT_TRUE(absl::IsResourceExhausted(fonts_.Lay("abc", {.most = 2}).status()));
}

TEST_F(FontsTest, StrokeFontsAreReadOnce) {
  const auto first = fonts_.Strokes("futural"), again = fonts_.Strokes("futural");
  ASSERT_TRUE(first.ok());
  EXPECT_EQ(*first, *again);
  for (const char* name : {"", "../futural", "no_such", "a b"}) {
    EXPECT_TRUE(absl::IsNotFound(fonts_.Strokes(name).status())) << name;
  }
  EXPECT_TRUE(absl::IsNotFound(fonts_.Strokes(std::string("futural\0x", 9)).status()));
}

TEST_F(FontsTest, WhatIsWrongIsSaid) {
  EXPECT_THAT(std::string(fonts_.Lay("ab\xFFz", {}).status().message()),
              HasSubstr("byte 2, which begins no character"));
  for (const char* bad : {"\xC0\x80", "\xED\xA0\x80", "\xF4\x90\x80\x80", "\xE2\x82", "\x80"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(fonts_.Lay(bad, {}).status())) << bad;
  }
  const absl::Status unknown = fonts_.Lay("a", {.font = "Nowhere"}).status();
  EXPECT_TRUE(absl::IsNotFound(unknown));
  EXPECT_THAT(std::string(unknown.message()), HasSubstr("DejaVu"));
  EXPECT_TRUE(fonts_.Lay("a", {.font = "DejaVu Sans Mono"}).ok());
  EXPECT_TRUE(fonts_.Lay("a", {.font = "serif"}).ok());
  EXPECT_TRUE(fonts_.Lay("a", {.font = "dejavu SANS"}).ok());
  EXPECT_THAT(std::string(fonts_.Lay("a", {.font = std::string(5000, '\n')}).status().message()),
              HasSubstr("\\n\\n"));
}

TEST_F(FontsTest, NothingIsNothing) {
  EXPECT_TRUE(Lay("").glyphs.empty());
  EXPECT_TRUE(Lay(" \n \n").glyphs.empty());
}

}  // namespace
}  // namespace voxeld::text
