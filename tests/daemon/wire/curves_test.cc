// Tests curves, wire frames, text and tints from the wire: the errors for wrong ones, the results
// for valid ones, and that watchers receive them as they were sent.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <variant>

#include "daemon/text/fonts.h"
#include "daemon/wire/encode_primitive.h"
#include "daemon/wire/primitive.h"
#include "tests/daemon/wire/curve_messages.h"
#include "tests/daemon/wire/faults.h"
#include "tests/daemon/wire/requests.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {
namespace curves_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

const FaultCase kCases[] = {
    {"curve_form", Curve,
     [](P& p) { p.mutable_curve()->set_form(static_cast<v1::Curve::Form>(9)); },
     "primitive.curve.form", Reason::kInvalidValue, "CATMULL_ROM, B_SPLINE, BEZIER, QUADRATIC"},
    {"curve_bezier", Curve,
     [](P& p) {
       p.mutable_curve()->set_form(v1::Curve::BEZIER);
       p.mutable_curve()->set_closed(true);
     },
     "primitive.curve.vertices.count", Reason::kSizeMismatch, "is 4; give 3 for each closed"},
    {"curve_one", Curve, [](P& p) { *p.mutable_curve()->mutable_vertices() = Line(1); },
     "primitive.curve.vertices.count", Reason::kSizeMismatch, "is 1; give 2 or more"},
    {"curve_sampling", Curve,
     [](P& p) { p.mutable_curve()->set_sampling(static_cast<v1::LineSampling>(9)); },
     "primitive.curve.sampling", Reason::kInvalidValue, "LINE_SAMPLING_THIN"},
    {"arc_radius", Arc, [](P& p) { p.mutable_arc()->set_radius(0); }, "primitive.arc.radius",
     Reason::kInvalidValue, "is 0; give"},
    {"arc_normal", Arc, [](P& p) { p.mutable_arc()->mutable_normal(); }, "primitive.arc.normal",
     Reason::kInvalidValue, "has no direction"},
    {"arc_toward", Arc, [](P& p) { Set(p.mutable_arc()->mutable_toward(), 0, 0, -3); },
     "primitive.arc.toward", Reason::kInvalidValue, "lies along normal"},
    {"arc_sweep", Arc, [](P& p) { p.mutable_arc()->set_sweep(7); }, "primitive.arc.sweep",
     Reason::kInvalidValue, "is 7; give"},
    {"arc_far", Arc,
     [](P& p) {
       p.mutable_arc()->set_radius(3e38);
       p.mutable_arc()->mutable_center()->set_x(3e38);
     },
     "primitive.arc", Reason::kOutOfRange, "beyond what single precision holds"},
    {"ellipse_flat", Ellipse, [](P& p) { Set(p.mutable_ellipse()->mutable_axis_b(), 5, 0, 0); },
     "primitive.ellipse.axis_b", Reason::kInvalidValue, "spans no area"},
    {"helix_turns", Helix, [](P& p) { p.mutable_helix()->set_turns(0); }, "primitive.helix.turns",
     Reason::kInvalidValue, "is 0; give up to 1024"},
    {"helix_end", Helix, [](P& p) { p.mutable_helix()->clear_end(); }, "primitive.helix.end",
     Reason::kInvalidValue, "is where start is"},
    {"helix_end_radius", Helix, [](P& p) { p.mutable_helix()->set_end_radius(-1); },
     "primitive.helix.end_radius", Reason::kInvalidValue, "is -1; give 0 or more"},
    {"surface_count", BezierSurface,
     [](P& p) { *p.mutable_bezier_surface()->mutable_vertices() = Line(15); },
     "primitive.bezier_surface.vertices.count", Reason::kSizeMismatch, "is 15; give 16"},
    {"arrow_end", Arrow, [](P& p) { p.mutable_arrow()->clear_end(); }, "primitive.arrow.end",
     Reason::kInvalidValue, "as start is"},
    {"arrow_head", Arrow, [](P& p) { p.mutable_arrow()->set_head_length(5); },
     "primitive.arrow.head_length", Reason::kInvalidValue, "is 5; the arrow is 4 long"},
    {"text_height", Text, [](P& p) { p.mutable_text()->clear_height(); }, "primitive.text.height",
     Reason::kInvalidValue, "is 0; give"},
    {"text_up", Text, [](P& p) { Set(p.mutable_text()->mutable_up(), 0, 0, 1); },
     "primitive.text.up", Reason::kInvalidValue, "lies along facing"},
    {"text_font", Text, [](P& p) { p.mutable_text()->set_font("No Such Family"); },
     "primitive.text.font", Reason::kNotFound, "is No Such Family, which is none; there are "},
    {"text_depth", Text,
     [](P& p) {
       p.mutable_text()->set_style(v1::Text::OUTLINE);
       p.mutable_text()->set_depth(1);
     },
     "primitive.text.depth", Reason::kInvalidValue, "only FILLED letters"},
    {"text_long", Text, [](P& p) { p.mutable_text()->set_text(std::string(70000, 'a')); },
     "primitive.text.text", Reason::kQuotaExceeded, "has 70000 bytes"},
    {"text_many", Text, [](P& p) { p.mutable_text()->set_text(std::string(5000, 'a')); },
     "primitive.text.text", Reason::kQuotaExceeded, "has 5000 characters; give at most 4096"},
    {"text_strokes", Text,
     [](P& p) {
       p.mutable_text()->set_style(v1::Text::STROKES);
       p.mutable_text()->set_text("a\xC3\x9F");
     },
     "primitive.text.text", Reason::kInvalidValue, "at byte 1 that stroke fonts have not"},
    {"text_spacing", Text, [](P& p) { p.mutable_text()->set_line_spacing(-1); },
     "primitive.text.line_spacing", Reason::kInvalidValue, "is -1; give 0 or more"},
    {"splat", Points,
     [](P& p) { p.mutable_points()->set_splat(static_cast<v1::Points::Splat>(9)); },
     "primitive.points.splat", Reason::kInvalidValue, "BALL, SOFT, CUBE"},
    {"mesh_solid_colors", Mesh,
     [](P& p) {
       p.mutable_mesh()->set_fill(v1::FILL_SOLID);
       p.mutable_mesh()->mutable_vertices()->set_colors(
           std::string(3 * p.mesh().vertices().count(), 'x'));
     },
     "primitive.mesh.fill", Reason::kInvalidValue, "which has one colour"},
    {"scale_neither", Scaled, [](P& p) { p.mutable_color_scale()->clear_colormap(); },
     "primitive.color_scale.colormap", Reason::kInvalidValue, "give one of the two"},
    {"scale_name", Scaled, [](P& p) { p.mutable_color_scale()->set_colormap("mud"); },
     "primitive.color_scale.colormap", Reason::kNotFound, "is \"mud\", which is none"},
    {"scale_scalars", Scaled,
     [](P& p) {
       p.mutable_color_scale()->clear_along();
       p.mutable_color_scale()->set_scalars("1234");
     },
     "primitive.color_scale.scalars", Reason::kSizeMismatch,
     "has 4 bytes, 1 number; 3 vertices take 12"},
    {"scale_one_color", Scaled,
     [](P& p) {
       p.mutable_color_scale()->clear_colormap();
       p.mutable_color_scale()->add_colors(1);
     },
     "primitive.color_scale.colors", Reason::kSizeMismatch, "has 1; give 2 to 256"},
    {"scale_direction", Scaled,
     [](P& p) { Set(p.mutable_color_scale()->mutable_along(), 0, 0, 0); },
     "primitive.color_scale.along", Reason::kInvalidValue, "has no direction"},
    {"scale_colors_too", Scaled,
     [](P& p) { p.mutable_points()->mutable_vertices()->set_colors("123456789"); },
     "primitive.color_scale", Reason::kInvalidValue, "so are colours of vertices"},
};

TEST_F(CurvesTest, WhatIsWrongIsSaid) {
  ExpectFaults(kCases, [this](const P& p, Content* content) { return FaultOf(p, content); });
}

TEST_F(CurvesTest, EveryOneIsToldAsItWasSent) {
  for (P (*const make)() : {Curve, Arc, Ellipse, Helix, BezierSurface, Arrow, Text}) {
    const P sent = make();
    Content content, again;
    ASSERT_FALSE(FaultOf(sent, &content).has_value());
    P told;
    Encode(content, &told);
    EXPECT_LE(told.ByteSizeLong(), EncodedBytes(content));
    EXPECT_EQ(told.kind_case(), sent.kind_case());
    ASSERT_FALSE(FaultOf(told, &again).has_value()) << told.ShortDebugString();
    P twice;
    Encode(again, &twice);
    EXPECT_EQ(twice.SerializeAsString(), told.SerializeAsString());
  }
}

TEST_F(CurvesTest, CurvesBecomeSpansWithTheirColors) {
  P p = Curve();
  p.mutable_curve()->mutable_vertices()->set_colors(std::string("\1\0\0\2\0\0\3\0\0\4\0\0", 12));
  p.mutable_curve()->mutable_thickness()->set_value(3);
  const GeometryData& data = Geometry(p);
  EXPECT_EQ(data.record.kind, gpu::PrimitiveKind::kCurves);
  EXPECT_EQ(data.record.vertex_count, 12u) << "three spans";
  EXPECT_EQ(data.record.thickness, 3);
  EXPECT_THAT(std::vector(data.arrays.colors().begin(), data.arrays.colors().end()),
              ElementsAre(0x010000, 0x010000, 0x020000, 0x020000, 0x020000, 0x020000, 0x030000,
                          0x030000, 0x030000, 0x030000, 0x040000, 0x040000));
  EXPECT_STREQ(data.kind, "curve");
}

TEST_F(CurvesTest, PatchesMayBeIndexed) {
  P p = BezierSurface();
  v1::Vertices* const vertices = p.mutable_bezier_surface()->mutable_vertices();
  std::vector<uint32_t> indices;
  for (uint32_t i = 0; i < 32; ++i) indices.push_back(i % 16);
  vertices->set_index_count(32);
  vertices->set_indices(Packed(indices));
  const GeometryData& data = Geometry(p);
  EXPECT_EQ(data.record.vertex_count, 32u);
  EXPECT_EQ(data.record.index_count, 0u);
  EXPECT_EQ(data.arrays.positions()[16 * 3 + 3], 1);
}

TEST_F(CurvesTest, FramesHaveTheirEdgesAndCorners) {
  P box;
  Set(box.mutable_box()->mutable_size(), 2, 4, 6);
  box.mutable_box()->set_fill(v1::FILL_LINES);
  EXPECT_EQ(Geometry(box).record.vertex_count, 12u * 4) << "its edges";
  EXPECT_EQ(Geometry(box).record.kind, gpu::PrimitiveKind::kCurves);
  EXPECT_EQ(Geometry(box).max[2], 3);
  box.mutable_box()->set_fill(v1::FILL_DOTS);
  EXPECT_EQ(Geometry(box).record.kind, gpu::PrimitiveKind::kPoints);
  EXPECT_EQ(Geometry(box).record.vertex_count, 8u);
  EXPECT_STREQ(Geometry(box).kind, "box");
  P torus = Torus();
  torus.mutable_torus()->set_fill(v1::FILL_DOTS);
  EXPECT_EQ(Geometry(torus).record.vertex_count, 64u);
  P sphere;
  sphere.mutable_sphere()->set_radius(1);
  sphere.mutable_sphere()->set_fill(v1::FILL_DOTS);
  EXPECT_EQ(Geometry(sphere).record.vertex_count, 2u + 8 * 3);
  // Two triangles that share an edge have five.
  P mesh = Mesh();
  mesh.mutable_mesh()->set_fill(v1::FILL_LINES);
  v1::Vertices* const vertices = mesh.mutable_mesh()->mutable_vertices();
  *vertices = Line(5);
  vertices->set_index_count(6);
  vertices->set_indices(Packed<uint32_t>({0, 1, 2, 2, 1, 3}));
  EXPECT_EQ(Geometry(mesh).record.index_count, 10u);
  EXPECT_EQ(Geometry(mesh).record.kind, gpu::PrimitiveKind::kSegments);
  mesh.mutable_mesh()->set_fill(v1::FILL_DOTS);
  EXPECT_EQ(Geometry(mesh).record.index_count, 4u) << "the fifth belongs to no triangle";
}

TEST_F(CurvesTest, FramesOfPlaneThingsAndArrows) {
  P p;
  p.mutable_disc()->set_radius(2);
  p.mutable_disc()->set_fill(v1::FILL_LINES);
  EXPECT_EQ(Geometry(p).record.vertex_count, (16 + 8) * 4u) << "a circle and spokes";
  EXPECT_FLOAT_EQ(static_cast<float>(Geometry(p).max[1]), 2);
  p.mutable_disc()->set_fill(v1::FILL_DOTS);
  EXPECT_EQ(Geometry(p).record.vertex_count, 1u + 8);
  p.mutable_disc()->set_inner_radius(1);
  EXPECT_EQ(Geometry(p).record.vertex_count, 8u + 8);
  p.mutable_disc()->set_fill(v1::FILL_LINES);
  EXPECT_EQ(Geometry(p).record.vertex_count, (16 + 16 + 8) * 4u);

  Set(p.mutable_patch()->mutable_edge_a(), 1, 0, 0);
  Set(p.mutable_patch()->mutable_edge_b(), 0, 3, 0);
  p.mutable_patch()->set_fill(v1::FILL_LINES);
  EXPECT_EQ(Geometry(p).record.vertex_count, 4u * 4);
  EXPECT_EQ(Geometry(p).max[1], 3);
  p.mutable_patch()->set_fill(v1::FILL_DOTS);
  EXPECT_EQ(Geometry(p).record.vertex_count, 4u);

  // A square with a triangular hole.
  for (const double number : {0, 0, 0, 9, 0, 0, 9, 9, 0, 0, 9, 0, 2, 2, 0, 5, 2, 0, 2, 5, 0}) {
    p.mutable_polygon()->add_points(number);
  }
  p.mutable_polygon()->add_ends(4);
  p.mutable_polygon()->add_ends(7);
  p.mutable_polygon()->set_fill(v1::FILL_LINES);
  EXPECT_EQ(Geometry(p).record.vertex_count, 7u * 4);
  EXPECT_EQ(Geometry(p).arrays.positions()[27 * 3], 2) << "the hole's last edge ends at its first";
  p.mutable_polygon()->set_fill(v1::FILL_DOTS);
  EXPECT_EQ(Geometry(p).record.vertex_count, 7u);

  P arrow = Arrow();
  arrow.mutable_arrow()->set_fill(v1::FILL_LINES);
  EXPECT_EQ(Geometry(arrow).record.vertex_count, (16 + 8 + 1) * 4u) << "a cone, and a line to it";
  arrow.mutable_arrow()->set_shaft_radius(0.1);
  EXPECT_EQ(Geometry(arrow).record.vertex_count, (16 + 8 + 2 * 16 + 8) * 4u);
  arrow.mutable_arrow()->set_fill(v1::FILL_DOTS);
  EXPECT_EQ(Geometry(arrow).record.vertex_count, 1u + 8 + 16);
}

TEST_F(CurvesTest, LettersShareWhatTheyShare) {
  const GroupData& group = Group(Text());
  ASSERT_EQ(group.parts.size(), 3u);
  int same = 0;
  for (size_t i = 0; i < 3; ++i) {
    for (size_t k = 0; k < i; ++k) same += group.parts[i].geometry == group.parts[k].geometry;
  }
  EXPECT_EQ(same, 1) << "A is the same twice";
  EXPECT_NEAR(group.max[1], 2, 0.15) << "b is about as tall as A";
  EXPECT_NEAR(group.min[1], 0, 0.1);
  EXPECT_EQ(group.min[2], 0);
  EXPECT_STREQ(group.kind, "text");
  P deep = Text();
  deep.mutable_text()->set_depth(1);
  EXPECT_NEAR(Group(deep).min[2], -1, 1e-6) << "to the back";
  EXPECT_EQ(Group(deep).parts[0].geometry->record.fill, gpu::Fill::kSolid);
  P outline = Text();
  outline.mutable_text()->set_style(v1::Text::OUTLINE);
  EXPECT_EQ(Geometry(outline).record.kind, gpu::PrimitiveKind::kCurves);
  P strokes = Text();
  strokes.mutable_text()->set_style(v1::Text::STROKES);
  strokes.mutable_text()->set_alignment(v1::Text::RIGHT);
  EXPECT_LT(Geometry(strokes).max[0], 1e-6) << "they end where the text is";
}

TEST_F(CurvesTest, TextFacesWhereItIsRead) {
  P p = Text();
  Set(p.mutable_text()->mutable_facing(), 0, -2, 0);
  const GroupData& group = Group(p);
  EXPECT_GT(group.max[0], 2) << "along x, as seen from -y";
  EXPECT_NEAR(group.max[2], 2, 0.15) << "upright";
  EXPECT_EQ(group.max[1], 0);
}

TEST_F(CurvesTest, TinyArcsAndBlankTextAreSomewhere) {
  P arc = Arc();
  Set(arc.mutable_arc()->mutable_center(), 5, 0, 0);
  arc.mutable_arc()->set_sweep(1e-12);
  EXPECT_EQ(Geometry(arc).record.vertex_count, 4u);
  EXPECT_GT(Geometry(arc).min[0], 6);
  P text = Text();
  text.mutable_text()->set_text("  \n ");
  Set(text.mutable_text()->mutable_position(), 7, 8, 9);
  EXPECT_TRUE(Group(text).parts.empty());
  EXPECT_EQ(Group(text).min[0], 7);
  EXPECT_EQ(Group(text).max[2], 9);
}

TEST_F(CurvesTest, InstancesHaveTints) {
  P p;
  p.mutable_instance()->set_object("o");
  p.mutable_instance()->mutable_tint()->set_rgb(0x80FF00);
  Content content;
  ASSERT_FALSE(FaultOf(p, &content).has_value());
  EXPECT_EQ(std::get<InstanceRef>(content).tint, 0x80FF00u);
  P told;
  Encode(content, &told);
  EXPECT_EQ(told.SerializeAsString(), p.SerializeAsString());
  p.mutable_instance()->mutable_tint()->set_rgb(0x1000000);
  const MaybeFault fault = FaultOf(p, &content);
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->field, "primitive.instance.tint.rgb");
}

TEST_F(CurvesTest, AMessageMakesNoMoreThanMayWait) {
  // A few bytes that expand to many.
  limits_.max_uncommitted_bytes = 1'000'000;
  v1::ApplyUpdateRequest request;
  for (int i = 0; i < 20; ++i) {
    v1::StreamRequest* const operation = request.add_operations();
    operation->mutable_upsert()->set_layer("l");
    operation->mutable_upsert()->set_id(std::to_string(i));
    P helix = Helix();
    helix.mutable_helix()->set_turns(200);
    *operation->mutable_upsert()->mutable_entity()->mutable_primitive() = helix;
  }
  const Decoded decoded = DecodeUpdate(request, limits_, nullptr, {}, &fonts_);
  ASSERT_TRUE(decoded.status.ok());
  EXPECT_EQ(decoded.refused.issues.size(), 13u) << "each takes 154 kB";
  EXPECT_EQ(decoded.refused.issues[0].reason, Reason::kQuotaExceeded);
  EXPECT_THAT(decoded.refused.issues[0].message, HasSubstr("max_uncommitted_bytes is 1000000"));
}

}  // namespace curves_test
}  // namespace voxeld::daemon::wire
