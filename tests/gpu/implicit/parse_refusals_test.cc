// Tests formulas with one error each: the message, and the place that it names.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "gpu/implicit/parse.h"
#include "tests/small_stack.h"

namespace voxeld::gpu::implicit {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

std::string Shape(const std::string& text, const Parameters& parameters = {},
                  const ParseLimits& limits = {}) {
  Graph graph;
  return std::string(ParseShape(text, parameters, limits, graph).status().message());
}
std::string Condition(const std::string& text) {
  Graph graph;
  return std::string(ParseCondition(text, {}, {}, graph).status().message());
}
std::string Number(const std::string& text, const Parameters& parameters = {}) {
  Graph graph;
  return std::string(ParseValue(text, parameters, {}, graph).status().message());
}

// In place of any token, in any part of a formula: the first error is reported.
TEST(ParseRefusals, ACharacterThatIsNoneIsFoundWhereverItStands) {
  for (const std::string text :
       {"x ^ 2 + - y * 3 / z - 1 = 0 where not x <= 1 and ( y <= 1 or z >= 2 ) and pi <= 4 ",
        "min ( x , 2 ) + + 1 <= 3 <= 4 or x < 1 and not ( y > 2 ) ", "2 ^ - x ^ + y - voxel "}) {
    ASSERT_EQ(Shape(text), "") << text;
    for (size_t cut = text.find(' '); cut != std::string::npos; cut = text.find(' ', cut + 1)) {
      EXPECT_THAT(Shape(text.substr(0, cut + 1) + "?"),
                  StartsWith(absl::StrCat("at character ", cut + 2,
                                          ": found a character that is none of an expression's")))
          << text;
    }
  }
  for (const std::string& why : {Shape("?"), Condition("?"), Number("?")}) {
    EXPECT_THAT(why, StartsWith("at character 1: found a character that is none"));
  }
  for (const std::string& why : {Condition("x <= 1 ?"), Number("1 ?")}) {
    EXPECT_THAT(why, HasSubstr("found a character that is none"));
  }
}

TEST(ParseRefusals, WhereAnOperandIsMissingOneIsAskedFor) {
  for (const char* text :
       {")", "x + )", "x * )", "- )", "+ )", "2 ^ )", "( )", "sin ( )", "min ( x , )", "x <= )",
        "x = )", "not )", "x <= 1 and )", "x <= 1 or )", "x where )"}) {
    EXPECT_THAT(Shape(text), HasSubstr("found ')' where a number, a name or ( would be right"))
        << text;
  }
  EXPECT_THAT(Number(")"), HasSubstr("where a number, a name or ( would be right"));
  EXPECT_THAT(Number("x y"), HasSubstr("found 'y' where an operator or the end would be right"));
  EXPECT_THAT(Shape("x where x <= 1 y"), HasSubstr("found 'y' where an operator or the end"));
  EXPECT_THAT(Shape("(x y"), HasSubstr("found 'y' where ) would be right"));
  EXPECT_THAT(Shape("sin(x y)"), HasSubstr("found 'y' where , or ) would be right"));
}

TEST(ParseRefusals, EachOperandIsOfItsKind) {
  const std::string number = "a number would be right",
                    condition = "a condition, as x <= 1 would be right",
                    is_condition = "what stands before is a condition, as x <= 1",
                    is_equation = "what stands before is an equation",
                    is_number = "what stands before is a number";
  const struct {
    const char* text;
    std::string is, where, right;
  } cases[] = {{"(x <= 1) + 1", is_condition, " before +; ", number},
               {"1 + (x <= 1)", is_condition, " after +; ", number},
               {"1 - (x = 1)", is_equation, " after -; ", number},
               {"(x = 1) * 2", is_equation, " before *; ", number},
               {"1 / (x <= 1)", is_condition, " after /; ", number},
               {"- (x <= 1)", is_condition, " after a sign; ", number},
               {"+ (x = 1)", is_equation, " after a sign; ", number},
               {"(x <= 1) ^ 2", is_condition, " before ^; ", number},
               {"2 ^ (x = 1)", is_equation, " after ^; ", number},
               {"(x <= 1) <= 2", is_condition, " before a relation; ", number},
               {"2 <= (x <= 1)", is_condition, " after a relation; ", number},
               {"1 <= x <= (x = 1)", is_equation, " after a relation; ", number},
               {"min(x = 1, 2)", is_equation, " within ( ); ", number},
               {"not x", is_number, " after not; ", condition},
               {"x and x <= 1", is_number, " before and; ", condition},
               {"x <= 1 and x", is_number, " after and; ", condition},
               {"(x = 1) or x <= 1", is_equation, " before or; ", condition},
               {"x <= 1 or (x = 1)", is_equation, " after or; ", condition},
               {"x where x", is_number, " after where; ", condition},
               {"x where x = 1", is_equation, " after where; ", condition}};
  for (const auto& one : cases) {
    EXPECT_THAT(Shape(one.text), HasSubstr(one.is + one.where + one.right)) << one.text;
  }
  EXPECT_THAT(Condition("x"), HasSubstr(is_number + "; " + condition));
  EXPECT_THAT(Number("x <= 1"), HasSubstr(is_condition + "; " + number));
  EXPECT_THAT(Number("x = 1"), HasSubstr(is_equation + "; " + number));
}

TEST(ParseRefusals, AnEquationHasTwoSides) {
  for (const char* text : {"x = 1 = 2", "x <= 1 = 2", "x = 1 <= 2", "x = 1 >= 2"}) {
    EXPECT_THAT(Shape(text), HasSubstr("found a second relation beside an =")) << text;
  }
  EXPECT_EQ(Shape("0 <= x <= y <= 3"), "");
}

TEST(ParseRefusals, FunctionsHaveAsManyArgumentsAsTheyTake) {
  const std::pair<const char*, const char*> cases[] = {
      {"sin(1, 2)", "sin has 2 arguments; 1 would be right"},
      {"pow(1)", "pow has 1 arguments; 2 would be right"},
      {"clamp(1, 2, 3, 4)", "clamp has 4 arguments; 3 would be right"},
      {"min(1)", "min has 1 arguments; 2 to 64 would be right"}};
  for (const auto& [text, why] : cases) EXPECT_THAT(Shape(text), HasSubstr(why));
  std::string most = "min(1";
  for (int i = 1; i < 64; ++i) most += ", 1";
  EXPECT_EQ(Shape(most + ")"), "");
  EXPECT_THAT(Shape(most + ", 1)"), HasSubstr("min has 65 arguments; 2 to 64"));
}

TEST(ParseRefusals, WhatNestsIsLimitedOfEveryKind) {
  const struct {
    std::string open, inside, close;
  } cases[] = {{"not ", "x <= 1", ""}, {"- ", "x", ""},   {"+", "x", ""},
               {"(", "x", ")"},        {"2 ^ ", "x", ""}, {"sin(", "x", ")"}};
  for (const auto& one : cases) {
    std::string text = one.inside;
    for (int depth = 0; depth <= 5; ++depth) {
      EXPECT_EQ(Shape(text, {}, {.depth = 5}), "") << text;
      text = one.open + text + one.close;
    }
    EXPECT_EQ(Shape(text, {}, {.depth = 5}), "nests deeper than 5 levels") << text;
  }
}

TEST(ParseRefusals, OperationsAreCountedInChainsToo) {
  std::string text = "x";
  for (int i = 0; i < 30; ++i) text += absl::StrCat(" + sin(x * ", i, ")");
  EXPECT_EQ(Shape(text), "");
  EXPECT_EQ(Shape(text, {}, {.nodes = 20}), "has more than 20 operations");
  EXPECT_EQ(Shape("min(sin(x), cos(y), exp(z), abs(x))", {}, {.nodes = 4}),
            "has more than 4 operations");
}

TEST(ParseRefusals, NumbersAreThoseOfSinglePrecision) {
  for (const char* text : {".", "1e39", "1e999", "x + .e1"}) {
    EXPECT_THAT(Number(text), HasSubstr("found no number that single precision holds")) << text;
  }
  for (const char* text : {"3.4e38", ".5", "5.", "1e-30"}) EXPECT_EQ(Number(text), "") << text;
}

TEST(ParseRefusals, NamesAreToldAsFarAsThereIsRoom) {
  EXPECT_EQ(Number("_a + a_", {{"_a", 1}, {"a_", 2}}), "");
  EXPECT_THAT(Number("_b", {{"_a", 1}}), HasSubstr("there is no '_b'; there are x, y, z, pi, tau, "
                                                   "e, voxel, _a, and functions with ("));
  EXPECT_THAT(Number("w"), HasSubstr("there is no 'w'"));
  EXPECT_THAT(Number("A"), HasSubstr("there is no 'A'"));
  const std::string whole(64, 'n');
  EXPECT_THAT(Number(whole), HasSubstr("there is no '" + whole + "'"));
  EXPECT_THAT(Number(whole + "n"), HasSubstr("there is no '" + whole + "…'"));
  EXPECT_THAT(Number(whole + "n(1)"), HasSubstr("there is no function '" + whole + "…'"));
  Parameters many;
  for (int i = 0; i < 16; ++i) many.emplace(absl::StrCat("p", i), 0);
  EXPECT_THAT(Number("none", many), HasSubstr("p9, and functions"));
  many.emplace("q", 0);
  many.emplace("r", 0);
  EXPECT_THAT(Number("none", many), HasSubstr("p9 and 2 more, and functions"));
}

// A construct that nests to a given depth.
struct Construct {
  const char* name;
  std::function<std::string(int depth)> text;
  bool is_flat = false;  // it only becomes longer, and equal parts of it are one node
};

std::string Times(const std::string& text, int count) {
  std::string all;
  for (int i = 0; i < count; ++i) all += text;
  return all;
}

std::string Around(const std::string& before, const std::string& middle, int depth) {
  return absl::StrCat(Times(before, depth), middle, Times(")", depth));
}

const Construct kConstructs[] = {
    {"Parentheses", [](int n) { return Around("(", "x", n); }},
    {"ParenthesesInACondition",
     [](int n) { return absl::StrCat("x where ", Around("(", "x <= 1", n)); }},
    {"NumbersInParenthesesInACondition",
     [](int n) { return absl::StrCat("x where ", Around("(", "x", n), " <= 1"); }},
    {"Minus", [](int n) { return absl::StrCat(Times("-", n), "x"); }},
    {"Plus", [](int n) { return absl::StrCat(Times("+ ", n), "x"); }},
    {"Powers", [](int n) { return absl::StrCat(Times("x^", n), "x"); }},
    {"PowersOfSigned", [](int n) { return absl::StrCat(Times("2^-", n), "x"); }},
    {"Nots", [](int n) { return absl::StrCat("x where ", Times("not ", n), "x <= 1"); }},
    {"NotsInParentheses",
     [](int n) { return absl::StrCat("x where ", Around("not (", "x <= 1", n)); }},
    {"Functions", [](int n) { return Around("sin(", "x", n); }},
    {"FirstArguments", [](int n) { return absl::StrCat(Times("min(", n), "x", Times(",y)", n)); }},
    {"LastArguments", [](int n) { return Around("max(x,", "y", n); }},
    {"Unions", [](int n) { return Around("union(x <= 1,", "y <= 1", n); }},
    {"Sums", [](int n) { return absl::StrCat(Times("x+", n), "y"); }},
    {"Relations", [](int n) { return absl::StrCat("x where ", Times("0 <= ", n), "x"); }, true},
    {"ParenthesesNeverClosed", [](int n) { return Times("(", n); }},
    {"FunctionsNeverClosed", [](int n) { return Times("sin(", n); }},
};

class NestedExpression : public ::testing::TestWithParam<Construct> {};

TEST_P(NestedExpression, DoesNotOverflowTheStack) {
  OnSmallStack([] {
    for (int depth = 1; depth <= 1 << 18; depth = depth < 70 ? depth + 1 : depth * 2) {
      Graph graph;
      const auto shape = ParseShape(GetParam().text(depth), {}, {}, graph);
      if (depth > 1024 && !GetParam().is_flat) {
        EXPECT_FALSE(shape.ok()) << depth;
      }
      if (!shape.ok()) {
        EXPECT_FALSE(shape.status().message().empty()) << depth;
      }
    }
  });
}

INSTANTIATE_TEST_SUITE_P(Constructs, NestedExpression, ::testing::ValuesIn(kConstructs),
                         [](const auto& instance) { return std::string(instance.param.name); });

}  // namespace
}  // namespace voxeld::gpu::implicit
