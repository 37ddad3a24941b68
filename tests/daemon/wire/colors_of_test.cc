// Tests colours of segments and triangles, and the results of shells and fills for boxes, spheres,
// cylinders and patches.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <variant>
#include <vector>

#include "daemon/wire/primitive.h"
#include "tests/daemon/wire/faults.h"
#include "tests/daemon/wire/requests.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {
namespace colors_of_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

using P = v1::Primitive;

MaybeFault FaultOf(const P& primitive, Content* content, const Limits& limits = {}) {
  return ToContent(FieldPath("primitive"), primitive, {limits}, content);
}
GeometryPtr Geometry(const P& primitive) {
  Content content;
  const MaybeFault fault = FaultOf(primitive, &content);
  EXPECT_FALSE(fault.has_value()) << fault->field << " " << fault->message;
  return std::get<GeometryPtr>(content);
}

std::vector<uint32_t> ColorsOf(const GeometryData& data) {
  return {data.arrays.colors().begin(), data.arrays.colors().end()};
}
std::vector<float> RowOf(const GeometryData& data) {  // x of each vertex
  std::vector<float> x;
  for (size_t i = 0; i < data.arrays.positions().size(); i += 3)
    x.push_back(data.arrays.positions()[i]);
  return x;
}

// Returns vertices at x = 0, 1, 2 …, and colours 1, 2, 3 … of `colors` elements.
v1::Vertices Row(uint32_t count, int colors) {
  v1::Vertices vertices;
  std::vector<float> positions;
  for (uint32_t i = 0; i < count; ++i) {
    for (const float c : {static_cast<float>(i), static_cast<float>(i * i), 0.0f})
      positions.push_back(c);
  }
  vertices.set_count(count);
  vertices.set_positions(Packed(positions));
  vertices.set_colors_of(v1::Vertices::ELEMENTS);
  for (int i = 0; i < colors; ++i) {
    vertices.mutable_colors()->append({'\0', '\0', static_cast<char>(i + 1)});
  }
  return vertices;
}

P Strip() {
  P p;
  *p.mutable_segments()->mutable_vertices() = Row(3, 2);
  p.mutable_segments()->set_topology(v1::Segments::STRIP);
  return p;
}
P Triangles() {
  P p;
  *p.mutable_mesh()->mutable_vertices() = Row(4, 2);
  p.mutable_mesh()->mutable_vertices()->set_index_count(6);
  p.mutable_mesh()->mutable_vertices()->set_indices(Packed<uint32_t>({0, 1, 2, 2, 1, 3}));
  return p;
}

TEST(ColorsOfElements, SegmentsHaveTheirOwn) {
  GeometryPtr data = Geometry(Strip());
  EXPECT_EQ(data->record.topology, gpu::Topology::kList);
  EXPECT_THAT(RowOf(*data), ElementsAre(0, 1, 1, 2));
  EXPECT_THAT(ColorsOf(*data), ElementsAre(1, 1, 2, 2));
  P loop = Strip();
  *loop.mutable_segments()->mutable_vertices() = Row(3, 3);
  loop.mutable_segments()->set_topology(v1::Segments::LOOP);
  data = Geometry(loop);
  EXPECT_THAT(RowOf(*data), ElementsAre(0, 1, 1, 2, 2, 0));
  EXPECT_THAT(ColorsOf(*data), ElementsAre(1, 1, 2, 2, 3, 3));
  P list = loop;
  *list.mutable_segments()->mutable_vertices() = Row(4, 2);
  list.mutable_segments()->set_topology(v1::Segments::LIST);
  data = Geometry(list);
  EXPECT_THAT(RowOf(*data), ElementsAre(0, 1, 2, 3));
  EXPECT_THAT(ColorsOf(*data), ElementsAre(1, 1, 2, 2));
}

TEST(ColorsOfElements, TrianglesHaveTheirOwn) {
  const GeometryPtr data = Geometry(Triangles());
  EXPECT_EQ(data->record.index_count, 0u);
  EXPECT_THAT(RowOf(*data), ElementsAre(0, 1, 2, 2, 1, 3));
  EXPECT_THAT(ColorsOf(*data), ElementsAre(1, 1, 1, 2, 2, 2));
}

TEST(ColorsOfElements, OfPointsAreThoseOfVertices) {
  P p;
  *p.mutable_points()->mutable_vertices() = Row(3, 3);
  EXPECT_THAT(ColorsOf(*Geometry(p)), ElementsAre(1, 2, 3));
}

TEST(ColorsOfElements, WhatIsWrongIsSaid) {
  const FaultCase cases[] = {
      {"too few", Triangles,
       [](P& p) { p.mutable_mesh()->mutable_vertices()->mutable_colors()->resize(3); },
       "primitive.mesh.vertices.colors", Reason::kSizeMismatch,
       "has 3 bytes, 1 element; 2 elements of 3"},
      {"one a vertex", Strip,
       [](P& p) { p.mutable_segments()->mutable_vertices()->mutable_colors()->resize(9); },
       "primitive.segments.vertices.colors", Reason::kSizeMismatch,
       "has 9 bytes, 3 elements; 2 elements of 3"},
      {"none", Strip, [](P& p) { p.mutable_segments()->mutable_vertices()->clear_colors(); },
       "primitive.segments.vertices.colors_of", Reason::kInvalidValue, "without colors"},
      {"unknown", Strip,
       [](P& p) {
         p.mutable_segments()->mutable_vertices()->set_colors_of(
             static_cast<v1::Vertices::ColorsOf>(7));
       },
       "primitive.segments.vertices.colors_of", Reason::kInvalidValue, "VERTICES, ELEMENTS"},
      {"solid", Triangles, [](P& p) { p.mutable_mesh()->set_fill(v1::FILL_SOLID); },
       "primitive.mesh.fill", Reason::kInvalidValue, "which has one colour"},
      {"textured", Triangles, [](P& p) { p.mutable_mesh()->mutable_texture(); },
       "primitive.mesh.vertices.colors_of", Reason::kInvalidValue, "a texture lies on vertices"},
      {"scaled too", Triangles,
       [](P& p) {
         p.mutable_color_scale()->set_colormap("viridis");
         Set(p.mutable_color_scale()->mutable_along(), 1, 0, 0);
       },
       "primitive.color_scale", Reason::kInvalidValue, "give one of the two"},
      {"a curve", Strip,
       [](P& p) {
         const v1::Vertices vertices = p.segments().vertices();
         *p.mutable_curve()->mutable_vertices() = vertices;
       },
       "primitive.curve.vertices.colors_of", Reason::kInvalidValue, "give VERTICES"},
  };
  ExpectFaults(cases, [](const P& p, Content* content) { return FaultOf(p, content); });
  Content content;
  const MaybeFault fault = FaultOf(Triangles(), &content, {.max_vertices_per_entity = 5});
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->reason, Reason::kQuotaExceeded);
  EXPECT_THAT(fault->message, HasSubstr("makes 6 corners of elements"));
}

// ----------------------------------------------------------------------- boxes, spheres and
// cylinders with shells and fills

P Box() {
  P p;
  Set(p.mutable_box()->mutable_center(), 1, 2, 3);
  Set(p.mutable_box()->mutable_size(), 2, 4, 6);
  return p;
}
P Sphere() {
  P p;
  Set(p.mutable_sphere()->mutable_center(), 1, 2, 3);
  p.mutable_sphere()->set_radius(2);
  return p;
}
P Cylinder() {
  P p;
  Set(p.mutable_cylinder()->mutable_center(), 1, 2, 3);
  p.mutable_cylinder()->set_radius(2);
  p.mutable_cylinder()->set_height(6);
  return p;
}
// The same primitives as shapes with shells.
P GeneralBox() {
  P p;
  Set(p.mutable_parallelepiped()->mutable_center(), 1, 2, 3);
  Set(p.mutable_parallelepiped()->mutable_edge_a(), 2, 0, 0);
  Set(p.mutable_parallelepiped()->mutable_edge_b(), 0, 4, 0);
  Set(p.mutable_parallelepiped()->mutable_edge_c(), 0, 0, 6);
  p.mutable_parallelepiped()->mutable_shell()->set_value(3);
  return p;
}
P GeneralSphere() {
  P p;
  Set(p.mutable_ellipsoid()->mutable_center(), 1, 2, 3);
  Set(p.mutable_ellipsoid()->mutable_radii(), 2, 2, 2);
  p.mutable_ellipsoid()->mutable_shell()->set_value(3);
  return p;
}
P GeneralCylinder() {
  P p;
  Set(p.mutable_cone()->mutable_start(), 1, 2, 0);
  Set(p.mutable_cone()->mutable_end(), 1, 2, 6);
  p.mutable_cone()->set_start_radius(2);
  p.mutable_cone()->set_end_radius(2);
  p.mutable_cone()->mutable_shell()->set_value(3);
  return p;
}

TEST(Shells, BoxesSpheresAndCylindersAreTheGeneralShapes) {
  P box = Box(), sphere = Sphere(), cylinder = Cylinder();
  box.mutable_box()->mutable_shell()->set_value(3);
  sphere.mutable_sphere()->mutable_shell()->set_value(3);
  cylinder.mutable_cylinder()->mutable_shell()->set_value(3);
  const std::pair<P, P> pairs[] = {
      {box, GeneralBox()}, {sphere, GeneralSphere()}, {cylinder, GeneralCylinder()}};
  for (const auto& [own, general] : pairs) {
    const GeometryPtr a = Geometry(own), b = Geometry(general);
    EXPECT_EQ(a->record.kind, gpu::PrimitiveKind::kImplicit);
    EXPECT_EQ(a->record.thickness, 3);
    EXPECT_TRUE(std::equal(a->arrays.indices().begin(), a->arrays.indices().end(),
                           b->arrays.indices().begin(), b->arrays.indices().end()));
    EXPECT_EQ(a->as_sent, own.SerializeAsString());
  }
}

TEST(Shells, WithoutOneTheyStayWithoutAProgram) {
  EXPECT_EQ(Geometry(Box())->record.kind, gpu::PrimitiveKind::kBox);
  EXPECT_EQ(Geometry(Sphere())->record.kind, gpu::PrimitiveKind::kSphere);
  EXPECT_EQ(Geometry(Cylinder())->record.kind, gpu::PrimitiveKind::kCylinder);
}

TEST(Shells, TooThickOnesAreRefused) {
  P p = Sphere();
  p.mutable_sphere()->mutable_shell()->set_value(1e9f);
  Content content;
  const MaybeFault fault = FaultOf(p, &content);
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->field, "primitive.sphere.shell.value");
}

// A patch whose 16 points are at x = 0 to 15, with corners in colours 1, 4, 13 and 16.
P Patches(v1::Fill fill) {
  P p;
  *p.mutable_bezier_surface()->mutable_vertices() = Row(16, 16);
  p.mutable_bezier_surface()->mutable_vertices()->clear_colors_of();
  p.mutable_bezier_surface()->set_fill(fill);
  return p;
}

TEST(PatchFills, LinesAreTheFourEdges) {
  const GeometryPtr data = Geometry(Patches(v1::FILL_LINES));
  EXPECT_EQ(data->record.kind, gpu::PrimitiveKind::kCurves);
  EXPECT_THAT(RowOf(*data), ElementsAre(0, 1, 2, 3, 12, 13, 14, 15, 0, 4, 8, 12, 3, 7, 11, 15));
  EXPECT_THAT(ColorsOf(*data), ElementsAre(1, 1, 4, 4, 13, 13, 16, 16, 1, 1, 13, 13, 4, 4, 16, 16));
}

TEST(PatchFills, DotsAreTheCorners) {
  P p = Patches(v1::FILL_DOTS);
  v1::Vertices* const vertices = p.mutable_bezier_surface()->mutable_vertices();
  std::vector<uint32_t> backwards;
  for (uint32_t i = 0; i < 16; ++i) backwards.push_back(15 - i);
  vertices->set_index_count(16);
  vertices->set_indices(Packed(backwards));
  const GeometryPtr data = Geometry(p);
  EXPECT_EQ(data->record.kind, gpu::PrimitiveKind::kPoints);
  EXPECT_THAT(RowOf(*data), ElementsAre(15, 12, 3, 0));
  EXPECT_THAT(ColorsOf(*data), ElementsAre(16, 13, 4, 1));
}

TEST(PatchFills, SolidIsRefused) {
  Content content;
  const MaybeFault fault = FaultOf(Patches(v1::FILL_SOLID), &content);
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->field, "primitive.bezier_surface.fill");
}

}  // namespace colors_of_test
}  // namespace voxeld::daemon::wire
