#include "daemon/text/stroke_font.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace voxeld::text {
namespace {

TEST(StrokeFont, LettersStandOnTheBaselineAndHaveTheirHeight) {
  const absl::StatusOr<StrokeFont> font = StrokeFont::Load("futural");
  ASSERT_TRUE(font.ok()) << font.status();
  const StrokeFont::Line line = font->Lay("HE");
  // Two posts and a bar; a post and three bars, some of which may be one stroke.
  EXPECT_GE(line.strokes.size(), 5u);
  float least = 9, most = -9, right = 0;
  for (const Stroke& stroke : line.strokes) {
    ASSERT_GE(stroke.size(), 2u);
    for (const StrokePoint& p : stroke) {
      least = std::min(least, p.y);
      most = std::max(most, p.y);
      right = std::max(right, p.x);
    }
  }
  EXPECT_FLOAT_EQ(least, 0);
  EXPECT_FLOAT_EQ(most, 1);
  EXPECT_LT(right, line.width);
  EXPECT_GT(line.width, font->Lay("I").width);
  EXPECT_EQ(font->Lay(" ").strokes.size(), 0u);
  EXPECT_FLOAT_EQ(font->Lay("\x07").width, font->Lay("?").width);
}

TEST(StrokeFont, GlyphsAreReadAsTheFileSaysThem) {
  // A space; then a stroke from the middle to 2 right and 9 above the baseline, lifted, and a second one.
  const absl::StatusOr<StrokeFont> font = StrokeFont::Parse("12345  1JZ\n12345  6JZRRTI R[[\n[R\n");
  ASSERT_TRUE(font.ok()) << font.status();
  const StrokeFont::Line line = font->Lay("!");
  ASSERT_EQ(line.strokes.size(), 2u);
  EXPECT_FLOAT_EQ(line.width, 16 / 21.0f);
  EXPECT_FLOAT_EQ(line.strokes[0][0].x, 8 / 21.0f);
  EXPECT_FLOAT_EQ(line.strokes[0][0].y, 9 / 21.0f);
  EXPECT_FLOAT_EQ(line.strokes[0][1].x, 10 / 21.0f);
  EXPECT_FLOAT_EQ(line.strokes[0][1].y, 18 / 21.0f);
  EXPECT_FLOAT_EQ(line.strokes[1][0].y, 0);
}

TEST(StrokeFont, WhatIsWrongIsSaid) {
  EXPECT_EQ(StrokeFont::Parse("12345  x").status().message(),
            "line 1: no glyph begins with \"12345  x\"");
  EXPECT_EQ(StrokeFont::Parse("12345  3JZRR").status().message(),
            "line 1: the file ends within a glyph");
  EXPECT_EQ(StrokeFont::Parse("").status().message(), "line 1: the file ends within a glyph");
  EXPECT_EQ(StrokeFont::Load("no such").status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(StrokeFont::Load("../futural").status().code(), absl::StatusCode::kNotFound);
}

}  // namespace
}  // namespace voxeld::text
