// Tests colours by numbers.
#include "tools/voxelctl/scene/color_by.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/tools/voxelctl/status_matchers.h"

namespace voxeld::voxelctl {
namespace color_by_test {

// Viridis according to the contract (colormaps.txt): the first, the middle (128 of 255) and the
// last colour.
constexpr Rgb kFirst = {68, 1, 84}, kMiddle = {33, 144, 140}, kLast = {253, 231, 37};

Model Cloud(std::vector<Attribute> attributes) {
  Model model;
  Part& part = model.parts.emplace_back();
  part.kind = Kind::kPoints;
  for (size_t i = 0; i < attributes[0].values.size(); ++i)
    part.positions.push_back({static_cast<double>(i), 0, 7});
  part.normals.assign(part.positions.size(), {0, 0, 1});
  part.attributes = std::move(attributes);
  return model;
}

TEST(ColorBy, GoesFromTheLeastNumberToTheGreatest) {
  Model model = Cloud({{"a", {5, 5, 5}}, {"b", {10, 30, 20}}});
  const auto legend = ApplyColorBy({.attribute = "b"}, {&model, 1});
  ASSERT_THAT(legend, IsOk());
  EXPECT_EQ(model.parts[0].colors, (std::vector<Rgb>{kFirst, kLast, kMiddle}));
  EXPECT_TRUE(model.parts[0].normals.empty());
  EXPECT_EQ(LegendText(*legend), "coloured by b: 10 to 30 (viridis)");
}

TEST(ColorBy, ARangeOverSeveralModels) {
  Model models[] = {Cloud({{"Height", {-5, 0}}}), Cloud({{"height", {1, 99}}}),
                    Cloud({{"width", {1}}})};
  const auto legend =
      ApplyColorBy({.attribute = "height", .range = std::array<double, 2>{0, 1}}, models);
  ASSERT_THAT(legend, IsOk());
  EXPECT_EQ(models[0].parts[0].colors, (std::vector<Rgb>{kFirst, kFirst}));
  EXPECT_EQ(models[1].parts[0].colors, (std::vector<Rgb>{kLast, kLast}));
  EXPECT_TRUE(models[2].parts[0].colors.empty());
}

TEST(ColorBy, CoordinatesAreAsInTheFile) {
  Model model = Cloud({{"a", {0, 0, 0}}});
  ASSERT_THAT(ApplyColorBy({.attribute = "x"}, {&model, 1}), IsOk());
  EXPECT_EQ(model.parts[0].colors, (std::vector<Rgb>{kFirst, kMiddle, kLast}));
  // All of them are equal.
  ASSERT_THAT(ApplyColorBy({.attribute = "z"}, {&model, 1}), IsOk());
  EXPECT_EQ(model.parts[0].colors, std::vector<Rgb>(3, kMiddle));
}

TEST(ColorBy, AnAttributeCalledXComesBeforeTheCoordinate) {
  Model model = Cloud({{"x", {9, 1, 5}}});
  ASSERT_THAT(ApplyColorBy({.attribute = "x"}, {&model, 1}), IsOk());
  EXPECT_EQ(model.parts[0].colors, (std::vector<Rgb>{kLast, kFirst, kMiddle}));
}

TEST(ColorBy, MissingNumbersAreCounted) {
  Model model = Cloud({{"a", {NAN, 1, 2, INFINITY, -INFINITY}}});
  const auto legend = ApplyColorBy({.attribute = "a"}, {&model, 1});
  ASSERT_THAT(legend, IsOk());
  EXPECT_EQ(legend->without, 1u);
  EXPECT_EQ(legend->low, 1);
  EXPECT_EQ(legend->high, 2);
  EXPECT_EQ(model.parts[0].colors, (std::vector<Rgb>{{60, 60, 60}, kFirst, kLast, kLast, kFirst}));
}

TEST(ColorBy, WhatThereIsNotIsSaidWithWhatThereIs) {
  Model model = Cloud({{"temperature", {1, 2}}, {"nothing", {NAN, NAN}}});
  EXPECT_THAT(ApplyColorBy({.attribute = "temperatur"}, {&model, 1}),
              Fails(Words{"temperatur", "did you mean temperature?"}));
  EXPECT_THAT(ApplyColorBy({.attribute = "qqqqqq"}, {&model, 1}),
              Fails(Words{"temperature", "nothing", "z"}));
  EXPECT_THAT(ApplyColorBy({.attribute = "nothing"}, {&model, 1}),
              Fails(Words{"no numeric value in any file"}));
  EXPECT_THAT(ApplyColorBy({.attribute = "temperature", .colormap = "virids"}, {&model, 1}),
              Fails(Words{"virids", "viridis"}));
}

TEST(ColorBy, LegendColorsRunOverTheWholeMap) {
  const auto colors = LegendColors({.attribute = "a", .colormap = "viridis"}, 3);
  ASSERT_EQ(colors.size(), 3u);
  EXPECT_EQ(colors[0], (std::array<uint8_t, 3>{68, 1, 84}));
  EXPECT_EQ(colors[2], (std::array<uint8_t, 3>{253, 231, 37}));
}

}  // namespace color_by_test
}  // namespace voxeld::voxelctl
