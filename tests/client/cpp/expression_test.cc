// Expressions built by computation produce the same operations as their text.
#include "voxeld/expression.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <utility>
#include <vector>

#include "client/cpp/src/encode_shapes.h"
#include "voxeld/shapes.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::client {
namespace {

using expressions::parameter;
using expressions::Term;
using expressions::x;
using expressions::y;
using expressions::z;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Tree = v1::Expression::Tree;

v1::Implicit Wire(const Implicit& shape) {
  const absl::StatusOr<std::string> bytes = EncodeShape(shape);
  EXPECT_TRUE(bytes.ok()) << bytes.status();
  v1::Primitive primitive;
  EXPECT_TRUE(primitive.ParseFromString(bytes.value_or("")));
  return primitive.implicit();
}
std::vector<int> OpsOf(const Term& term) {
  const v1::Implicit shape = Wire({.surface = term});
  return {shape.surface().tree().ops().begin(), shape.surface().tree().ops().end()};
}

TEST(Expression, OperationsComeInPostfixOrder) {
  const v1::Implicit shape = Wire({.surface = square(x) + 3 * y - z});
  EXPECT_THAT(shape.surface().tree().ops(),
              ElementsAre(Tree::X, Tree::SQUARE, Tree::CONSTANT, Tree::Y, Tree::MULTIPLY, Tree::ADD,
                          Tree::Z, Tree::SUBTRACT));
  EXPECT_THAT(shape.surface().tree().values(), ElementsAre(3));
}

TEST(Expression, EveryOperationIsTheWires) {
  const std::vector<std::pair<Term, Tree::Op>> of_one = {
      {-x, Tree::NEGATE},    {abs(x), Tree::ABS},    {square(x), Tree::SQUARE},
      {sqrt(x), Tree::SQRT}, {cbrt(x), Tree::CBRT},  {sin(x), Tree::SIN},
      {cos(x), Tree::COS},   {tan(x), Tree::TAN},    {asin(x), Tree::ASIN},
      {acos(x), Tree::ACOS}, {atan(x), Tree::ATAN},  {exp(x), Tree::EXP},
      {log(x), Tree::LOG},   {floor(x), Tree::FLOOR}};
  for (const auto& [term, op] : of_one) EXPECT_THAT(OpsOf(term), ElementsAre(Tree::X, op));
  const std::vector<std::pair<Term, Tree::Op>> of_two = {
      {x + 2, Tree::ADD},        {x - 2, Tree::SUBTRACT},
      {x * 2, Tree::MULTIPLY},   {x / 2, Tree::DIVIDE},
      {pow(x, 2), Tree::POWER},  {atan2(x, 2), Tree::ATAN2},
      {mod(x, 2), Tree::MODULO}, {min(x, 2), Tree::MIN},
      {max(x, 2), Tree::MAX},    {difference(x, 2), Tree::DIFFERENCE}};
  for (const auto& [term, op] : of_two) {
    EXPECT_THAT(OpsOf(term), ElementsAre(Tree::X, Tree::CONSTANT, op));
  }
  EXPECT_THAT(OpsOf(smooth_min(x, y, z)), ElementsAre(Tree::X, Tree::Y, Tree::Z, Tree::SMOOTH_MIN));
  EXPECT_THAT(OpsOf(smooth_max(x, y, z)), ElementsAre(Tree::X, Tree::Y, Tree::Z, Tree::SMOOTH_MAX));
  EXPECT_THAT(OpsOf(expressions::voxel), ElementsAre(Tree::VOXEL));
}

TEST(Expression, ConditionsAreNumbers) {
  EXPECT_EQ(OpsOf(x <= 1), OpsOf(x - 1));
  EXPECT_THAT(OpsOf(x >= 1), ElementsAre(Tree::CONSTANT, Tree::X, Tree::SUBTRACT));
}

TEST(Expression, StandsWhereTextMay) {
  const v1::Implicit shape = Wire({.surface = "x^2 + y^2 - z = 0",
                                   .bound = max(x <= 1, z <= parameter("a") * parameter("b_2")),
                                   .red = abs(x),
                                   .green = "y",
                                   .blue = Term(0.5)});
  EXPECT_EQ(shape.surface().text(), "x^2 + y^2 - z = 0");
  EXPECT_EQ(shape.bound().tree().names(), "a b_2");
  EXPECT_EQ(shape.red().tree().ops_size(), 2);
  EXPECT_EQ(shape.green().text(), "y");
  EXPECT_THAT(shape.blue().tree().values(), ElementsAre(0.5));
  EXPECT_FALSE(shape.has_level());
  EXPECT_FALSE(Wire({.surface = x, .bound = ""}).has_bound());
}

TEST(Expression, WhatCannotBeSentIsRefused) {
  const absl::Status number =
      EncodeShape(Implicit{.surface = x + std::numeric_limits<double>::quiet_NaN()}).status();
  EXPECT_EQ(number.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(number.message()), HasSubstr("must be finite"));
  for (const char* const name : {"", "2a", "a b", "\xC3\xA4"}) {
    EXPECT_THAT(std::string(EncodeShape(Implicit{.surface = parameter(name)}).status().message()),
                HasSubstr("letters, digits and _ make a name"));
    EXPECT_FALSE(EncodeShape(Implicit{.surface = "x", .parameters = {{name, 1}}}).ok());
  }
}

}  // namespace
}  // namespace voxeld::client
