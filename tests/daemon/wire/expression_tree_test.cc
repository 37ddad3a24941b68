// Tests expressions as trees: each operation has the result of its text, and the errors of a tree
// are reported.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <variant>
#include <vector>

#include "daemon/wire/primitive.h"
#include "tests/daemon/wire/faults.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {
namespace expression_tree_test {

using ::testing::HasSubstr;
using P = v1::Primitive;
using T = v1::Expression::Tree;

MaybeFault FaultOf(const P& primitive, Content* content, const Limits& limits = {}) {
  return ToContent(FieldPath("primitive"), primitive, {limits}, content);
}

P Implicit() {
  P p;
  p.mutable_implicit()->set_parameter_names("a b_2");
  p.mutable_implicit()->add_parameter_values(0.25);
  p.mutable_implicit()->add_parameter_values(-3);
  p.mutable_implicit()->mutable_surface()->mutable_tree()->add_ops(T::X);
  return p;
}

T* TreeOf(P& p) { return p.mutable_implicit()->mutable_surface()->mutable_tree(); }

// Returns the program that the engine gets.
std::vector<uint32_t> Words(const P& p) {
  Content content;
  const MaybeFault fault = FaultOf(p, &content);
  EXPECT_FALSE(fault.has_value()) << fault->field << " " << fault->message;
  if (fault.has_value()) return {};
  const auto span = std::get<GeometryPtr>(content)->arrays.indices();
  return {span.begin(), span.end()};
}

TEST(ExpressionTree, EachOperationIsWhatItsTextIs) {
  const struct {
    const char* text;
    std::vector<T::Op> ops;
  } cases[] = {
      {"x", {T::X}},
      {"y", {T::Y}},
      {"z", {T::Z}},
      {"voxel * x", {T::VOXEL, T::X, T::MULTIPLY}},
      {"-x", {T::X, T::NEGATE}},
      {"abs(x)", {T::X, T::ABS}},
      {"square(x)", {T::X, T::SQUARE}},
      {"sqrt(x)", {T::X, T::SQRT}},
      {"cbrt(x)", {T::X, T::CBRT}},
      {"sin(x)", {T::X, T::SIN}},
      {"cos(x)", {T::X, T::COS}},
      {"tan(x)", {T::X, T::TAN}},
      {"asin(x)", {T::X, T::ASIN}},
      {"acos(x)", {T::X, T::ACOS}},
      {"atan(x)", {T::X, T::ATAN}},
      {"exp(x)", {T::X, T::EXP}},
      {"log(x)", {T::X, T::LOG}},
      {"floor(x)", {T::X, T::FLOOR}},
      {"x + y", {T::X, T::Y, T::ADD}},
      {"x - y", {T::X, T::Y, T::SUBTRACT}},
      {"x * y", {T::X, T::Y, T::MULTIPLY}},
      {"x / y", {T::X, T::Y, T::DIVIDE}},
      {"x ^ y", {T::X, T::Y, T::POWER}},
      {"atan2(x, y)", {T::X, T::Y, T::ATAN2}},
      {"mod(x, y)", {T::X, T::Y, T::MODULO}},
      {"min(x, y)", {T::X, T::Y, T::MIN}},
      {"max(x, y)", {T::X, T::Y, T::MAX}},
      {"max(x, -y)", {T::X, T::Y, T::DIFFERENCE}},
      {"smin(x, y, z)", {T::X, T::Y, T::Z, T::SMOOTH_MIN}},
      {"smax(x, y, z)", {T::X, T::Y, T::Z, T::SMOOTH_MAX}},
  };
  std::vector<bool> seen(T::Op_ARRAYSIZE);
  for (const auto& c : cases) {
    SCOPED_TRACE(c.text);
    P text = Implicit(), tree = Implicit();
    text.mutable_implicit()->mutable_surface()->set_text(c.text);
    TreeOf(tree)->clear_ops();
    for (const T::Op op : c.ops) {
      TreeOf(tree)->add_ops(op);
      seen[op] = true;
    }
    EXPECT_EQ(Words(tree), Words(text));
  }
  for (int op = T::X; op < T::Op_ARRAYSIZE; ++op) {
    if (op != T::PARAMETER) {
      EXPECT_TRUE(seen[op]) << T::Op_Name(op);
    }
  }
}

TEST(ExpressionTree, ValuesAndNamesComeInTheirOrder) {
  P text = Implicit(), tree = Implicit();
  text.mutable_implicit()->mutable_surface()->set_text("x * 2 + b_2 - y * 3 * a");
  TreeOf(tree)->clear_ops();
  for (const T::Op op : {T::X, T::CONSTANT, T::MULTIPLY, T::PARAMETER, T::ADD, T::Y, T::CONSTANT,
                         T::MULTIPLY, T::PARAMETER, T::MULTIPLY, T::SUBTRACT}) {
    TreeOf(tree)->add_ops(op);
  }
  TreeOf(tree)->add_values(2);
  TreeOf(tree)->add_values(3);
  TreeOf(tree)->set_names("b_2 a");
  EXPECT_EQ(Words(tree), Words(text));
}

TEST(ExpressionTree, StandsWhereverATextDoes) {
  // Φ, and the three colours.
  P text = Implicit(), tree = Implicit();
  v1::Implicit* const told = text.mutable_implicit();
  v1::Implicit* const sent = tree.mutable_implicit();
  told->mutable_bound()->set_text("y <= 0");
  for (const T::Op op : {T::Y, T::CONSTANT, T::SUBTRACT})
    sent->mutable_bound()->mutable_tree()->add_ops(op);
  sent->mutable_bound()->mutable_tree()->add_values(0);
  told->mutable_red()->set_text("x");
  told->mutable_green()->set_text("y");
  told->mutable_blue()->set_text("z");
  sent->mutable_red()->mutable_tree()->add_ops(T::X);
  sent->mutable_green()->mutable_tree()->add_ops(T::Y);
  sent->mutable_blue()->mutable_tree()->add_ops(T::Z);
  EXPECT_EQ(Words(tree), Words(text));
}

const FaultCase kCases[] = {
    {"unspecified", Implicit, [](P& p) { TreeOf(p)->add_ops(T::OP_UNSPECIFIED); },
     "primitive.implicit.surface.tree.ops[1]", Reason::kInvalidValue, "unknown value 0"},
    {"one_taken", Implicit, [](P& p) { TreeOf(p)->set_ops(0, T::FLOOR); },
     "primitive.implicit.surface.tree.ops[0]", Reason::kSizeMismatch,
     "is FLOOR, which takes 1; there are 0"},
    {"difference", Implicit, [](P& p) { TreeOf(p)->add_ops(T::DIFFERENCE); },
     "primitive.implicit.surface.tree.ops[1]", Reason::kSizeMismatch,
     "is DIFFERENCE, which takes 2; there are 1"},
    {"three_taken", Implicit,
     [](P& p) {
       TreeOf(p)->add_ops(T::X);
       TreeOf(p)->add_ops(T::SMOOTH_MIN);
     },
     "primitive.implicit.surface.tree.ops[2]", Reason::kSizeMismatch,
     "is SMOOTH_MIN, which takes 3; there are 2"},
    {"smooth_max", Implicit,
     [](P& p) {
       TreeOf(p)->add_ops(T::X);
       TreeOf(p)->add_ops(T::SMOOTH_MAX);
     },
     "primitive.implicit.surface.tree.ops[2]", Reason::kSizeMismatch,
     "is SMOOTH_MAX, which takes 3; there are 2"},
    {"two_left", Implicit, [](P& p) { TreeOf(p)->add_ops(T::X); },
     "primitive.implicit.surface.tree.ops", Reason::kSizeMismatch,
     "leaves 2 numbers; give operations that leave one"},
    {"no_name", Implicit, [](P& p) { TreeOf(p)->set_ops(0, T::PARAMETER); },
     "primitive.implicit.surface.tree.ops[0]", Reason::kSizeMismatch,
     "is a PARAMETER beyond the 0 names"},
    {"name_left_over", Implicit, [](P& p) { TreeOf(p)->set_names("a b_2"); },
     "primitive.implicit.surface.tree", Reason::kSizeMismatch,
     "has 0 values and 2 names for 0 constants and 0 parameters"},
    {"value_left_over", Implicit,
     [](P& p) {
       TreeOf(p)->set_ops(0, T::CONSTANT);
       TreeOf(p)->add_values(1);
       TreeOf(p)->add_values(2);
     },
     "primitive.implicit.surface.tree", Reason::kSizeMismatch,
     "has 2 values and 0 names for 1 constants and 0 parameters"},
    {"name_sign", Implicit, [](P& p) { p.mutable_implicit()->set_parameter_names("a b-2"); },
     "primitive.implicit.parameter_names", Reason::kInvalidValue,
     "has \"b-2\"; letters, digits and _"},
    {"bound_unset", Implicit, [](P& p) { p.mutable_implicit()->mutable_bound(); },
     "primitive.implicit.bound", Reason::kInvalidValue, "is not set; give text or tree"},
    {"bound_tree", Implicit,
     [](P& p) { p.mutable_implicit()->mutable_bound()->mutable_tree()->add_ops(T::ADD); },
     "primitive.implicit.bound.tree.ops[0]", Reason::kSizeMismatch,
     "is ADD, which takes 2; there are 0"},
    {"colours_and_level", Implicit,
     [](P& p) {
       for (v1::Expression* part :
            {p.mutable_implicit()->mutable_red(), p.mutable_implicit()->mutable_green(),
             p.mutable_implicit()->mutable_blue(), p.mutable_implicit()->mutable_level()}) {
         part->set_text("x");
       }
     },
     "primitive.implicit", Reason::kInvalidValue,
     "has 3 of red, green and blue and level; give all three, or level with a colormap, or none"},
    {"two_colours_and_level", Implicit,
     [](P& p) {
       for (v1::Expression* part :
            {p.mutable_implicit()->mutable_green(), p.mutable_implicit()->mutable_blue(),
             p.mutable_implicit()->mutable_level()}) {
         part->set_text("x");
       }
     },
     "primitive.implicit", Reason::kInvalidValue, "has 2 of red, green and blue and level"},
    {"colormap_alone", Implicit, [](P& p) { p.mutable_implicit()->set_colormap("viridis"); },
     "primitive.implicit.colormap", Reason::kInvalidValue,
     "is \"viridis\" without level; each goes with the other"},
    {"blue", Implicit,
     [](P& p) {
       p.mutable_implicit()->mutable_red()->set_text("x");
       p.mutable_implicit()->mutable_green()->set_text("x");
       p.mutable_implicit()->mutable_blue()->set_text("x +");
     },
     "primitive.implicit.blue.text", Reason::kInvalidValue, "at character 4: found the end"},
};

TEST(ExpressionTree, WhatIsWrongIsSaid) {
  ExpectFaults(kCases, [](const P& p, Content* content) { return FaultOf(p, content); });
}

TEST(ExpressionTree, OperationsAreLimited) {
  P p = Implicit();
  Content content;
  for (int i = 0; i < 9; ++i) TreeOf(p)->add_ops(T::SIN);  // ten nodes
  EXPECT_FALSE(FaultOf(p, &content, {.max_expression_nodes = 10}).has_value());
  const MaybeFault fault = FaultOf(p, &content, {.max_expression_nodes = 9});
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->field, "primitive.implicit.surface.tree.ops");
  EXPECT_EQ(fault->reason, Reason::kQuotaExceeded);
  EXPECT_EQ(fault->message, "has more than 9 operations, max_expression_nodes");
}

TEST(ExpressionTree, NamesAreLimited) {
  P p = Implicit();
  Content content;
  EXPECT_FALSE(FaultOf(p, &content, {.max_expression_nodes = 2}).has_value());
  const MaybeFault fault = FaultOf(p, &content, {.max_expression_nodes = 1});
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->field, "primitive.implicit.parameter_names");
  EXPECT_THAT(fault->message, HasSubstr("has more than max_expression_nodes, 1"));
}

}  // namespace expression_tree_test
}  // namespace voxeld::daemon::wire
