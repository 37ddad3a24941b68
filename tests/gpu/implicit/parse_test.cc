#include "gpu/implicit/parse.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace voxeld::gpu::implicit {
namespace {

// Returns the value of a node at a point.
double ValueOf(const Graph& graph, Graph::Node node, double x, double y, double z) {
  const absl::StatusOr<std::vector<uint32_t>> words = Compile(graph, {.surface = node});
  EXPECT_TRUE(words.ok()) << words.status();
  const ProgramView view{words->data()};
  const float at[3] = {static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
  float slots[kMostSlots];
  Run(view.surface_code(), view.surface(), at, 0.25f, slots);
  return slots[view.surface_slot()];
}

double Value(const std::string& text, double x = 0, double y = 0, double z = 0,
             const Parameters& parameters = {}) {
  Graph graph;
  const absl::StatusOr<Graph::Node> node = ParseValue(text, parameters, {}, graph);
  EXPECT_TRUE(node.ok()) << text << ": " << node.status();
  return node.ok() ? ValueOf(graph, *node, x, y, z) : std::nan("");
}

bool Truth(const std::string& text, double x = 0, double y = 0, double z = 0) {
  Graph graph;
  const absl::StatusOr<Graph::Node> node = ParseCondition(text, {}, {}, graph);
  EXPECT_TRUE(node.ok()) << text << ": " << node.status();
  return node.ok() && ValueOf(graph, *node, x, y, z) <= 0;
}

std::string ErrorOf(const std::string& text, const ParseLimits& limits = {}) {
  Graph graph;
  return std::string(ParseShape(text, {{"radius", 2}}, limits, graph).status().message());
}

TEST(Parse, OperatorsBindAsInMathematics) {
  EXPECT_EQ(Value("1 + 2*3"), 7);
  EXPECT_EQ(Value("(1 + 2)*3"), 9);
  EXPECT_EQ(Value("8 - 3 - 2"), 3);
  EXPECT_EQ(Value("16 / 4 / 2"), 2);
  EXPECT_EQ(Value("-2^2"), -4);
  EXPECT_EQ(Value("2^-1"), 0.5);
  EXPECT_EQ(Value("2^3^2"), 512);
  EXPECT_EQ(Value("2**3"), 8);
  EXPECT_EQ(Value("--3"), 3);
  EXPECT_EQ(Value("6 \xC3\xB7 2 \xC3\x97 3 \xE2\x88\x92 1"), 8);
  EXPECT_EQ(Value("1.5e1 + .5"), 15.5);
}

TEST(Parse, NamesAreAxesConstantsAndParameters) {
  EXPECT_EQ(Value("x + 10*y + 100*z", 1, 2, 3), 321);
  EXPECT_NEAR(Value("2*pi - tau"), 0, 1e-6);
  EXPECT_NEAR(Value("ln(e)"), 1, 1e-6);
  EXPECT_EQ(Value("voxel"), 0.25);
  EXPECT_EQ(Value("a*x + a_1", 3, 0, 0, {{"a", 2}, {"a_1", 5}}), 11);
}

TEST(Parse, FunctionsAreWhatTheyAreCalled) {
  const double x = 0.3, y = -0.7, z = 2;
  const std::pair<const char*, double> cases[] = {
      {"abs(y)", 0.7},
      {"acos(x)", std::acos(x)},
      {"asin(x)", std::asin(x)},
      {"atan(z)", std::atan(z)},
      {"atan2(y, x)", std::atan2(y, x)},
      {"cbrt(y)", std::cbrt(y)},
      {"clamp(z, -1, 1.5)", 1.5},
      {"cos(x)", std::cos(x)},
      {"cosh(z)", std::cosh(z)},
      {"difference(x, y)", 0.7},
      {"exp(z)", std::exp(z)},
      {"floor(y)", -1},
      {"intersection(x, y, z)", 2},
      {"length(x, y, z)", std::sqrt(x * x + y * y + z * z)},
      {"log(z)", std::log(z)},
      {"max(x, y)", x},
      {"min(x, y, z)", y},
      {"mod(y, z)", 1.3},
      {"pow(z, x)", std::pow(z, x)},
      {"root(z, 3)", std::cbrt(z)},
      {"root(z, 4)", std::pow(z, 0.25)},
      {"sin(y)", std::sin(y)},
      {"sinh(y)", std::sinh(y)},
      {"sqrt(z)", std::sqrt(z)},
      {"square(y)", 0.49},
      {"tan(x)", std::tan(x)},
      {"tanh(y)", std::tanh(y)},
      {"union(x, y)", y},
      {"smin(x, y, 0)", y},
      {"smin(x, y, 2)", y - (2 - 1.0) * (2 - 1.0) / 8},
      {"smax(x, y, 2)", x + (2 - 1.0) * (2 - 1.0) / 8}};
  for (const auto& [text, want] : cases) {
    EXPECT_NEAR(Value(text, x, y, z), want, 2e-6 * std::max(1.0, std::fabs(want))) << text;
  }
}

TEST(Parse, ConditionsAreTrueWhereTheySay) {
  EXPECT_TRUE(Truth("x <= 1", 1));
  EXPECT_FALSE(Truth("x \xE2\x89\xA4 1", 1.5));
  EXPECT_TRUE(Truth("0 <= x <= 1", 0.5));
  EXPECT_FALSE(Truth("0 <= x <= 1", -0.5));
  EXPECT_FALSE(Truth("0 <= x <= 1", 1.5));
  EXPECT_TRUE(Truth("x > 3 or y > 3", 0, 4));
  EXPECT_FALSE(Truth("x > 3 and y > 3", 0, 4));
  EXPECT_TRUE(Truth("not x > 3 and (y > 3 or z > 3)", 0, 4));
  EXPECT_TRUE(Truth("not (x > 3 and y > 3)", 0, 4));
  EXPECT_TRUE(Truth("union(x > 3, y > 3)", 0, 4));
}

TEST(Parse, ShapesAreSurfacesOrRegionsWithinBounds) {
  Graph graph;
  absl::StatusOr<ParsedShape> shape = ParseShape("x^2+y^2-z = 0 where x^2+y^2 <= 1", {}, {}, graph);
  ASSERT_TRUE(shape.ok()) << shape.status();
  EXPECT_FALSE(shape->is_region);
  EXPECT_EQ(ValueOf(graph, shape->surface, 1, 2, 3), 2);
  EXPECT_EQ(ValueOf(graph, shape->bound, 1, 2, 3), 4);
  shape = ParseShape("x^2 + y^2 + z^2 <= 1 and not (x^2 + y^2 <= 0.25)", {}, {}, graph);
  ASSERT_TRUE(shape.ok()) << shape.status();
  EXPECT_TRUE(shape->is_region);
  EXPECT_EQ(shape->bound, -1);
  EXPECT_GT(ValueOf(graph, shape->surface, 0.1, 0.1, 0), 0);
  EXPECT_LE(ValueOf(graph, shape->surface, 0.7, 0.1, 0), 0);
  shape = ParseShape("sin(x) - z", {}, {}, graph);
  ASSERT_TRUE(shape.ok()) << shape.status();
  EXPECT_FALSE(shape->is_region);
}

TEST(Parse, ErrorsSayWhereWhatAndWhatWouldBeRight) {
  EXPECT_EQ(ErrorOf("x + "),
            "at character 5: found the end where a number, a name or ( would be right");
  EXPECT_EQ(ErrorOf("(x + 1"), "at character 7: found the end where ) would be right");
  EXPECT_EQ(ErrorOf("x y"),
            "at character 3: found 'y' where an operator or the end would be right");
  EXPECT_EQ(ErrorOf("\xC3\x97 x"),
            "at character 1: found '\xC3\x97' where a number, a name or ( would be right");
  EXPECT_EQ(ErrorOf("x # 1"),
            "at character 3: found a character that is none of an expression's; + - * / ^ ( ) , = "
            "<= >=, numbers and "
            "names are");
  EXPECT_EQ(ErrorOf("w = 1"),
            "at character 1: there is no 'w'; there are x, y, z, pi, tau, e, voxel, radius, and "
            "functions with (");
  EXPECT_NE(
      ErrorOf("sine(x)").find("at character 1: there is no function 'sine'; there are abs, acos"),
      std::string::npos);
  EXPECT_EQ(ErrorOf("atan2(x)"), "at character 8: atan2 has 1 arguments; 2 would be right");
  EXPECT_EQ(ErrorOf("max(x)"), "at character 6: max has 1 arguments; 2 to 64 would be right");
  EXPECT_EQ(ErrorOf("x = 1 where y"),
            "at character 14: what stands before is a number after where; a condition, as x <= 1 "
            "would be right");
  EXPECT_EQ(ErrorOf("(x <= 1) + 2"),
            "at character 10: what stands before is a condition, as x <= 1 before +; a number "
            "would be right");
  EXPECT_EQ(ErrorOf("x = y = z"),
            "at character 7: found a second relation beside an =; one = by itself would be right");
  EXPECT_EQ(ErrorOf("1e99 * x"), "at character 1: found no number that single precision holds");
  EXPECT_EQ(ErrorOf(""),
            "at character 1: found the end where a number, a name or ( would be right");
}

TEST(Parse, LimitsHold) {
  EXPECT_EQ(ErrorOf(std::string(100, '(') + "x"), "nests deeper than 64 levels");
  EXPECT_EQ(ErrorOf(std::string(100'000, '-') + "x"), "nests deeper than 64 levels");
  EXPECT_EQ(ErrorOf("x^" + std::string(100, '-') + "1"), "nests deeper than 64 levels");
  std::string sum = "x";
  for (int i = 0; i < 2000; ++i) sum += "*y+" + std::to_string(i);
  EXPECT_EQ(ErrorOf(sum), "has more than 1024 operations");
}

TEST(Parse, ParametersStandForTheirValues) {
  Graph graph;
  ASSERT_TRUE(ParseShape("length(x, y, z) = radius", {{"radius", 2}}, {}, graph).ok());
}

}  // namespace
}  // namespace voxeld::gpu::implicit
