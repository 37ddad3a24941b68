// Valid primitives of the kinds that become curves, letters and frames, and the results of decoding
// them.
#pragma once

#include <gtest/gtest.h>

#include <variant>
#include <vector>

#include "daemon/text/fonts.h"
#include "daemon/wire/primitive.h"
#include "tests/daemon/wire/faults.h"
#include "tests/daemon/wire/requests.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {

using P = v1::Primitive;

class CurvesTest : public ::testing::Test {
 protected:
  MaybeFault FaultOf(const P& primitive, Content* content) {
    return ToContent(FieldPath("primitive"), primitive, {.limits = limits_, .fonts = &fonts_},
                     content);
  }
  const GeometryData& Geometry(const P& primitive) {
    const MaybeFault fault = FaultOf(primitive, &content_);
    EXPECT_FALSE(fault.has_value()) << fault->field << " " << fault->message;
    return *std::get<GeometryPtr>(content_);
  }
  const GroupData& Group(const P& primitive) {
    const MaybeFault fault = FaultOf(primitive, &content_);
    EXPECT_FALSE(fault.has_value()) << fault->field << " " << fault->message;
    return *std::get<GroupPtr>(content_);
  }

  Limits limits_;
  text::Fonts fonts_;
  Content content_;
};

inline v1::Vertices Line(int count) {
  v1::Vertices vertices;
  std::vector<float> positions;
  for (int i = 0; i < count; ++i) {
    for (const float c : {static_cast<float>(i), static_cast<float>(i % 2), 0.0f})
      positions.push_back(c);
  }
  vertices.set_count(static_cast<uint32_t>(count));
  vertices.set_positions(Packed(positions));
  return vertices;
}

inline P Curve() {
  P p;
  *p.mutable_curve()->mutable_vertices() = Line(4);
  return p;
}
inline P Arc() {
  P p;
  p.mutable_arc()->set_radius(2);
  return p;
}
inline P Ellipse() {
  P p;
  Set(p.mutable_ellipse()->mutable_axis_a(), 2, 0, 0);
  Set(p.mutable_ellipse()->mutable_axis_b(), 0, 1, 0);
  return p;
}
inline P Helix() {
  P p;
  Set(p.mutable_helix()->mutable_end(), 0, 0, 3);
  p.mutable_helix()->set_radius(1);
  p.mutable_helix()->set_turns(2);
  return p;
}
inline P BezierSurface() {
  P p;
  *p.mutable_bezier_surface()->mutable_vertices() = Line(16);
  return p;
}
inline P Arrow() {
  P p;
  Set(p.mutable_arrow()->mutable_end(), 0, 0, 4);
  return p;
}
inline P Text() {
  P p;
  p.mutable_text()->set_text("AbA");
  p.mutable_text()->set_height(2);
  return p;
}
inline P Torus() {
  P p;
  p.mutable_torus()->set_radius(2);
  p.mutable_torus()->set_tube_radius(0.5);
  return p;
}
inline P Points() {
  P p;
  *p.mutable_points()->mutable_vertices() = Line(3);
  return p;
}
inline P Scaled() {
  P p = Points();
  p.mutable_color_scale()->set_colormap("viridis");
  Set(p.mutable_color_scale()->mutable_along(), 1, 0, 0);
  return p;
}
inline P Mesh() {
  P p;
  *p.mutable_mesh()->mutable_vertices() = Line(6);
  return p;
}

}  // namespace voxeld::daemon::wire
