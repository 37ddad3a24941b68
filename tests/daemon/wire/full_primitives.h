// A valid primitive of each kind with every number that it can have, for tests of all fields of a
// message by reflection.
#pragma once

#include <google/protobuf/text_format.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/daemon/wire/requests.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {

inline v1::Primitive FromText(const std::string& text) {
  v1::Primitive primitive;
  EXPECT_TRUE(google::protobuf::TextFormat::ParseFromString(text, &primitive)) << text;
  return primitive;
}

inline v1::Vertices Corners(uint32_t count) {
  v1::Vertices vertices;
  std::vector<float> positions;
  for (uint32_t i = 0; i < count; ++i) {
    for (const uint32_t number : {i, i * i % 7, i % 3})
      positions.push_back(static_cast<float>(number));
  }
  vertices.set_count(count);
  vertices.set_positions(Packed(positions));
  return vertices;
}

inline std::vector<v1::Primitive> FullPrimitives() {
  std::vector<v1::Primitive> all;
  for (const char* text : {
           "points { thickness { value: 2 unit: UNITS } splat: SOFT } color { rgb: 1 }",
           "points {} color_scale { colormap: 'viridis' low: 1 high: 2 along { x: 1 y: 2 z: 3 } }",
           "segments { topology: STRIP sampling: LINE_SAMPLING_COVER thickness { value: 2 unit: "
           "VOXELS } }",
           "mesh { rule: SURFACE_RULE_COVER fill: FILL_SURFACE shell { value: 3 unit: UNITS } }",
           "curve { form: CATMULL_ROM sampling: LINE_SAMPLING_THIN thickness { value: 1 unit: "
           "UNITS } }",
           "bezier_surface { rule: SURFACE_RULE_THIN fill: FILL_SURFACE shell { value: 1 unit: "
           "UNITS } }",
       }) {
    v1::Primitive primitive = FromText(text);
    if (primitive.has_points()) *primitive.mutable_points()->mutable_vertices() = Corners(6);
    if (primitive.has_segments()) *primitive.mutable_segments()->mutable_vertices() = Corners(6);
    if (primitive.has_mesh()) *primitive.mutable_mesh()->mutable_vertices() = Corners(6);
    if (primitive.has_curve()) *primitive.mutable_curve()->mutable_vertices() = Corners(6);
    if (primitive.has_bezier_surface())
      *primitive.mutable_bezier_surface()->mutable_vertices() = Corners(16);
    all.push_back(primitive);
  }
  const std::string look =
      "rule: SURFACE_RULE_COVER fill: FILL_SURFACE shell { value: 1 unit: UNITS }";
  const std::string line = "sampling: LINE_SAMPLING_COVER thickness { value: 2 unit: UNITS }";
  const std::string scale =
      "color_scale { colors: [1, 2] low: 1 high: 2 along { x: 1 y: 2 z: 3 } }";
  const std::string at = "{ x: 1 y: 2 z: 3 }";
  const std::string grid =
      "grid { corner { x: 1 y: 2 z: 3 } edge_a { x: 1 y: 0 z: 0 } edge_b { x: 0 y: 1 z: 0 } "
      "edge_c { x: 0 y: 0 z: 1 } size_a: 2 size_b: 1 size_c: 1 type: ELEMENT_TYPE_U8 filter: "
      "LINEAR samples: 'ab' }";
  const std::vector<std::string> texts = {
      "box { center " + at + " size " + at + look + " }" + scale,
      "box { center " + at + " size " + at + " rule: SURFACE_RULE_COVER fill: FILL_SOLID }",
      "sphere { center " + at + " radius: 2 " + look + " }" + scale,
      "sphere { center " + at + " radius: 2 rule: SURFACE_RULE_COVER fill: FILL_SOLID }",
      "cylinder { center " + at + " radius: 2 height: 3 " + look + " }" + scale,
      "cylinder { center " + at +
          " radius: 2 height: 3 rule: SURFACE_RULE_COVER fill: FILL_SOLID }",
      "ellipsoid { center " + at + " radii " + at + look + " }" + scale,
      "ellipsoid { center " + at + " radii " + at +
          " fill: FILL_LINES rule: SURFACE_RULE_THIN shell { value: 0 unit: VOXELS } }",
      "torus { center " + at + " radius: 2 tube_radius: 1 " + look + " }" + scale,
      "cone { start " + at + " end { x: 3 y: 2 z: 1 } start_radius: 1 end_radius: 2 " + look +
          " }" + scale,
      "parallelepiped { center " + at +
          " edge_a { x: 1 y: 0 z: 0 } edge_b { x: 0 y: 1 z: 0 } edge_c { x: 0 y: 0 z: 1 } " + look +
          " }",
      "disc { center " + at + " normal " + at + " radius: 2 inner_radius: 1 " + look + " }" + scale,
      "patch { corner " + at + " edge_a { x: 1 y: 0 z: 0 } edge_b { x: 0 y: 1 z: 0 } " + look +
          " }",
      "polygon { points: [0, 0, 0, 1, 0, 0, 0, 1, 0] " + look + " }" + scale,
      "arrow { start " + at +
          " end { x: 3 y: 2 z: 9 } shaft_radius: 1 head_length: 2 head_radius: 3 " + look + " }",
      "arc { center " + at + " normal " + at +
          " radius: 2 toward { x: 3 y: -1 z: 0 } start: 1 sweep: 2 " + line + " }" + scale,
      "ellipse { center " + at +
          " axis_a { x: 2 y: 0 z: 0 } axis_b { x: 0 y: 1 z: 0 } start: 1 sweep: 2 " + line + " }",
      "helix { start " + at +
          " end { x: 3 y: 2 z: 9 } radius: 1 end_radius: 2 turns: 3 toward { x: 1 y: 0 z: 0 "
          "} " +
          line + " }",
      "text { text: 'ab' height: 2 position " + at + " facing " + at +
          " up { x: 0 y: 1 z: 0 } style: FILLED alignment: CENTER line_spacing: 1 width: 9 "
          "depth: 1 "
          "rule: SURFACE_RULE_THIN thickness { value: 1 unit: UNITS } }" +
          scale,
      "text { text: 'ab' height: 2 style: STROKES alignment: LEFT thickness { value: 1 unit: "
      "VOXELS } }" +
          scale,
      "volume { " + grid + " transfer { values: [0, 1] colors: [1, 2] opacities: [0, 1] } }",
      "isosurface { " + grid + " level: 1 " + look + " }" + scale,
      "implicit { surface { text: 'x - r' } parameter_names: 'r' parameter_values: 2 boundary "
      "{ axis: X form: POLYLINE points: "
      "[0, 0, 0, 0, 1, 0, 0, 0, 1] } domain { min { x: -1 y: -2 z: -3 } max " +
          at + " } " + look + " }",
      "implicit { surface { tree { ops: [X, CONSTANT, SUBTRACT] values: 2 } } fill: "
      "FILL_SOLID rule: SURFACE_RULE_THIN }",
      "instance { object: 'o' tint { rgb: 5 } }",
  };
  for (const std::string& text : texts) {
    all.push_back(FromText(text));
  }
  v1::Primitive map = FromText(
      "height_map { corner " + at + " edge_a { x: 1 y: 0 z: 0 } edge_b { x: 0 y: 1 z: 0 } up " +
      at + " columns: 2 rows: 2 height_type: ELEMENT_TYPE_F32 " + look + " }" +
      "color_scale { colors: [1, 2] low: 1 high: 2 along { x: 1 y: 2 z: 3 } }");
  map.mutable_height_map()->set_heights(Packed<float>({0, 1, 2, 3}));
  all.push_back(map);
  return all;
}

}  // namespace voxeld::daemon::wire
