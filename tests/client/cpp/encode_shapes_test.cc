// Tests the wire encoding of shapes, curves, text and colour scales, as protobuf reads it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "client/cpp/src/encode.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::client {
namespace {

using ::testing::ElementsAre;

v1::Primitive Parse(const Shape& shape, const std::optional<ColorScale>& scale = std::nullopt) {
  const absl::StatusOr<Rope> rope = EncodePrimitive(shape, {255, 0, 0}, scale);
  EXPECT_TRUE(rope.ok()) << rope.status();
  v1::Primitive primitive;
  EXPECT_TRUE(primitive.ParseFromString(rope->Flat()));
  EXPECT_TRUE(primitive.GetReflection()->GetUnknownFields(primitive).empty());
  return primitive;
}

TEST(EncodeShapes, Curves) {
  const v1::Primitive p = Parse(Curve{.vertices = {.positions = {0, 0, 0, 1, 1, 1, 2, 0, 0}},
                                      .form = Curve::Form::kBSpline,
                                      .closed = true,
                                      .sampling = LineSampling::kCover,
                                      .thickness = {2}});
  EXPECT_EQ(p.curve().form(), v1::Curve::B_SPLINE);
  EXPECT_TRUE(p.curve().closed());
  EXPECT_EQ(p.curve().vertices().count(), 3u);
  EXPECT_EQ(p.curve().sampling(), v1::LINE_SAMPLING_COVER);
  EXPECT_EQ(p.curve().thickness().value(), 2);
  EXPECT_EQ(p.color().rgb(), 0xFF0000u);
  const v1::Primitive patches = Parse(BezierSurface{
      .vertices = {.positions = std::vector<float>(48)}, .rule = SurfaceRule::kCover});
  EXPECT_EQ(patches.bezier_surface().vertices().count(), 16u);
  EXPECT_EQ(patches.bezier_surface().rule(), v1::SURFACE_RULE_COVER);
  EXPECT_EQ(patches.bezier_surface().fill(), v1::FILL_SURFACE);
  EXPECT_EQ(
      Parse(BezierSurface{.vertices = {.positions = std::vector<float>(48)}, .fill = Fill::kLines})
          .bezier_surface()
          .fill(),
      v1::FILL_LINES);
}

TEST(EncodeShapes, ColorsOfElements) {
  const v1::Vertices vertices =
      Parse(Mesh{.vertices = {.positions = std::vector<float>(12),
                              .colors = {1, 2, 3, 4, 5, 6},
                              .indices = {0, 1, 2, 2, 1, 3},
                              .colors_of = Vertices::ColorsOf::kElements}})
          .mesh()
          .vertices();
  EXPECT_EQ(vertices.colors_of(), v1::Vertices::ELEMENTS);
  EXPECT_EQ(vertices.colors().size(), 6u);
  EXPECT_EQ(
      Parse(Mesh{.vertices = {.positions = std::vector<float>(9)}}).mesh().vertices().colors_of(),
      v1::Vertices::COLORS_OF_UNSPECIFIED);
}

TEST(EncodeShapes, ShellsOfBoxesSpheresAndCylinders) {
  EXPECT_EQ(Parse(Box{.shell = {3}}).box().shell().value(), 3);
  EXPECT_EQ(Parse(Sphere{.shell = {2, Thickness::Unit::kUnits}}).sphere().shell().unit(),
            v1::Thickness::UNITS);
  EXPECT_EQ(Parse(Cylinder{.shell = {4}}).cylinder().shell().value(), 4);
  EXPECT_FALSE(Parse(Box{}).box().has_shell());
}

TEST(EncodeShapes, ShellsOfMeshesHeightMapsAndPatches) {
  const Vertices corners{.positions = std::vector<float>(48)};
  EXPECT_EQ(Parse(Mesh{.vertices = corners, .shell = {3}}).mesh().shell().value(), 3);
  EXPECT_FALSE(Parse(Mesh{.vertices = corners}).mesh().has_shell());
  EXPECT_EQ(Parse(BezierSurface{.vertices = corners, .shell = {2, Thickness::Unit::kUnits}})
                .bezier_surface()
                .shell()
                .unit(),
            v1::Thickness::UNITS);
  EXPECT_FALSE(Parse(BezierSurface{.vertices = corners}).bezier_surface().has_shell());
  HeightMap map{.columns = 2, .rows = 2, .heights = {0, 1, 2, 3}};
  EXPECT_FALSE(Parse(map).height_map().has_shell());
  map.shell = {4.5f};
  EXPECT_EQ(Parse(map).height_map().shell().value(), 4.5f);
  EXPECT_EQ(Parse(map).height_map().shell().unit(), v1::Thickness::VOXELS);
}

TEST(EncodeShapes, BoundariesAreLinesOrSmooth) {
  Implicit shape{.surface = "z = 0", .boundary = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}};
  EXPECT_EQ(Parse(shape).implicit().boundary().form(), v1::Boundary::POLYLINE);
  shape.boundary_form = Implicit::BoundaryForm::kCatmullRom;
  EXPECT_EQ(Parse(shape).implicit().boundary().form(), v1::Boundary::CATMULL_ROM);
  shape.boundary_form = Implicit::BoundaryForm::kBSpline;
  EXPECT_EQ(Parse(shape).implicit().boundary().form(), v1::Boundary::B_SPLINE);
}

TEST(EncodeShapes, LinesByTheirMeasures) {
  const v1::Arc arc = Parse(Arc{.normal = {1, 0, 0},
                                .radius = 2,
                                .toward = Vec3{0, 1, 0},
                                .start = 1,
                                .sweep = -2,
                                .thickness = {3, Thickness::Unit::kUnits}})
                          .arc();
  EXPECT_EQ(arc.radius(), 2);
  EXPECT_EQ(arc.normal().x(), 1);
  EXPECT_EQ(arc.toward().y(), 1);
  EXPECT_EQ(arc.sweep(), -2);
  EXPECT_EQ(arc.thickness().unit(), v1::Thickness::UNITS);
  EXPECT_FALSE(Parse(Arc{}).arc().has_toward());
  const v1::Ellipse ellipse = Parse(Ellipse{.axis_b = {0, 3, 0}, .start = 0.5}).ellipse();
  EXPECT_EQ(ellipse.axis_b().y(), 3);
  EXPECT_EQ(ellipse.start(), 0.5);
  const v1::Helix helix = Parse(Helix{.end = {0, 0, 4}, .end_radius = 0.0, .turns = -3}).helix();
  EXPECT_EQ(helix.turns(), -3);
  EXPECT_TRUE(helix.has_end_radius());
  EXPECT_FALSE(Parse(Helix{}).helix().has_end_radius());
}

TEST(EncodeShapes, ArrowsAndText) {
  const v1::Arrow arrow =
      Parse(Arrow{.end = {1, 0, 0}, .head_length = 0.5, .fill = Fill::kSolid}).arrow();
  EXPECT_EQ(arrow.head_length(), 0.5);
  EXPECT_EQ(arrow.fill(), v1::FILL_SOLID);
  const v1::Text text = Parse(Text{.text = "Größe",
                                   .height = 2,
                                   .up = Vec3{0, 0, 1},
                                   .style = Text::Style::kOutline,
                                   .alignment = Text::Alignment::kRight,
                                   .font = "serif"})
                            .text();
  EXPECT_EQ(text.text(), "Größe");
  EXPECT_EQ(text.style(), v1::Text::OUTLINE);
  EXPECT_EQ(text.alignment(), v1::Text::RIGHT);
  EXPECT_EQ(text.up().z(), 1);
  EXPECT_EQ(text.facing().z(), 1);
  EXPECT_EQ(text.font(), "serif");
}

TEST(EncodeShapes, FillsSplatsAndTints) {
  EXPECT_EQ(Parse(Box{.fill = Fill::kLines}).box().fill(), v1::FILL_LINES);
  EXPECT_EQ(Parse(Torus{.fill = Fill::kDots}).torus().fill(), v1::FILL_DOTS);
  EXPECT_EQ(Parse(Mesh{.vertices = {.positions = std::vector<float>(9)}, .fill = Fill::kLines})
                .mesh()
                .fill(),
            v1::FILL_LINES);
  EXPECT_EQ(Parse(Disc{.fill = Fill::kLines}).disc().fill(), v1::FILL_LINES);
  EXPECT_EQ(Parse(Patch{.fill = Fill::kDots}).patch().fill(), v1::FILL_DOTS);
  EXPECT_EQ(Parse(Polygon{.fill = Fill::kLines}).polygon().fill(), v1::FILL_LINES);
  EXPECT_EQ(Parse(HeightMap{.columns = 1, .rows = 1, .heights = {0.f}, .fill = Fill::kDots})
                .height_map()
                .fill(),
            v1::FILL_DOTS);
  EXPECT_EQ(Parse(Points{.vertices = {.positions = {0, 0, 0}}, .splat = Points::Splat::kSoft})
                .points()
                .splat(),
            v1::Points::SOFT);
  EXPECT_EQ(Parse(Points{.vertices = {.positions = {0, 0, 0}}, .splat = Points::Splat::kCell})
                .points()
                .splat(),
            v1::Points::CELL);
  EXPECT_EQ(Parse(Instance{.object = "o", .tint = {1, 2, 3}}).instance().tint().rgb(), 0x010203u);
  EXPECT_FALSE(Parse(Instance{.object = "o"}).instance().has_tint());
}

TEST(EncodeShapes, PicturesOnMeshesAndHeightMaps) {
  const Array<uint8_t> picture = {1, 2, 3, 0, 255};
  const std::string bytes("\x01\x02\x03\0\xFF", 5);
  Mesh mesh{.vertices = {.positions = std::vector<float>(9)}};
  mesh.texture = Texture{.picture = picture, .coordinates = {0, 0, 0.5f, 1, -2, 3}};
  const v1::Mesh encoded = Parse(mesh).mesh();
  EXPECT_EQ(encoded.texture().picture(), bytes);
  EXPECT_EQ(encoded.vertices().count(), 3u);
  float coordinates[6];
  ASSERT_EQ(encoded.texture().coordinates().size(), sizeof(coordinates));
  std::memcpy(coordinates, encoded.texture().coordinates().data(), sizeof(coordinates));
  EXPECT_THAT(coordinates, ElementsAre(0, 0, 0.5f, 1, -2, 3));
  EXPECT_FALSE(Parse(Mesh{.vertices = {.positions = std::vector<float>(9)}}).mesh().has_texture());
  mesh.texture->coordinates = {0, 0};
  EXPECT_EQ(std::string(EncodePrimitive(mesh, {}).status().message()),
            "texture.coordinates has 2 numbers for 3 vertices; 6 are right");
  EXPECT_EQ(Parse(HeightMap{.columns = 1, .rows = 1, .heights = {0.f}, .picture = picture})
                .height_map()
                .picture(),
            bytes);
}

TEST(EncodeShapes, VolumesAndIsosurfaces) {
  const v1::Volume volume =
      Parse(
          Volume{
              .grid = {.size_a = 2, .size_b = 1, .size_c = 1, .samples = Array<uint16_t>({1, 300})},
              .transfer =
                  Transfer{
                      .values = {0, 300}, .colors = {{0, 0, 0}, {1, 2, 3}}, .opacities = {0, 1}}})
          .volume();
  EXPECT_EQ(volume.grid().type(), v1::ELEMENT_TYPE_U16);
  EXPECT_EQ(volume.grid().samples(), std::string("\x01\0\x2C\x01", 4));
  EXPECT_EQ(volume.grid().edge_b().y(), 2);
  EXPECT_THAT(volume.transfer().colors(), ElementsAre(0, 0x010203));
  EXPECT_THAT(volume.transfer().opacities(), ElementsAre(0, 1));
  const v1::Volume colors = Parse(Volume{.grid = {.size_a = 1,
                                                  .size_b = 1,
                                                  .size_c = 1,
                                                  .samples = Array<uint8_t>({1, 2, 3, 4})},
                                         .colors = true})
                                .volume();
  EXPECT_EQ(colors.grid().type(), v1::ELEMENT_TYPE_RGBA8);
  const v1::Isosurface surface = Parse(Isosurface{.grid = {.size_a = 1,
                                                           .size_b = 1,
                                                           .size_c = 2,
                                                           .samples = Array<float>({1, 2}),
                                                           .filter = Grid::Filter::kNearest},
                                                  .level = 1.5,
                                                  .fill = Fill::kSolid})
                                     .isosurface();
  EXPECT_EQ(surface.level(), 1.5);
  EXPECT_EQ(surface.fill(), v1::FILL_SOLID);
  EXPECT_EQ(surface.grid().filter(), v1::Grid::NEAREST);
  const absl::Status wrong =
      EncodePrimitive(
          Volume{.grid = {.size_a = 2, .size_b = 2, .size_c = 1, .samples = Array<float>({1})}}, {})
          .status();
  EXPECT_EQ(wrong.message(), "samples has 1 numbers for a grid of 2 by 2 by 1; 4 are right");
}

TEST(EncodeShapes, ColorScales) {
  const v1::ColorScale scale =
      Parse(Sphere{},
            ColorScale{
                .colors = {{0, 0, 0}, {255, 128, 0}}, .low = 1, .high = 2, .along = Vec3{0, 0, 1}})
          .color_scale();
  EXPECT_THAT(scale.colors(), ElementsAre(0x000000, 0xFF8000));
  EXPECT_EQ(scale.low(), 1);
  EXPECT_EQ(scale.along().z(), 1);
  const v1::ColorScale numbers = Parse(Points{.vertices = {.positions = {0, 0, 0, 1, 1, 1}}},
                                       ColorScale{.colormap = "viridis", .scalars = {1.5f, 2.5f}})
                                     .color_scale();
  EXPECT_EQ(numbers.colormap(), "viridis");
  float values[2];
  ASSERT_EQ(numbers.scalars().size(), sizeof(values));
  std::memcpy(values, numbers.scalars().data(), sizeof(values));
  EXPECT_THAT(values, ElementsAre(1.5f, 2.5f));
}

}  // namespace
}  // namespace voxeld::client
