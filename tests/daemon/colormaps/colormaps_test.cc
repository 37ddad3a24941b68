#include "daemon/colormaps/colormaps.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <string>
#include <vector>

namespace voxeld {
namespace {

using ::testing::HasSubstr;

TEST(Colormaps, AreFoundByNameAndEndWhereTheyShould) {
  const std::vector<std::string> names = ColormapNames();
  EXPECT_EQ(std::set<std::string>(names.begin(), names.end()).size(), names.size());
  const ColorTable viridis = *FindColormap("viridis");
  EXPECT_EQ(viridis[0], 0x440154u);
  EXPECT_EQ(viridis[255], 0xFDE725u);
  const ColorTable gray = *FindColormap("gray");
  for (uint32_t i = 0; i < 256; ++i) EXPECT_EQ(gray[i], i * 0x010101) << i;
}

TEST(Colormaps, EachIsTurnedRoundByItsEnding) {
  for (const std::string& name : ColormapNames()) {
    const ColorTable there = *FindColormap(name), back = *FindColormap(name + "_r");
    for (size_t i = 0; i < 256; ++i) ASSERT_EQ(back[i], there[255 - i]) << name << " " << i;
  }
  EXPECT_EQ(FindColormap("_r"), std::nullopt);
  EXPECT_EQ(FindColormap("viridis_r_r"), std::nullopt);
  EXPECT_EQ(FindColormap("sepia_r"), std::nullopt);
  EXPECT_EQ(*FindColormap("binary"), *FindColormap("gray_r"));
}

TEST(Colormaps, ThoseOfFewColorsHaveSteps) {
  const ColorTable tab = *FindColormap("tab10");
  EXPECT_EQ(tab[0], 0x1F77B4u);
  EXPECT_EQ(tab[25], 0x1F77B4u);
  EXPECT_EQ(tab[26], 0xFF7F0Eu);
  EXPECT_EQ(tab[255], 0x17BECFu);
  EXPECT_EQ(std::set<uint32_t>(tab.begin(), tab.end()).size(), 10u);
  const ColorTable flag = *FindColormap("flag");
  EXPECT_EQ(flag[0], 0xFF0000u);
  EXPECT_EQ(flag[255], 0x000000u);
}

TEST(Colormaps, AWrongNameIsToldTheNearestOrAll) {
  EXPECT_EQ(ColormapAdvice("virdis"), "did you mean \"viridis\"?");
  EXPECT_EQ(ColormapAdvice("Viridis_r"), "did you mean \"viridis_r\"?");
  EXPECT_THAT(ColormapAdvice("sepia"), HasSubstr("there are viridis, plasma"));
  EXPECT_THAT(ColormapAdvice("sepia"), HasSubstr("Set1"));
  EXPECT_THAT(ColormapAdvice("sepia"), HasSubstr("each also turned round, as viridis_r"));
}

}  // namespace
}  // namespace voxeld
