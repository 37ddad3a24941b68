// Tests shapes that are drawn by the general method: the errors for wrong ones, and the results for
// valid ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <variant>

#include "daemon/wire/encode_primitive.h"
#include "daemon/wire/primitive.h"
#include "gpu/implicit/program.h"
#include "gpu/implicit/program_check.h"
#include "tests/daemon/wire/faults.h"
#include "tests/daemon/wire/requests.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {
namespace shapes_test {

using ::testing::HasSubstr;

using P = v1::Primitive;

MaybeFault FaultOf(const P& primitive, Content* content, const Limits& limits = {}) {
  return ToContent(FieldPath("primitive"), primitive, {limits}, content);
}

P Torus() {
  P p;
  p.mutable_torus()->set_radius(2);
  p.mutable_torus()->set_tube_radius(0.5);
  return p;
}
P Cone() {
  P p;
  Set(p.mutable_cone()->mutable_end(), 0, 0, 3);
  p.mutable_cone()->set_start_radius(1);
  return p;
}
P Disc() {
  P p;
  p.mutable_disc()->set_radius(2);
  return p;
}
P Patch() {
  P p;
  Set(p.mutable_patch()->mutable_edge_a(), 1, 0, 0);
  Set(p.mutable_patch()->mutable_edge_b(), 0, 1, 0);
  return p;
}
P Parallelepiped() {
  P p;
  Set(p.mutable_parallelepiped()->mutable_edge_a(), 1, 0, 0);
  Set(p.mutable_parallelepiped()->mutable_edge_b(), 0, 1, 0);
  Set(p.mutable_parallelepiped()->mutable_edge_c(), 0, 0, 1);
  return p;
}
P Polygon() {
  P p;
  for (const double number : {0, 0, 0, 1, 0, 0, 0, 1, 0}) p.mutable_polygon()->add_points(number);
  return p;
}
P Ellipsoid() {
  P p;
  Set(p.mutable_ellipsoid()->mutable_radii(), 1, 2, 3);
  return p;
}
P HeightMap() {
  P p;
  v1::HeightMap* const map = p.mutable_height_map();
  Set(map->mutable_edge_a(), 2, 0, 0);
  Set(map->mutable_edge_b(), 0, 4, 0);
  map->set_columns(3);
  map->set_rows(2);
  map->set_heights(Packed<float>({0, 1, 2, 3, 4, -5}));
  return p;
}
P Implicit() {
  P p;
  p.mutable_implicit()->mutable_surface()->set_text("x^2 + y^2 + z^2 <= r");
  p.mutable_implicit()->set_parameter_names("r");
  p.mutable_implicit()->add_parameter_values(4);
  return p;
}

const FaultCase kCases[] = {
    {"ellipsoid_flat", Ellipsoid, [](P& p) { p.mutable_ellipsoid()->mutable_radii()->set_y(0); },
     "primitive.ellipsoid.radii.y", Reason::kInvalidValue, "is 0; give a number greater than 0"},
    {"torus_radius", Torus, [](P& p) { p.mutable_torus()->set_radius(-1); },
     "primitive.torus.radius", Reason::kInvalidValue, "is -1; give a number greater than 0"},
    {"torus_tube", Torus, [](P& p) { p.mutable_torus()->set_tube_radius(0); },
     "primitive.torus.tube_radius", Reason::kInvalidValue, "is 0; give"},
    {"torus_shell", Torus, [](P& p) { p.mutable_torus()->mutable_shell()->set_value(-2); },
     "primitive.torus.shell.value", Reason::kInvalidValue, "is -2; give 0 (one voxel)"},
    {"cone_point", Cone, [](P& p) { p.mutable_cone()->mutable_end()->set_z(0); },
     "primitive.cone.end", Reason::kInvalidValue, "is (0, 0, 0) as start is; give another point"},
    {"cone_no_radius", Cone, [](P& p) { p.mutable_cone()->set_start_radius(0); },
     "primitive.cone.start_radius", Reason::kInvalidValue, "and end_radius are 0"},
    {"cone_negative", Cone, [](P& p) { p.mutable_cone()->set_end_radius(-1); },
     "primitive.cone.end_radius", Reason::kInvalidValue, "is -1; give 0 or more"},
    {"cone_swallowed", Cone,
     [](P& p) {
       p.mutable_cone()->set_round_ends(true);
       p.mutable_cone()->set_end_radius(5);
     },
     "primitive.cone.end_radius", Reason::kInvalidValue, "one end's sphere holds the other's"},
    {"disc_radius", Disc, [](P& p) { p.mutable_disc()->set_radius(0); }, "primitive.disc.radius",
     Reason::kInvalidValue, "is 0; give"},
    {"disc_inner", Disc, [](P& p) { p.mutable_disc()->set_inner_radius(2); },
     "primitive.disc.inner_radius", Reason::kInvalidValue, "is 2; give less than radius, 2"},
    {"disc_normal", Disc, [](P& p) { p.mutable_disc()->mutable_normal(); }, "primitive.disc.normal",
     Reason::kInvalidValue, "is (0, 0, 0); give a direction"},
    {"patch_flat", Patch, [](P& p) { Set(p.mutable_patch()->mutable_edge_b(), -3, 0, 0); },
     "primitive.patch.edge_b", Reason::kInvalidValue, "must span an area"},
    {"parallelepiped_flat", Parallelepiped,
     [](P& p) { Set(p.mutable_parallelepiped()->mutable_edge_c(), 1, 1, 0); },
     "primitive.parallelepiped.edge_c", Reason::kInvalidValue, "must span a volume"},
    {"polygon_line", Polygon, [](P& p) { p.mutable_polygon()->set_points(7, 0); },
     "primitive.polygon.points", Reason::kInvalidValue, "lie along one line"},
    {"ellipsoid_far", Ellipsoid,
     [](P& p) {
       p.mutable_ellipsoid()->mutable_center()->set_x(3e38);
       p.mutable_ellipsoid()->mutable_radii()->set_x(3e38);
     },
     "primitive.ellipsoid", Reason::kOutOfRange, "beyond what single precision holds"},
    {"torus_far", Torus,
     [](P& p) {
       p.mutable_torus()->set_radius(3e38);
       p.mutable_torus()->set_tube_radius(3e38);
     },
     "primitive.torus", Reason::kOutOfRange, "beyond what single precision holds"},
    {"implicit_many_names", Implicit,
     [](P& p) {
       std::string names;
       for (int i = 0; i < 5000; ++i) names += "a ";
       p.mutable_implicit()->set_parameter_names(names);
     },
     "primitive.implicit.parameter_names", Reason::kQuotaExceeded,
     "has more than max_expression_nodes"},
    {"polygon_uneven", Polygon,
     [](P& p) {
       for (const double number : {1, 1, 1}) p.mutable_polygon()->add_points(number);
     },
     "primitive.polygon.points", Reason::kInvalidValue, "away from a plane"},
    {"polygon_numbers", Polygon, [](P& p) { p.mutable_polygon()->add_points(1); },
     "primitive.polygon.points", Reason::kSizeMismatch, "has 10 numbers"},
    {"polygon_short", Polygon, [](P& p) { p.mutable_polygon()->add_ends(2); },
     "primitive.polygon.ends[0]", Reason::kIndexOutOfRange,
     "is 2; a curve has 3 vertices at least"},
    {"polygon_ends", Polygon,
     [](P& p) {
       for (int i = 0; i < 9; ++i) p.mutable_polygon()->add_points(i % 3 == 2 ? 0 : i);
       p.mutable_polygon()->add_ends(3);
     },
     "primitive.polygon.ends", Reason::kSizeMismatch, "ends with 3; there are 6 vertices"},
    {"polygon_infinite", Polygon, [](P& p) { p.mutable_polygon()->set_points(4, 1e300); },
     "primitive.polygon.points[4]", Reason::kInvalidValue, "1e+300"},
    {"disc_solid", Disc, [](P& p) { p.mutable_disc()->set_fill(v1::FILL_SOLID); },
     "primitive.disc.fill", Reason::kInvalidValue, "is FILL_SOLID, but it has no inside"},
    {"patch_solid", Patch, [](P& p) { p.mutable_patch()->set_fill(v1::FILL_SOLID); },
     "primitive.patch.fill", Reason::kInvalidValue, "is FILL_SOLID, but it has no inside"},
    {"polygon_fill", Polygon, [](P& p) { p.mutable_polygon()->set_fill(static_cast<v1::Fill>(9)); },
     "primitive.polygon.fill", Reason::kInvalidValue, "FILL_LINES, FILL_DOTS"},
    {"map_solid", HeightMap, [](P& p) { p.mutable_height_map()->set_fill(v1::FILL_SOLID); },
     "primitive.height_map.fill", Reason::kInvalidValue, "is FILL_SOLID, but it has no inside"},
    {"map_fill", HeightMap,
     [](P& p) { p.mutable_height_map()->set_fill(static_cast<v1::Fill>(9)); },
     "primitive.height_map.fill", Reason::kInvalidValue, "FILL_SURFACE, FILL_LINES, FILL_DOTS"},
    {"map_columns", HeightMap, [](P& p) { p.mutable_height_map()->set_columns(1); },
     "primitive.height_map.columns", Reason::kInvalidValue, "is 1; give 2 or more"},
    {"map_heights", HeightMap, [](P& p) { p.mutable_height_map()->mutable_heights()->pop_back(); },
     "primitive.height_map.heights", Reason::kSizeMismatch, "has 23 bytes; 6 samples take 24"},
    {"map_colors", HeightMap, [](P& p) { p.mutable_height_map()->set_colors("abc"); },
     "primitive.height_map.colors", Reason::kSizeMismatch,
     "has 3 bytes, 1 colour; 6 samples take 18"},
    {"map_type", HeightMap,
     [](P& p) { p.mutable_height_map()->set_height_type(v1::ELEMENT_TYPE_RGB8); },
     "primitive.height_map.height_type", Reason::kInvalidValue,
     "ELEMENT_TYPE_F32, ELEMENT_TYPE_U16"},
    {"map_line", HeightMap, [](P& p) { Set(p.mutable_height_map()->mutable_edge_b(), 1, 0, 0); },
     "primitive.height_map.edge_b", Reason::kInvalidValue, "lies along edge_a"},
    {"map_huge", HeightMap, [](P& p) { p.mutable_height_map()->set_rows(0xFFFFFFFF); },
     "primitive.height_map.rows", Reason::kQuotaExceeded, "max_vertices_per_entity is"},
    {"map_infinite", HeightMap,
     [](P& p) {
       p.mutable_height_map()->set_heights(
           Packed<float>({0, 1, 2, 3, std::numeric_limits<float>::infinity(), 5}));
     },
     "primitive.height_map.heights[4]", Reason::kInvalidValue, "is inf"},
    {"implicit_text", Implicit,
     [](P& p) { p.mutable_implicit()->mutable_surface()->set_text("x +"); },
     "primitive.implicit.surface.text", Reason::kInvalidValue, "at character 4: found the end"},
    {"implicit_nothing", Implicit, [](P& p) { p.mutable_implicit()->clear_surface(); },
     "primitive.implicit.surface", Reason::kInvalidValue, "is not set; give text or tree"},
    {"implicit_bound", Implicit, [](P& p) { p.mutable_implicit()->mutable_bound()->set_text("x"); },
     "primitive.implicit.bound.text", Reason::kInvalidValue, "a condition"},
    {"implicit_parameters", Implicit, [](P& p) { p.mutable_implicit()->add_parameter_values(4); },
     "primitive.implicit.parameter_values", Reason::kSizeMismatch, "has 2 numbers for 1 names"},
    {"implicit_name", Implicit, [](P& p) { p.mutable_implicit()->set_parameter_names("2r"); },
     "primitive.implicit.parameter_names", Reason::kInvalidValue, "a digit not first"},
    {"implicit_unknown", Implicit, [](P& p) { p.mutable_implicit()->set_parameter_names("s"); },
     "primitive.implicit.surface.text", Reason::kInvalidValue, "there is no 'r'"},
    {"implicit_channels", Implicit,
     [](P& p) { p.mutable_implicit()->mutable_red()->set_text("x"); }, "primitive.implicit",
     Reason::kInvalidValue, "has 1 of red, green and blue"},
    {"implicit_level", Implicit, [](P& p) { p.mutable_implicit()->mutable_level()->set_text("x"); },
     "primitive.implicit.colormap", Reason::kInvalidValue, "each goes with the other"},
    {"implicit_colormap", Implicit,
     [](P& p) {
       p.mutable_implicit()->mutable_level()->set_text("x");
       p.mutable_implicit()->set_colormap("sepia");
     },
     "primitive.implicit.colormap", Reason::kNotFound, "there are viridis, plasma"},
    {"implicit_domain", Implicit,
     [](P& p) { Set(p.mutable_implicit()->mutable_domain()->mutable_min(), 1, 1, 1); },
     "primitive.implicit.domain.max.x", Reason::kInvalidValue, ""},
    {"tree_empty", Implicit, [](P& p) { p.mutable_implicit()->mutable_surface()->mutable_tree(); },
     "primitive.implicit.surface.tree.ops", Reason::kSizeMismatch, "leaves 0 numbers"},
    {"tree_starved", Implicit,
     [](P& p) {
       p.mutable_implicit()->mutable_surface()->mutable_tree()->add_ops(v1::Expression::Tree::ADD);
     },
     "primitive.implicit.surface.tree.ops[0]", Reason::kSizeMismatch,
     "is ADD, which takes 2; there are 0"},
    {"tree_value", Implicit,
     [](P& p) {
       p.mutable_implicit()->mutable_surface()->mutable_tree()->add_ops(
           v1::Expression::Tree::CONSTANT);
     },
     "primitive.implicit.surface.tree.ops[0]", Reason::kSizeMismatch,
     "is a CONSTANT beyond the 0 values"},
    {"tree_name", Implicit,
     [](P& p) {
       v1::Expression::Tree* tree = p.mutable_implicit()->mutable_surface()->mutable_tree();
       tree->add_ops(v1::Expression::Tree::PARAMETER);
       tree->set_names("q");
     },
     "primitive.implicit.surface.tree.names", Reason::kNotFound, "none of the parameters"},
    {"tree_left_over", Implicit,
     [](P& p) {
       v1::Expression::Tree* tree = p.mutable_implicit()->mutable_surface()->mutable_tree();
       tree->add_ops(v1::Expression::Tree::X);
       tree->add_values(1);
     },
     "primitive.implicit.surface.tree", Reason::kSizeMismatch,
     "has 1 values and 0 names for 0 constants"},
    {"tree_op", Implicit,
     [](P& p) {
       p.mutable_implicit()->mutable_surface()->mutable_tree()->add_ops(
           static_cast<v1::Expression::Tree::Op>(77));
     },
     "primitive.implicit.surface.tree.ops[0]", Reason::kInvalidValue, "has the unknown value 77"},
};

TEST(Shapes, WhatIsWrongIsSaid) {
  ExpectFaults(kCases, [](const P& p, Content* content) { return FaultOf(p, content); });
}

TEST(Shapes, LimitsHold) {
  Content content;
  P many = Implicit();
  std::string sum = "x";
  for (int i = 0; i < 400; ++i) sum += "+y*" + std::to_string(i);
  many.mutable_implicit()->mutable_surface()->set_text(sum);
  MaybeFault fault = FaultOf(many, &content, {.max_expression_nodes = 100});
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->reason, Reason::kQuotaExceeded);
  EXPECT_THAT(fault->message, HasSubstr("has more than 100 operations"));
  P deep = Implicit();
  deep.mutable_implicit()->mutable_surface()->set_text("((((x))))");
  EXPECT_FALSE(FaultOf(deep, &content, {.max_expression_depth = 4}).has_value());
  fault = FaultOf(deep, &content, {.max_expression_depth = 3});
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->reason, Reason::kQuotaExceeded);
  P wide = Polygon();
  for (const double number : {1, 1, 0}) wide.mutable_polygon()->add_points(number);
  fault = FaultOf(wide, &content, {.max_boundary_points = 3});
  ASSERT_TRUE(fault.has_value());
  EXPECT_THAT(fault->message, HasSubstr("has 4 vertices; max_boundary_points allows 3"));
}

TEST(Shapes, BecomeProgramsWithinBounds) {
  for (P (*good)() : {Torus, Cone, Disc, Patch, Parallelepiped, Polygon, Ellipsoid, Implicit}) {
    Content content;
    const P primitive = good();
    ASSERT_FALSE(FaultOf(primitive, &content).has_value());
    const GeometryData& data = *std::get<GeometryPtr>(content);
    EXPECT_EQ(data.record.kind, gpu::PrimitiveKind::kImplicit);
    EXPECT_EQ(data.kind, P::descriptor()->FindFieldByNumber(primitive.kind_case())->name());
    EXPECT_TRUE(gpu::implicit::CheckProgram(data.arrays.indices(), data.record.vertex_count).ok());
    EXPECT_EQ(data.as_sent, primitive.SerializeAsString());
  }
}

TEST(Shapes, HeightMapsAreTrianglesBetweenTheirSamples) {
  P primitive = HeightMap();
  primitive.mutable_height_map()->set_colors(std::string("\1\2\3\4\5\6\7\10\11aaabbbccc", 18));
  Content content;
  ASSERT_FALSE(FaultOf(primitive, &content).has_value());
  const GeometryData& data = *std::get<GeometryPtr>(content);
  EXPECT_EQ(data.record.kind, gpu::PrimitiveKind::kTriangles);
  EXPECT_STREQ(data.kind, "height_map");
  EXPECT_THAT(data.arrays.positions(),
              testing::ElementsAre(0, 0, 0, 1, 0, 1, 2, 0, 2, 0, 4, 3, 1, 4, 4, 2, 4, -5));
  EXPECT_THAT(data.arrays.indices(), testing::ElementsAre(0, 1, 4, 0, 4, 3, 1, 2, 5, 1, 5, 4));
  EXPECT_THAT(data.arrays.colors(),
              testing::ElementsAre(0x010203, 0x040506, 0x070809, 0x616161, 0x626262, 0x636363));
  EXPECT_THAT(data.min, testing::ElementsAre(0, 0, -5));
  EXPECT_THAT(data.max, testing::ElementsAre(2, 4, 4));
  primitive.mutable_height_map()->clear_colors();
  primitive.mutable_height_map()->set_height_type(v1::ELEMENT_TYPE_U16);
  primitive.mutable_height_map()->set_heights(Packed<uint16_t>({0, 65535, 0, 0, 0, 0}));
  Set(primitive.mutable_height_map()->mutable_up(), 0, 0, 7);
  ASSERT_FALSE(FaultOf(primitive, &content).has_value());
  EXPECT_EQ(std::get<GeometryPtr>(content)->max[2], 7);
}

TEST(Shapes, ATreeSaysWhatItsTextSays) {
  P text = Implicit(), tree = Implicit();
  text.mutable_implicit()->mutable_surface()->set_text("max(x^2 - r, sin(y)*0.5)");
  v1::Expression::Tree* const t = tree.mutable_implicit()->mutable_surface()->mutable_tree();
  using T = v1::Expression::Tree;
  for (const auto op : {T::X, T::CONSTANT, T::POWER, T::PARAMETER, T::SUBTRACT, T::Y, T::SIN,
                        T::CONSTANT, T::MULTIPLY, T::MAX}) {
    t->add_ops(op);
  }
  t->add_values(2);
  t->add_values(0.5);
  t->set_names("r");
  Content of_text, of_tree;
  ASSERT_FALSE(FaultOf(text, &of_text).has_value());
  const MaybeFault fault = FaultOf(tree, &of_tree);
  ASSERT_FALSE(fault.has_value()) << fault->field << " " << fault->message;
  const auto words = [](const Content& content) {
    const auto span = std::get<GeometryPtr>(content)->arrays.indices();
    return std::vector<uint32_t>(span.begin(), span.end());
  };
  EXPECT_EQ(words(of_text), words(of_tree));
}

TEST(Shapes, APolygonMayCrossItself) {
  P bow;
  for (const double number : {0, 0, 0, 1, 1, 0, 1, 0, 0, 0, 1, 0})
    bow.mutable_polygon()->add_points(number);
  Content content;
  const MaybeFault fault = FaultOf(bow, &content);
  EXPECT_FALSE(fault.has_value()) << fault->message;
}

TEST(Shapes, FillIsWhatTheRelationSays) {
  Content content;
  const auto fill = [&](const char* surface) {
    P p = Implicit();
    p.mutable_implicit()->mutable_surface()->set_text(surface);
    EXPECT_FALSE(FaultOf(p, &content).has_value());
    return std::get<GeometryPtr>(content)->record.fill;
  };
  EXPECT_EQ(fill("x <= r"), gpu::Fill::kSolid);
  EXPECT_EQ(fill("x = r"), gpu::Fill::kSurface);
  EXPECT_EQ(fill("x - r"), gpu::Fill::kSurface);
}

TEST(Shapes, HeightMapsHaveRowsColumnsAndSamples) {
  P p = HeightMap();
  p.mutable_height_map()->set_colors("abcdefghijklmnopqr");
  p.mutable_height_map()->set_fill(v1::FILL_LINES);
  Content content;
  ASSERT_FALSE(FaultOf(p, &content).has_value());
  const GeometryPtr lines = std::get<GeometryPtr>(content);
  EXPECT_EQ(lines->record.kind, gpu::PrimitiveKind::kSegments);
  EXPECT_EQ(lines->record.topology, gpu::Topology::kList);
  EXPECT_THAT(lines->arrays.indices(),
              ::testing::ElementsAre(0, 1, 0, 3, 1, 2, 1, 4, 2, 5, 3, 4, 4, 5));
  EXPECT_EQ(lines->arrays.colors()[5], 0x707172u);
  p.mutable_height_map()->set_fill(v1::FILL_DOTS);
  ASSERT_FALSE(FaultOf(p, &content).has_value());
  const GeometryPtr dots = std::get<GeometryPtr>(content);
  EXPECT_EQ(dots->record.kind, gpu::PrimitiveKind::kPoints);
  EXPECT_EQ(dots->record.vertex_count, 6u);
  EXPECT_TRUE(dots->arrays.indices().empty());
  EXPECT_EQ(dots->arrays.positions()[5 * 3 + 2], -5);
}

P OnePoint() {
  P p;
  p.mutable_points()->mutable_vertices()->set_count(1);
  p.mutable_points()->mutable_vertices()->set_positions(std::string(12, '\0'));
  return p;
}

TEST(Shapes, SplatsAreKept) {
  const std::pair<v1::Points::Splat, gpu::Splat> splats[] = {{v1::Points::SOFT, gpu::Splat::kSoft},
                                                             {v1::Points::CUBE, gpu::Splat::kCube},
                                                             {v1::Points::CELL, gpu::Splat::kCell}};
  for (const auto& [wire, ours] : splats) {
    P p = OnePoint();
    p.mutable_points()->set_splat(wire);
    Content content;
    ASSERT_FALSE(FaultOf(p, &content).has_value());
    EXPECT_EQ(std::get<GeometryPtr>(content)->record.splat, ours);
    P told;
    Encode(content, &told);
    EXPECT_EQ(told.points().splat(), wire);
  }
}

TEST(Shapes, CellsHaveNoThickness) {
  P p = OnePoint();
  p.mutable_points()->set_splat(v1::Points::CELL);
  p.mutable_points()->mutable_thickness()->set_value(2);
  Content content;
  const MaybeFault fault = FaultOf(p, &content);
  ASSERT_TRUE(fault.has_value());
  EXPECT_THAT(fault->field, HasSubstr("points.thickness"));
  EXPECT_THAT(fault->message, HasSubstr("is 2; cells have none"));
}

}  // namespace shapes_test
}  // namespace voxeld::daemon::wire
