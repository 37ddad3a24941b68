// Tests shells of surfaces made of triangles: meshes, height maps, Bézier patches.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <variant>
#include <vector>

#include "daemon/wire/encode_primitive.h"
#include "daemon/wire/primitive.h"
#include "tests/daemon/wire/faults.h"
#include "tests/daemon/wire/requests.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {
namespace {

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

void SetCorners(uint32_t count, v1::Vertices* out) {
  std::vector<float> positions(size_t{3} * count);
  for (size_t i = 0; i < positions.size(); ++i) positions[i] = static_cast<float>(i * i % 17);
  out->set_count(count);
  out->set_positions(Packed(positions));
}
P Mesh() {
  P p;
  SetCorners(6, p.mutable_mesh()->mutable_vertices());
  p.mutable_mesh()->mutable_shell()->set_value(2.5f);
  p.mutable_mesh()->mutable_shell()->set_unit(v1::Thickness::UNITS);
  return p;
}
P Patches() {
  P p;
  SetCorners(16, p.mutable_bezier_surface()->mutable_vertices());
  p.mutable_bezier_surface()->mutable_shell()->set_value(2.5f);
  p.mutable_bezier_surface()->mutable_shell()->set_unit(v1::Thickness::UNITS);
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
  map->mutable_shell()->set_value(2.5f);
  map->mutable_shell()->set_unit(v1::Thickness::UNITS);
  return p;
}

TEST(ShellsOfTriangles, AreTheirThickness) {
  for (const auto& [good, kind] : {std::pair{&Mesh, gpu::PrimitiveKind::kTriangles},
                                   std::pair{&HeightMap, gpu::PrimitiveKind::kTriangles},
                                   std::pair{&Patches, gpu::PrimitiveKind::kPatches}}) {
    const GeometryPtr data = Geometry(good());
    EXPECT_EQ(data->record.kind, kind);
    EXPECT_EQ(data->record.thickness, 2.5f);
    EXPECT_EQ(data->record.thickness_unit, gpu::ThicknessUnit::kUnits);
    P encoded;
    Encode(Content(data), &encoded);
    const GeometryPtr again = Geometry(encoded);
    EXPECT_EQ(again->record.thickness, 2.5f);
    EXPECT_EQ(again->record.thickness_unit, gpu::ThicknessUnit::kUnits);
  }
}

TEST(ShellsOfTriangles, OfNothingAreAsIfTheyWereNotThere) {
  P mesh = Mesh(), map = HeightMap(), patches = Patches();
  mesh.mutable_mesh()->mutable_shell()->set_value(0);
  map.mutable_height_map()->mutable_shell()->set_value(0);
  patches.mutable_bezier_surface()->mutable_shell()->set_value(0);
  for (const v1::Fill fill : {v1::FILL_SURFACE, v1::FILL_LINES, v1::FILL_DOTS}) {
    mesh.mutable_mesh()->set_fill(fill);
    map.mutable_height_map()->set_fill(fill);
    patches.mutable_bezier_surface()->set_fill(fill);
    for (const P& p : {mesh, map, patches}) EXPECT_EQ(Geometry(p)->record.thickness, 0);
  }
  P encoded;
  mesh.mutable_mesh()->set_fill(v1::FILL_SURFACE);
  Encode(Content(Geometry(mesh)), &encoded);
  EXPECT_FALSE(encoded.mesh().has_shell());
}

const char* const kNoSurface = "is 2.5, but only what is drawn as FILL_SURFACE has a shell";

const FaultCase kCases[] = {
    {"mesh_negative", Mesh, [](P& p) { p.mutable_mesh()->mutable_shell()->set_value(-1); },
     "primitive.mesh.shell.value", Reason::kInvalidValue,
     "is -1; give 0 (one voxel) to max_thickness, 4096"},
    {"mesh_no_number", Mesh,
     [](P& p) { p.mutable_mesh()->mutable_shell()->set_value(std::nanf("")); },
     "primitive.mesh.shell.value", Reason::kInvalidValue, "NaN"},
    {"mesh_infinite", Mesh,
     [](P& p) {
       p.mutable_mesh()->mutable_shell()->set_value(std::numeric_limits<float>::infinity());
     },
     "primitive.mesh.shell.value", Reason::kInvalidValue, "inf"},
    {"mesh_unit", Mesh,
     [](P& p) { p.mutable_mesh()->mutable_shell()->set_unit(static_cast<v1::Thickness::Unit>(9)); },
     "primitive.mesh.shell.unit", Reason::kInvalidValue, "value 9"},
    {"mesh_solid", Mesh, [](P& p) { p.mutable_mesh()->set_fill(v1::FILL_SOLID); },
     "primitive.mesh.shell.value", Reason::kInvalidValue, kNoSurface},
    {"mesh_lines", Mesh, [](P& p) { p.mutable_mesh()->set_fill(v1::FILL_LINES); },
     "primitive.mesh.shell.value", Reason::kInvalidValue, kNoSurface},
    {"map_thick", HeightMap, [](P& p) { p.mutable_height_map()->mutable_shell()->set_value(4097); },
     "primitive.height_map.shell.value", Reason::kInvalidValue, "is 4097; give 0"},
    {"map_lines", HeightMap, [](P& p) { p.mutable_height_map()->set_fill(v1::FILL_LINES); },
     "primitive.height_map.shell.value", Reason::kInvalidValue, kNoSurface},
    {"map_dots", HeightMap, [](P& p) { p.mutable_height_map()->set_fill(v1::FILL_DOTS); },
     "primitive.height_map.shell.value", Reason::kInvalidValue, kNoSurface},
    {"patches_negative", Patches,
     [](P& p) { p.mutable_bezier_surface()->mutable_shell()->set_value(-0.5f); },
     "primitive.bezier_surface.shell.value", Reason::kInvalidValue, "is -0.5; give 0"},
    {"patches_lines", Patches, [](P& p) { p.mutable_bezier_surface()->set_fill(v1::FILL_LINES); },
     "primitive.bezier_surface.shell.value", Reason::kInvalidValue, kNoSurface},
    {"patches_dots", Patches, [](P& p) { p.mutable_bezier_surface()->set_fill(v1::FILL_DOTS); },
     "primitive.bezier_surface.shell.value", Reason::kInvalidValue, kNoSurface},
};

TEST(ShellsOfTriangles, WhatIsWrongIsSaid) {
  ExpectFaults(kCases, [](const P& p, Content* content) { return FaultOf(p, content); });
}

TEST(ShellsOfTriangles, TheLimitIsTheServers) {
  Limits limits;
  limits.max_thickness = 2;
  Content content;
  const MaybeFault fault = FaultOf(Mesh(), &content, limits);
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->message, "is 2.5; give 0 (one voxel) to max_thickness, 2");
}

}  // namespace
}  // namespace voxeld::daemon::wire
