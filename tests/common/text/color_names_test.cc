#include "common/text/color_names.h"

#include <gtest/gtest.h>

namespace voxeld {
namespace {

TEST(ParseColor, NamesAreThoseOfCss) {
  // "CSS Color Module Level 4", section 6.1.
  EXPECT_EQ(ParseColor("green"), 0x008000u);
  EXPECT_EQ(ParseColor("rebeccapurple"), 0x663399u);
  EXPECT_EQ(ParseColor("LightGoldenrodYellow"), 0xfafad2u);
  EXPECT_EQ(ParseColor("darkslategrey"), ParseColor("darkslategray"));
  EXPECT_EQ(ParseColor("aliceblue"), 0xf0f8ffu);
  EXPECT_EQ(ParseColor("yellowgreen"), 0x9acd32u);
}

TEST(ParseColor, HexadecimalOfThreeOrSixDigits) {
  EXPECT_EQ(ParseColor("#fa0"), 0xffaa00u);
  EXPECT_EQ(ParseColor("#Ff8001"), 0xff8001u);
  for (const char* text :
       {"", "#", "#ff", "#ffff", "#ff80011", "#gg0000", "#-12345", "#0x1234", "ff8001", "purpel"})
    EXPECT_EQ(ParseColor(text), std::nullopt) << text;
}

TEST(ColorAdvice, NamesTheNearest) {
  EXPECT_EQ(ColorAdvice("purpel"), "#rrggbb or a CSS color name is expected; did you mean purple?");
  EXPECT_EQ(ColorAdvice("12345678"), "#rrggbb or a CSS color name is expected");
}

}  // namespace
}  // namespace voxeld
