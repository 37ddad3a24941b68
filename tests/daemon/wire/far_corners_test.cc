// Tests rare cases: sides of curves, text, grids, scales and textures that ordinary clients do not
// use, each with its error.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/colormaps/colormaps.h"
#include "daemon/wire/color_scale.h"
#include "daemon/wire/element_count.h"
#include "daemon/wire/payload.h"
#include "gpu/curves/spans.h"
#include "gpu/primitives/samples.h"
#include "tests/daemon/pictures/files.h"
#include "tests/daemon/wire/curve_messages.h"
#include "tests/daemon/wire/full_primitives.h"

namespace voxeld::daemon::wire {
namespace far_corners_test {

using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using FarCorners = CurvesTest;

P FullVolume() {
  for (const P& p : FullPrimitives()) {
    if (p.has_volume()) return p;
  }
  return {};
}
P FullIsosurface() {
  for (const P& p : FullPrimitives()) {
    if (p.has_isosurface()) return p;
  }
  return {};
}
v1::Transfer* TransferOf(P& p) { return p.mutable_volume()->mutable_transfer(); }

P SolidMesh() {
  P p = Mesh();
  p.mutable_mesh()->set_fill(v1::FILL_SOLID);
  return p;
}

const FaultCase kCases[] = {
    {"helix_turns", Helix, [](P& p) { p.mutable_helix()->set_turns(-1024.5); },
     "primitive.helix.turns", Reason::kInvalidValue,
     "is -1024.5; give up to 1024 either way, not 0"},
    {"curve_quadratic", Curve, [](P& p) { p.mutable_curve()->set_form(v1::Curve::QUADRATIC); },
     "primitive.curve.vertices.count", Reason::kSizeMismatch,
     "is 4; give 1 and 2 for each quadratic"},
    {"curve_quadratic_closed", Curve,
     [](P& p) {
       p.mutable_curve()->set_form(v1::Curve::QUADRATIC);
       p.mutable_curve()->set_closed(true);
       *p.mutable_curve()->mutable_vertices() = Line(5);
     },
     "primitive.curve.vertices.count", Reason::kSizeMismatch,
     "is 5; give 2 for each closed quadratic"},
    {"text_facing", Text, [](P& p) { p.mutable_text()->mutable_facing(); }, "primitive.text.facing",
     Reason::kInvalidValue, "has no direction; give one that is not 0"},
    {"text_up_nothing", Text, [](P& p) { p.mutable_text()->mutable_up(); }, "primitive.text.up",
     Reason::kInvalidValue, "lies along facing, or one of the two is 0"},
    {"text_not_utf8", Text, [](P& p) { p.mutable_text()->set_text("a\xFF"); },
     "primitive.text.text", Reason::kInvalidValue, "byte 1"},
    {"stroke_font", Text,
     [](P& p) {
       p.mutable_text()->set_style(v1::Text::STROKES);
       p.mutable_text()->set_font("nosuchfont");
     },
     "primitive.text.font", Reason::kNotFound, "is none"},
    {"strokes_many", Text,
     [](P& p) {
       p.mutable_text()->set_style(v1::Text::STROKES);
       p.mutable_text()->set_text(std::string(4097, 'a'));
     },
     "primitive.text.text", Reason::kQuotaExceeded, "has 4097 characters; give at most 4096"},
    {"strokes_control", Text,
     [](P& p) {
       p.mutable_text()->set_style(v1::Text::STROKES);
       p.mutable_text()->set_text("ab\x1f");
     },
     "primitive.text.text", Reason::kInvalidValue, "has a character at byte 2"},
    {"strokes_delete", Text,
     [](P& p) {
       p.mutable_text()->set_style(v1::Text::STROKES);
       p.mutable_text()->set_text("\x7f");
     },
     "primitive.text.text", Reason::kInvalidValue, "has a character at byte 0"},
    {"text_scalars", Text, [](P& p) { p.mutable_color_scale()->set_scalars("1234"); },
     "primitive.color_scale.scalars", Reason::kInvalidValue,
     "the shape has no vertices; give along"},
    {"scale_one_number", Scaled,
     [](P& p) {
       p.mutable_color_scale()->set_low(3);
       p.mutable_color_scale()->set_high(3);
     },
     "primitive.color_scale.high", Reason::kInvalidValue, "is 3 as low is; give another number"},
    {"scale_many", Scaled,
     [](P& p) {
       p.mutable_color_scale()->clear_colormap();
       for (int i = 0; i < 257; ++i) p.mutable_color_scale()->add_colors(1);
     },
     "primitive.color_scale.colors", Reason::kSizeMismatch, "has 257; give 2 to 256"},
    {"scale_both", Scaled,
     [](P& p) { p.mutable_color_scale()->set_scalars(std::string(12, '\0')); },
     "primitive.color_scale.along", Reason::kInvalidValue, "is given, and so is scalars"},
    {"scale_neither_number", Scaled, [](P& p) { p.mutable_color_scale()->clear_along(); },
     "primitive.color_scale.along", Reason::kInvalidValue, "is missing, and so is scalars"},
    {"scale_no_number", Scaled,
     [](P& p) {
       p.mutable_color_scale()->clear_along();
       p.mutable_color_scale()->set_scalars(Packed<float>({1, 2, std::nanf("")}));
     },
     "primitive.color_scale.scalars[2]", Reason::kInvalidValue, "is NaN"},
    {"solid_scale", SolidMesh, [](P& p) { *p.mutable_color_scale() = Scaled().color_scale(); },
     "primitive.color_scale", Reason::kInvalidValue,
     "for a mesh that is FILL_SOLID, which has one colour"},
    {"grid_size", FullVolume, [](P& p) { p.mutable_volume()->mutable_grid()->set_size_c(65537); },
     "primitive.volume.grid.size_c", Reason::kInvalidValue, "is 65537; give 1 to 65536"},
    {"grid_skewed", FullVolume,
     [](P& p) { Set(p.mutable_volume()->mutable_grid()->mutable_edge_c(), 1e8, 1e8, 1e8); },
     "primitive.volume.grid.edge_c", Reason::kSingularTransform,
     "spans next to nothing with edge_a and edge_b"},
    {"values_one", FullVolume,
     [](P& p) {
       TransferOf(p)->clear_values();
       TransferOf(p)->add_values(1);
     },
     "primitive.volume.transfer.values", Reason::kSizeMismatch, "has 1; give 2 to 256"},
    {"values_many", FullVolume,
     [](P& p) {
       for (int i = 2; i < 257; ++i) TransferOf(p)->add_values(i);
     },
     "primitive.volume.transfer.values", Reason::kSizeMismatch, "has 257; give 2 to 256"},
    {"opacities", FullVolume, [](P& p) { TransferOf(p)->add_opacities(1); },
     "primitive.volume.transfer.opacities", Reason::kSizeMismatch,
     "has 3 for 2 values; give one for each, or none"},
    {"opacity_negative", FullVolume, [](P& p) { TransferOf(p)->set_opacities(0, -0.5); },
     "primitive.volume.transfer.opacities[0]", Reason::kInvalidValue, "is -0.5; give 0 to 1"},
    {"opacity_great", FullVolume, [](P& p) { TransferOf(p)->set_opacities(1, 1.5); },
     "primitive.volume.transfer.opacities[1]", Reason::kInvalidValue, "is 1.5; give 0 to 1"},
    {"shell_of_tiny_cells", FullIsosurface,
     [](P& p) {
       Set(p.mutable_isosurface()->mutable_grid()->mutable_edge_a(), 1e-37, 0, 0);
       Set(p.mutable_isosurface()->mutable_grid()->mutable_edge_b(), 0, 1e-37, 0);
       Set(p.mutable_isosurface()->mutable_grid()->mutable_edge_c(), 0, 0, 1e-37);
       p.mutable_isosurface()->mutable_shell()->set_value(4096);
     },
     "primitive.isosurface.shell", Reason::kOutOfRange,
     " samples thick; give less, or another grid"},
    {"kind", Points, [](P& p) { p.clear_kind(); }, "primitive.kind", Reason::kInvalidValue,
     "is not set, or not known to this version"},
};

TEST_F(FarCorners, WhatIsWrongIsSaid) {
  ExpectFaults(kCases, [this](const P& p, Content* content) { return FaultOf(p, content); });
}

TEST_F(FarCorners, ControlPointsAreCountedBeforeTheyAreMade) {
  P indexed = BezierSurface();
  std::vector<uint32_t> indices(32, 1);
  indexed.mutable_bezier_surface()->mutable_vertices()->set_index_count(32);
  indexed.mutable_bezier_surface()->mutable_vertices()->set_indices(Packed(indices));
  P long_helix = Helix();
  long_helix.mutable_helix()->set_turns(-2.5);
  const struct {
    P primitive;
    uint32_t needed;
    const char* field;
  } cases[] = {
      // Three spans of four points; 32 points of two patches; eight spans a turn.
      {Curve(), 16, "primitive.curve.vertices.count"},
      {indexed, 32, "primitive.bezier_surface.vertices.index_count"},
      {long_helix, static_cast<uint32_t>(std::ceil(2.5 * gpu::Spans::kSpansPerTurn)) * 4,
       "primitive.helix.turns"},
  };
  for (const auto& c : cases) {
    SCOPED_TRACE(c.field);
    Content content;
    limits_.max_vertices_per_entity = c.needed;
    EXPECT_FALSE(FaultOf(c.primitive, &content).has_value());
    limits_.max_vertices_per_entity = c.needed - 1;
    const MaybeFault fault = FaultOf(c.primitive, &content);
    ASSERT_TRUE(fault.has_value());
    EXPECT_EQ(fault->field, c.field);
    EXPECT_EQ(fault->reason, Reason::kQuotaExceeded);
    EXPECT_EQ(fault->message,
              absl::StrCat("makes ", c.needed, " control points; max_vertices_per_entity is ",
                           c.needed - 1));
  }
}

TEST_F(FarCorners, AHeightMapsTrianglesAreLimited) {
  P map;
  for (const P& p : FullPrimitives()) {
    if (p.has_height_map()) map = p;
  }
  Content content;
  limits_.max_indices_per_entity = 6;
  EXPECT_FALSE(FaultOf(map, &content).has_value());
  limits_.max_indices_per_entity = 5;
  const MaybeFault fault = FaultOf(map, &content);
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->field, "primitive.height_map.rows");
  EXPECT_EQ(fault->message,
            "makes 4 samples and 6 corners of triangles; max_vertices_per_entity is 16777216, "
            "max_indices_per_entity 5");
}

TEST_F(FarCorners, AngleZeroIsAcrossWhateverTheNormalIs) {
  // Along x, the direction across it cannot be x: angle 0 is on the side of y, as it is on the side
  // of x elsewhere.
  P arc = Arc();
  Set(arc.mutable_arc()->mutable_normal(), 5, 0, 0);
  const GeometryData& along_x = Geometry(arc);
  EXPECT_THAT(along_x.arrays.positions().first(3), ElementsAre(0, 2, 0));
  Set(arc.mutable_arc()->mutable_normal(), 0, 5, 0);
  const GeometryData& along_y = Geometry(arc);
  EXPECT_THAT(along_y.arrays.positions().first(3), ElementsAre(2, 0, 0));
}

TEST_F(FarCorners, AConeMayComeToAPointAtItsBeginning) {
  P cone;
  Set(cone.mutable_cone()->mutable_end(), 0, 0, 3);
  cone.mutable_cone()->set_end_radius(2);
  const GeometryData& data = Geometry(cone);
  EXPECT_THAT(std::vector<double>(data.min, data.min + 3), ElementsAre(-2, -2, testing::Le(0)));
}

TEST_F(FarCorners, TextThatFacesAlongYHasItsUpAlongZ) {
  P text = Text();
  text.mutable_text()->set_text("I");
  text.mutable_text()->set_style(v1::Text::STROKES);
  Set(text.mutable_text()->mutable_facing(), 0, -2, 0);
  const GeometryData& data = Geometry(text);
  EXPECT_EQ(data.min[1], 0);
  EXPECT_EQ(data.max[1], 0);
  EXPECT_NEAR(data.max[2] - data.min[2], 2, 1e-6) << "a capital has the given height";
}

TEST_F(FarCorners, StrokesAreAlignedAndBroken) {
  P text = Text();
  text.mutable_text()->set_style(v1::Text::STROKES);
  text.mutable_text()->set_text("HH HH\n\nH");
  const GeometryData left = Geometry(text);
  text.mutable_text()->set_alignment(v1::Text::CENTER);
  const GeometryData center = Geometry(text);
  text.mutable_text()->set_alignment(v1::Text::RIGHT);
  const GeometryData right = Geometry(text);
  const double width = left.max[0] - left.min[0];
  EXPECT_GT(left.min[0], 0);
  EXPECT_LT(right.max[0], 0);
  EXPECT_NEAR(center.min[0], -center.max[0], 1e-5);
  EXPECT_NEAR(right.max[0] - right.min[0], width, 1e-5);
  // Three lines, the second of them empty, then a fourth where the first is broken.
  EXPECT_NEAR(left.max[1] - left.min[1], 2 * 1.6 * 2 + 2, 1e-5);
  text.mutable_text()->set_width(width / 2 + 1);
  text.mutable_text()->set_line_spacing(2);
  const GeometryData broken = Geometry(text);
  EXPECT_LT(broken.max[0] - broken.min[0], width * 0.7);
  EXPECT_NEAR(broken.max[1] - broken.min[1], 2 * 3 * 1.6 * 2 + 2, 1e-5);
  EXPECT_EQ(broken.record.vertex_count, left.record.vertex_count);
  text.mutable_text()->clear_width();
  text.mutable_text()->set_font("futuram");
  EXPECT_GT(Geometry(text).record.vertex_count, left.record.vertex_count) << "two strokes for each";
}

TEST_F(FarCorners, LettersAreLimited) {
  P text = Text();
  Content content;
  limits_.max_parts_per_object = 3;
  ASSERT_FALSE(FaultOf(text, &content).has_value());
  limits_.max_parts_per_object = 2;
  MaybeFault fault = FaultOf(text, &content);
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->field, "primitive.text.text");
  EXPECT_EQ(fault->reason, Reason::kQuotaExceeded);
  limits_ = {};
  limits_.max_boundary_points = 3;
  fault = FaultOf(text, &content);
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->field, "primitive.text");
  EXPECT_EQ(fault->reason, Reason::kQuotaExceeded);
  EXPECT_THAT(fault->message, HasSubstr("max_boundary_points is 3"));
  *text.mutable_color_scale() = Scaled().color_scale();
  EXPECT_TRUE(FaultOf(text, &content).has_value());
}

TEST_F(FarCorners, WithoutFontsThereIsNoText) {
  Content content;
  const MaybeFault fault = ToContent(FieldPath("primitive"), Text(), {limits_}, &content);
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->reason, Reason::kUnimplemented);
  EXPECT_THAT(fault->message, HasSubstr("there are no fonts here"));
}

TEST_F(FarCorners, LettersThicknessIsInTheTextsUnits) {
  P text = Text();
  text.mutable_text()->mutable_thickness()->set_value(3);
  EXPECT_EQ(Group(text).parts[0].geometry->record.thickness, 3);
  text.mutable_text()->mutable_thickness()->set_unit(v1::Thickness::UNITS);
  EXPECT_EQ(Group(text).parts[0].geometry->record.thickness, 1.5f)
      << "made in capital heights, of 2";
}

TEST_F(FarCorners, TransferFunctionsMayJumpAndTakeAColormap) {
  P volume = FullVolume();
  v1::Transfer* const transfer = TransferOf(volume);
  transfer->Clear();
  for (const double value : {0.0, 1.0, 1.0, 2.0}) transfer->add_values(value);
  for (const uint32_t color : {0x0000FF, 0x0000FF, 0xFF0000, 0xFF0000}) transfer->add_colors(color);
  const auto table = [&](const P& p) {
    const GroupData& group = Group(p);
    const auto words = group.parts[0].geometry->arrays.indices();
    return std::vector<uint32_t>(
        words.begin() + gpu::kSampleHeadWords,
        words.begin() + gpu::kSampleHeadWords + gpu::SampleHead::kTableEntries);
  };
  std::vector<uint32_t> entries = table(volume);
  for (uint32_t& entry : entries) entry &= 0xFFFFFF;
  EXPECT_THAT(std::vector<uint32_t>(entries.begin(), entries.begin() + 128), Each(0x0000FFu))
      << "before the jump";
  EXPECT_THAT(std::vector<uint32_t>(entries.begin() + 128, entries.end()), Each(0xFF0000u))
      << "from it on";
  transfer->clear_colors();
  transfer->set_colormap("viridis");
  const ColorTable viridis = *FindColormap("viridis");
  entries = table(volume);
  for (size_t i = 0; i < entries.size(); ++i) EXPECT_EQ(entries[i] & 0xFFFFFF, viridis[i]) << i;
}

TEST_F(FarCorners, TransferFunctionsMayEndInAStep) {
  P volume = FullVolume();
  v1::Transfer* const transfer = TransferOf(volume);
  transfer->Clear();
  for (const double value : {0.0, 1.0, 1.0}) transfer->add_values(value);
  for (const uint32_t color : {0x0000FF, 0x0000FF, 0xFF0000}) transfer->add_colors(color);
  const auto words = Group(volume).parts[0].geometry->arrays.indices();
  const uint32_t* const table = &words[gpu::kSampleHeadWords];
  EXPECT_EQ(table[254] & 0xFFFFFF, 0x0000FFu);
  EXPECT_EQ(table[255] & 0xFFFFFF, 0xFF0000u) << "the last, and all beyond it";
}

TEST_F(FarCorners, WhatIsTooIntricateForTheEngineIsRefused) {
  // Sixty-four numbers that are all needed until the end.
  P p;
  std::string text = "1";
  for (int i = 0; i < 64; ++i) text += absl::StrCat("*sin(x+", i, ")");
  for (int i = 63; i >= 0; --i)
    text = absl::StrCat("(", text, "+sin(x+", i, "))*sin(x+", i * 7 % 64, ")");
  p.mutable_implicit()->mutable_surface()->set_text(text);
  limits_.max_expression_depth = 1000;
  Content content;
  const MaybeFault fault = FaultOf(p, &content);
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->field, "primitive.implicit");
  EXPECT_EQ(fault->reason, Reason::kQuotaExceeded);
  EXPECT_THAT(fault->message, HasSubstr("intermediate results at once"));
}

TEST_F(FarCorners, AScaleOverNextToNothingColoursTextAllTheSame) {
  P text = Text();
  *text.mutable_color_scale() = Scaled().color_scale();
  text.mutable_color_scale()->set_high(1e13);
  EXPECT_EQ(Group(text).parts.size(), 3u);
  text.mutable_text()->set_style(v1::Text::STROKES);
  text.mutable_text()->set_text(" ");
  EXPECT_EQ(Geometry(text).record.vertex_count, 0u) << "nothing is coloured";
}

TEST_F(FarCorners, NearestIsTheFilterThatWasAskedFor) {
  P volume = FullVolume();
  const auto filter = [&] {
    const auto words = Group(volume).parts[0].geometry->arrays.indices();
    gpu::SampleHead head;
    std::memcpy(&head, words.data(), sizeof(head));
    return head.filter;
  };
  EXPECT_EQ(filter(), gpu::SampleFilter::kLinear);
  volume.mutable_volume()->mutable_grid()->set_filter(v1::Grid::NEAREST);
  EXPECT_EQ(filter(), gpu::SampleFilter::kNearest);
}

TEST_F(FarCorners, PicturesThatAreTooHighOrBreakOff) {
  P mesh = Mesh();
  v1::Texture* const texture = mesh.mutable_mesh()->mutable_texture();
  texture->set_coordinates(std::string(6 * 8, '\0'));
  texture->set_picture(pictures::PngOf(1, 8193, std::vector<uint32_t>(8193)));
  Content content;
  MaybeFault fault = FaultOf(mesh, &content);
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->reason, Reason::kQuotaExceeded);
  EXPECT_THAT(fault->message, HasSubstr("is a picture of 1 × 8193; "));
  // Its size can be read, but its pixels cannot.
  std::string broken = pictures::PngOf(64, 64, std::vector<uint32_t>(64 * 64, 5));
  broken.resize(broken.size() - 30);
  texture->set_picture(broken);
  fault = FaultOf(mesh, &content);
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->field, "primitive.mesh.texture.picture");
  EXPECT_EQ(fault->reason, Reason::kInvalidValue);
  EXPECT_THAT(fault->message, HasSubstr("; give a whole PNG or JPEG file"));
}

TEST_F(FarCorners, AnOpenMeshIsToldOfWithHowManyTrianglesItsEdgeHas) {
  // Three triangles on the edge from vertex 0 to 1, each of whose other edges has two.
  v1::StreamRequest request = MeshRequest();
  v1::Mesh* const mesh = PrimitiveOf(request)->mutable_mesh();
  mesh->mutable_vertices()->set_count(5);
  mesh->mutable_vertices()->set_positions(
      Packed<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 1}));
  const std::vector<uint32_t> corners = {0, 1, 2, 0, 1, 3, 0, 1, 4};
  mesh->mutable_vertices()->set_index_count(9);
  mesh->mutable_vertices()->set_indices(Packed(corners));
  mesh->set_fill(v1::FILL_SOLID);
  const Decoded decoded = Decode(request);
  ASSERT_EQ(decoded.refused.issues.size(), 1u);
  EXPECT_THAT(decoded.refused.issues[0].message,
              HasSubstr("the edge of vertices 0 and 1 belongs to 3 triangles, and"));
  // Without a receiver for the Issue, the surface is drawn all the same.
  Content content;
  EXPECT_FALSE(FaultOf(*PrimitiveOf(request), &content).has_value());
  EXPECT_EQ(std::get<GeometryPtr>(content)->record.kind, gpu::PrimitiveKind::kTriangles);
}

TEST_F(FarCorners, AnInstanceTakesNoColours) {
  P instance;
  instance.mutable_instance()->set_object("o");
  Content content;
  ASSERT_FALSE(FaultOf(instance, &content).has_value());
  *instance.mutable_color_scale() = Scaled().color_scale();
  MaybeFault fault = FaultOf(instance, &content);
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->field, "primitive.color_scale");
  EXPECT_EQ(fault->reason, Reason::kUnimplemented);
  P implicit;
  implicit.mutable_implicit()->mutable_surface()->set_text("x");
  *implicit.mutable_color_scale() = Scaled().color_scale();
  fault = FaultOf(implicit, &content);
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->message, "is given, but implicit takes none; leave it out");
}

TEST_F(FarCorners, SegmentsAndCurvesTakeScales) {
  for (P p : {Curve(), Mesh(), Points()}) {
    *p.mutable_color_scale() = Scaled().color_scale();
    EXPECT_EQ(Geometry(p).record.color_mode, gpu::ColorMode::kPerVertex);
  }
  P segments;
  *segments.mutable_segments()->mutable_vertices() = Line(4);
  *segments.mutable_color_scale() = Scaled().color_scale();
  EXPECT_EQ(Geometry(segments).record.color_mode, gpu::ColorMode::kPerVertex);
}

TEST(PayloadTable, TokensThatAreNoneFindNothing) {
  PayloadTable table;
  table.Begin();
  table.Add("abc");
  table.Add("");
  table.Add("de");
  const std::string token = table.Token();
  const Payload found = table.Find(token);
  EXPECT_EQ(found.size(), 5u);
  std::string later(4, '\0');
  later[0] = 1;
  EXPECT_EQ(table.Find(later).size(), 0u);
  EXPECT_EQ(table.Find("").size(), 0u);
  EXPECT_EQ(table.Find("12345").size(), 0u);
}

TEST(ElementCount, BreaksOffWhereAMessageIsBroken) {
  // Field 1 with two bytes, and a valid element of field 2 in it.
  const int path[] = {1, 2};
  const std::string good = {0x0A, 0x02, 0x12, 0x00};
  // The inner message ends a group that was not begun, so what follows it does not count.
  const std::string broken = {0x0A, 0x03, 0x12, 0x00, 0x14, 0x0A, 0x02, 0x12, 0x00};
  const auto count = [&](std::string_view bytes) {
    return CountElements(std::span(&bytes, 1), path);
  };
  EXPECT_EQ(count(good), 1u);
  EXPECT_EQ(count(good + good), 2u);
  EXPECT_EQ(count(good + broken), 2u);
  EXPECT_EQ(count(broken + good), 1u);
  // With another wire type it is not a message.
  EXPECT_EQ(count(std::string{0x08, 0x02, 0x12, 0x00}), 0u);
}

}  // namespace far_corners_test
}  // namespace voxeld::daemon::wire
