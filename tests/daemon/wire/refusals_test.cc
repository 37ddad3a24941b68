// Tests every field that can be wrong, one by one: the path, the reason, and the value in the
// message.
#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <limits>

#include "tests/daemon/wire/refusal_requests.h"
#include "tests/daemon/wire/requests.h"

namespace voxeld::daemon::wire {
namespace refusals_test {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Case {
  const char* name;
  std::function<v1::StreamRequest()> make;
  const char* field;
  Reason reason;
  const char* value;  // occurs in the message
};

// A valid request, made wrong by `spoil`.
template <typename Spoil>
std::function<v1::StreamRequest()> With(v1::StreamRequest (*good)(), Spoil spoil) {
  return [good, spoil] {
    v1::StreamRequest request = good();
    spoil(request);
    return request;
  };
}

using R = v1::StreamRequest;

const Case kCases[] = {
    // names
    {"empty_layer", With(MeshRequest, [](R& r) { r.mutable_upsert()->set_layer(""); }),
     "upsert.layer", Reason::kInvalidValue, "is empty"},
    {"empty_id", With(MeshRequest, [](R& r) { r.mutable_upsert()->set_id(""); }), "upsert.id",
     Reason::kInvalidValue, "is empty"},
    {"long_id", With(MeshRequest, [](R& r) { r.mutable_upsert()->set_id(std::string(257, 'x')); }),
     "upsert.id", Reason::kInvalidValue, "257 bytes"},
    {"long_label",
     With(MeshRequest,
          [](R& r) { r.mutable_upsert()->mutable_entity()->set_label(std::string(300, 'x')); }),
     "upsert.entity.label", Reason::kInvalidValue, "300 bytes"},
    {"delete_empty_id", With(DeleteRequest, [](R& r) { r.mutable_delete_()->set_id(""); }),
     "delete.id", Reason::kInvalidValue, "is empty"},
    {"delete_empty_prefix", With(DeleteRequest, [](R& r) { r.mutable_delete_()->set_prefix(""); }),
     "delete.prefix", Reason::kInvalidValue, "is empty"},
    {"delete_empty_layer", With(DeleteRequest, [](R& r) { r.mutable_delete_()->set_layer(""); }),
     "delete.layer", Reason::kInvalidValue, "is empty"},
    {"delete_all_false",
     With(DeleteRequest, [](R& r) { r.mutable_delete_()->set_all_of_layer(false); }),
     "delete.all_of_layer", Reason::kInvalidValue, "is false"},
    {"delete_mine_false",
     With(DeleteRequest, [](R& r) { r.mutable_delete_()->set_all_mine(false); }), "delete.all_mine",
     Reason::kInvalidValue, "is false"},
    {"delete_mine_of_layer",
     With(DeleteRequest, [](R& r) { r.mutable_delete_()->set_all_mine(true); }), "delete.layer",
     Reason::kInvalidValue, "\"layer\""},
    {"delete_nothing", With(DeleteRequest, [](R& r) { r.mutable_delete_()->clear_what(); }),
     "delete.what", Reason::kInvalidValue, "is not set"},
    {"move_empty_layer", With(MoveRequest, [](R& r) { r.mutable_set_transform()->set_layer(""); }),
     "set_transform.layer", Reason::kInvalidValue, "is empty"},
    {"move_empty_id", With(MoveRequest, [](R& r) { r.mutable_set_transform()->set_id(""); }),
     "set_transform.id", Reason::kInvalidValue, "is empty"},
    {"frame_begin_empty",
     With(
         +[] { return R(); }, [](R& r) { r.mutable_frame_begin(); }),
     "frame_begin.layer", Reason::kInvalidValue, "is empty"},
    {"frame_end_empty",
     With(
         +[] { return R(); }, [](R& r) { r.mutable_frame_end(); }),
     "frame_end.layer", Reason::kInvalidValue, "is empty"},
    {"no_operation",
     With(
         +[] { return R(); }, [](R&) {}),
     "op", Reason::kInvalidValue, "is not set"},

    // entity
    {"priority",
     With(MeshRequest, [](R& r) { r.mutable_upsert()->mutable_entity()->set_priority(127); }),
     "upsert.entity.priority", Reason::kInvalidValue, "is 127; give 0 to 126"},
    {"lifetime",
     With(MeshRequest, [](R& r) { r.mutable_upsert()->mutable_entity()->set_lifetime_ns(-5); }),
     "upsert.entity.lifetime_ns", Reason::kInvalidValue, "is -5"},
    {"no_primitive",
     With(
         +[] { return UpsertRequest(); }, [](R&) {}),
     "upsert.entity.primitive.kind", Reason::kInvalidValue, "is not set"},
    {"color", With(MeshRequest, [](R& r) { PrimitiveOf(r)->mutable_color()->set_rgb(0x1000000); }),
     "upsert.entity.primitive.color.rgb", Reason::kInvalidValue, "0x1000000"},

    // transforms
    {"matrix_size",
     With(MoveRequest,
          [](R& r) {
            SetMatrix(r.mutable_set_transform()->mutable_transform(), {1, 0, 0});
          }),
     "set_transform.transform.m", Reason::kSizeMismatch, "has 3 values; give 12"},
    {"matrix_nan",
     With(MoveRequest,
          [](R& r) {
            SetMatrix(r.mutable_set_transform()->mutable_transform(),
                      {1, 0, 0, 0, 0, 1, 0, kNaN, 0, 0, 1, 0});
          }),
     "set_transform.transform.m[7]", Reason::kInvalidValue, "NaN"},
    {"matrix_zero_row",
     With(MoveRequest,
          [](R& r) {
            SetMatrix(r.mutable_set_transform()->mutable_transform(),
                      {1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0});
          }),
     "set_transform.transform.m", Reason::kSingularTransform, "determinant 0"},
    {"matrix_dependent",
     With(MoveRequest,
          [](R& r) {
            SetMatrix(r.mutable_set_transform()->mutable_transform(),
                      {0.1, 0.2, 0.3, 0, 0.4, 0.5, 0.6, 0, 0.7, 0.8, 0.9, 0});
          }),
     "set_transform.transform.m", Reason::kSingularTransform, "singular"},
    {"matrix_vanishing",
     With(MoveRequest,
          [](R& r) {
            SetMatrix(r.mutable_set_transform()->mutable_transform(),
                      {1e-200, 0, 0, 0, 0, 1e-200, 0, 0, 0, 0, 1e-200, 0});
          }),
     "set_transform.transform.m", Reason::kSingularTransform, "determinant 0"},
    {"entity_matrix",
     With(MeshRequest,
          [](R& r) {
            SetMatrix(r.mutable_upsert()->mutable_entity()->mutable_transform(),
                      std::vector<double>(11, 1));
          }),
     "upsert.entity.transform.m", Reason::kSizeMismatch, "has 11 values"},
    {"layer_matrix",
     With(LayerRequest,
          [](R& r) {
            SetMatrix(r.mutable_layer_state()->mutable_transform(), std::vector<double>(12, 1));
          }),
     "layer_state.transform.m", Reason::kSingularTransform, "singular"},

    // vertices
    {"count_zero", With(MeshRequest, [](R& r) { MeshVertices(r)->set_count(0); }),
     "upsert.entity.primitive.mesh.vertices.count", Reason::kInvalidValue, "is 0"},
    {"positions_short",
     With(MeshRequest, [](R& r) { MeshVertices(r)->mutable_positions()->pop_back(); }),
     "upsert.entity.primitive.mesh.vertices.positions", Reason::kSizeMismatch,
     "has 35 bytes; 3 elements of 12 bytes need 36"},
    {"count_greater", With(MeshRequest, [](R& r) { MeshVertices(r)->set_count(4); }),
     "upsert.entity.primitive.mesh.vertices.positions", Reason::kSizeMismatch, "need 48"},
    {"count_absurd", With(MeshRequest, [](R& r) { MeshVertices(r)->set_count(0xFFFFFFFF); }),
     "upsert.entity.primitive.mesh.vertices.count", Reason::kQuotaExceeded, "4294967295"},
    {"count_wraps",  // 0x55555556 · 12 is 8 in 32 bits
     With(MeshRequest,
          [](R& r) {
            MeshVertices(r)->set_count(0x1000000);
            MeshVertices(r)->set_positions("12345678");
          }),
     "upsert.entity.primitive.mesh.vertices.positions", Reason::kSizeMismatch, "need 201326592"},
    {"index_count_absurd",
     With(MeshRequest, [](R& r) { MeshVertices(r)->set_index_count(0xFFFFFFFF); }),
     "upsert.entity.primitive.mesh.vertices.index_count", Reason::kQuotaExceeded, "4294967295"},
    {"position_nan",
     With(MeshRequest,
          [](R& r) {
            MeshVertices(r)->set_positions(Packed<float>({0, 0, 0, 0, NAN, 0, 0, 0, 0}));
          }),
     "upsert.entity.primitive.mesh.vertices.positions[1].y", Reason::kInvalidValue, "NaN"},
    {"position_infinite",
     With(MeshRequest,
          [](R& r) {
            MeshVertices(r)->set_positions(Packed<float>({0, 0, 0, 0, 0, 0, 0, 0, -INFINITY}));
          }),
     "upsert.entity.primitive.mesh.vertices.positions[2].z", Reason::kInvalidValue, "-infinity"},
    {"position_i32",
     With(MeshRequest,
          [](R& r) {
            MeshVertices(r)->set_position_type(v1::ELEMENT_TYPE_I32);
            MeshVertices(r)->set_positions(Packed<int32_t>({0, 0, 0, 16777217, 0, 0, 0, 0, 0}));
          }),
     "upsert.entity.primitive.mesh.vertices.positions[1].x", Reason::kInvalidValue, "16777217"},
    {"position_type",
     With(MeshRequest, [](R& r) { MeshVertices(r)->set_position_type(v1::ELEMENT_TYPE_RGB8); }),
     "upsert.entity.primitive.mesh.vertices.position_type", Reason::kInvalidValue, "value 6"},
    {"position_type_unknown",
     With(MeshRequest,
          [](R& r) { MeshVertices(r)->set_position_type(static_cast<v1::ElementType>(99)); }),
     "upsert.entity.primitive.mesh.vertices.position_type", Reason::kInvalidValue, "value 99"},
    {"color_type",
     With(MeshRequest, [](R& r) { MeshVertices(r)->set_color_type(v1::ELEMENT_TYPE_F32); }),
     "upsert.entity.primitive.mesh.vertices.color_type", Reason::kInvalidValue, "value 1"},
    {"colors_missing",
     With(MeshRequest, [](R& r) { MeshVertices(r)->set_color_type(v1::ELEMENT_TYPE_RGB8); }),
     "upsert.entity.primitive.mesh.vertices.colors", Reason::kSizeMismatch, "has 0 bytes"},
    {"colors_short", With(MeshRequest, [](R& r) { MeshVertices(r)->set_colors("12345678"); }),
     "upsert.entity.primitive.mesh.vertices.colors", Reason::kSizeMismatch, "need 9"},
    {"index_type",
     With(MeshRequest, [](R& r) { MeshVertices(r)->set_index_type(v1::ELEMENT_TYPE_I16); }),
     "upsert.entity.primitive.mesh.vertices.index_type", Reason::kInvalidValue, "value 2"},
    {"index_type_alone",
     With(MeshRequest, [](R& r) { MeshVertices(r)->set_index_type(v1::ELEMENT_TYPE_U16); }),
     "upsert.entity.primitive.mesh.vertices.index_type", Reason::kInvalidValue, "without indices"},
    {"indices_without_count", With(MeshRequest, [](R& r) { MeshVertices(r)->set_indices("1234"); }),
     "upsert.entity.primitive.mesh.vertices.indices", Reason::kSizeMismatch, "has 4 bytes"},
    {"index_out_of_range",
     With(MeshRequest,
          [](R& r) {
            MeshVertices(r)->set_index_count(3);
            MeshVertices(r)->set_indices(Packed<uint32_t>({0, 1, 3}));
          }),
     "upsert.entity.primitive.mesh.vertices.indices[2]", Reason::kIndexOutOfRange,
     "is 3; there are 3 vertices, so 0 to 2"},
    {"index_out_of_range_u16",
     With(MeshRequest,
          [](R& r) {
            MeshVertices(r)->set_index_type(v1::ELEMENT_TYPE_U16);
            MeshVertices(r)->set_index_count(3);
            MeshVertices(r)->set_indices(Packed<uint16_t>({0, 65535, 2}));
          }),
     "upsert.entity.primitive.mesh.vertices.indices[1]", Reason::kIndexOutOfRange, "65535"},
    {"mesh_not_three",
     With(MeshRequest,
          [](R& r) {
            MeshVertices(r)->set_index_count(4);
            MeshVertices(r)->set_indices(Packed<uint32_t>({0, 1, 2, 0}));
          }),
     "upsert.entity.primitive.mesh.vertices.index_count", Reason::kSizeMismatch,
     "is 4; triangles take three"},
    {"mesh_rule",
     With(MeshRequest,
          [](R& r) { PrimitiveOf(r)->mutable_mesh()->set_rule(static_cast<v1::SurfaceRule>(3)); }),
     "upsert.entity.primitive.mesh.rule", Reason::kInvalidValue, "value 3"},

    // points and segments
    {"points_index_count",
     With(PointsRequest,
          [](R& r) { PrimitiveOf(r)->mutable_points()->mutable_vertices()->set_index_count(1); }),
     "upsert.entity.primitive.points.vertices.index_count", Reason::kInvalidValue,
     "points take no indices"},
    {"points_indices",
     With(PointsRequest,
          [](R& r) { PrimitiveOf(r)->mutable_points()->mutable_vertices()->set_indices("1234"); }),
     "upsert.entity.primitive.points.vertices.indices", Reason::kInvalidValue, "4 bytes"},
    {"thickness_nan",
     With(PointsRequest,
          [](R& r) { PrimitiveOf(r)->mutable_points()->mutable_thickness()->set_value(NAN); }),
     "upsert.entity.primitive.points.thickness.value", Reason::kInvalidValue, "NaN"},
    {"thickness_negative",
     With(PointsRequest,
          [](R& r) { PrimitiveOf(r)->mutable_points()->mutable_thickness()->set_value(-1); }),
     "upsert.entity.primitive.points.thickness.value", Reason::kInvalidValue, "is -1"},
    {"thickness_great",
     With(SegmentsRequest,
          [](R& r) { PrimitiveOf(r)->mutable_segments()->mutable_thickness()->set_value(4097); }),
     "upsert.entity.primitive.segments.thickness.value", Reason::kInvalidValue, "is 4097"},
    {"thickness_unit",
     With(PointsRequest,
          [](R& r) {
            PrimitiveOf(r)->mutable_points()->mutable_thickness()->set_unit(
                static_cast<v1::Thickness::Unit>(7));
          }),
     "upsert.entity.primitive.points.thickness.unit", Reason::kInvalidValue, "value 7"},
    {"topology",
     With(SegmentsRequest,
          [](R& r) {
            PrimitiveOf(r)->mutable_segments()->set_topology(
                static_cast<v1::Segments::Topology>(4));
          }),
     "upsert.entity.primitive.segments.topology", Reason::kInvalidValue, "value 4"},
    {"sampling",
     With(SegmentsRequest,
          [](R& r) {
            PrimitiveOf(r)->mutable_segments()->set_sampling(static_cast<v1::LineSampling>(-1));
          }),
     "upsert.entity.primitive.segments.sampling", Reason::kInvalidValue, "value -1"},
    {"list_odd",
     With(SegmentsRequest,
          [](R& r) { PrimitiveOf(r)->mutable_segments()->set_topology(v1::Segments::LIST); }),
     "upsert.entity.primitive.segments.vertices.count", Reason::kSizeMismatch, "is 3"},
    {"strip_of_one",
     With(SegmentsRequest,
          [](R& r) {
            v1::Vertices* v = PrimitiveOf(r)->mutable_segments()->mutable_vertices();
            v->set_count(1);
            v->set_positions(Packed<float>({0, 0, 0}));
          }),
     "upsert.entity.primitive.segments.vertices.count", Reason::kSizeMismatch, "is 1"},

    // shapes
    {"box_center",
     With(BoxRequest, [](R& r) { PrimitiveOf(r)->mutable_box()->mutable_center()->set_z(kNaN); }),
     "upsert.entity.primitive.box.center.z", Reason::kInvalidValue, "NaN"},
    {"box_size",
     With(BoxRequest, [](R& r) { PrimitiveOf(r)->mutable_box()->mutable_size()->set_y(0); }),
     "upsert.entity.primitive.box.size.y", Reason::kInvalidValue, "is 0"},
    {"box_vanishing",
     With(BoxRequest, [](R& r) { PrimitiveOf(r)->mutable_box()->mutable_size()->set_x(1e-60); }),
     "upsert.entity.primitive.box.size.x", Reason::kInvalidValue, "1e-60"},
    {"box_fill",
     With(BoxRequest,
          [](R& r) { PrimitiveOf(r)->mutable_box()->set_fill(static_cast<v1::Fill>(9)); }),
     "upsert.entity.primitive.box.fill", Reason::kInvalidValue, "value 9"},
    {"box_rule",
     With(BoxRequest,
          [](R& r) { PrimitiveOf(r)->mutable_box()->set_rule(static_cast<v1::SurfaceRule>(9)); }),
     "upsert.entity.primitive.box.rule", Reason::kInvalidValue, "value 9"},
    {"sphere_radius",
     With(SphereRequest, [](R& r) { PrimitiveOf(r)->mutable_sphere()->set_radius(-2); }),
     "upsert.entity.primitive.sphere.radius", Reason::kInvalidValue, "is -2"},
    {"sphere_center",
     With(SphereRequest,
          [](R& r) { PrimitiveOf(r)->mutable_sphere()->mutable_center()->set_x(1e39); }),
     "upsert.entity.primitive.sphere.center.x", Reason::kInvalidValue, "1e+39"},
    {"cylinder_radius",
     With(CylinderRequest, [](R& r) { PrimitiveOf(r)->mutable_cylinder()->set_radius(kInfinity); }),
     "upsert.entity.primitive.cylinder.radius", Reason::kInvalidValue, "infinity"},
    {"cylinder_height",
     With(CylinderRequest, [](R& r) { PrimitiveOf(r)->mutable_cylinder()->set_height(0); }),
     "upsert.entity.primitive.cylinder.height", Reason::kInvalidValue, "is 0"},
    {"instance_empty",
     With(InstanceRequest, [](R& r) { PrimitiveOf(r)->mutable_instance()->set_object(""); }),
     "upsert.entity.primitive.instance.object", Reason::kInvalidValue, "is empty"},
    {"instance_color", With(InstanceRequest, [](R& r) { PrimitiveOf(r)->mutable_color(); }),
     "upsert.entity.primitive.color", Reason::kUnimplemented, "colours of its object"},

    // layers
    {"layer_empty", With(LayerRequest, [](R& r) { r.mutable_layer_state()->set_layer(""); }),
     "layer_state.layer", Reason::kInvalidValue, "is empty"},
    {"opacity", With(LayerRequest, [](R& r) { r.mutable_layer_state()->set_opacity(256); }),
     "layer_state.opacity", Reason::kInvalidValue, "is 256"},
    {"blend",
     With(LayerRequest,
          [](R& r) { r.mutable_layer_state()->set_blend(static_cast<v1::BlendMode>(8)); }),
     "layer_state.blend", Reason::kInvalidValue, "value 8"},
    {"clip_planes",
     With(ClipRequest,
          [](R& r) {
            for (int i = 0; i < 19; ++i) {
              *r.mutable_layer_state()->mutable_clip()->add_planes() = *PlaneOf(r);
            }
          }),
     "layer_state.clip.planes", Reason::kQuotaExceeded, "has 21 planes; max_clip_planes allows 20"},
    {"clip_normal", With(ClipRequest, [](R& r) { PlaneOf(r)->set_b(0); }),
     "layer_state.clip.planes[1]", Reason::kInvalidValue, "normal (0, 0, 0)"},
    {"clip_a", With(ClipRequest, [](R& r) { PlaneOf(r)->set_a(kNaN); }),
     "layer_state.clip.planes[1].a", Reason::kInvalidValue, "is NaN"},
    {"clip_b", With(ClipRequest, [](R& r) { PlaneOf(r)->set_b(-kInfinity); }),
     "layer_state.clip.planes[1].b", Reason::kInvalidValue, "-infinity"},
    {"clip_c", With(ClipRequest, [](R& r) { PlaneOf(r)->set_c(kNaN); }),
     "layer_state.clip.planes[1].c", Reason::kInvalidValue, "is NaN"},
    {"clip_d", With(ClipRequest, [](R& r) { PlaneOf(r)->set_d(kInfinity); }),
     "layer_state.clip.planes[1].d", Reason::kInvalidValue, "infinity"},
    {"region_min", With(RegionRequest, [](R& r) { RegionOf(r)->clear_min(); }),
     "layer_state.region.min", Reason::kInvalidValue, "give both corners, or neither"},
    {"region_max", With(RegionRequest, [](R& r) { RegionOf(r)->clear_max(); }),
     "layer_state.region.max", Reason::kInvalidValue, "give both corners, or neither"},
    {"region_nan", With(RegionRequest, [](R& r) { RegionOf(r)->mutable_min()->set_y(kNaN); }),
     "layer_state.region.min.y", Reason::kInvalidValue, "is NaN"},
    {"region_flat", With(RegionRequest, [](R& r) { RegionOf(r)->mutable_max()->set_z(0); }),
     "layer_state.region.max.z", Reason::kInvalidValue,
     "is 0; it must be greater than that of min"},
    {"region_inverted", With(RegionRequest, [](R& r) { RegionOf(r)->mutable_max()->set_x(-3); }),
     "layer_state.region.max.x", Reason::kInvalidValue, "is -3"},
    {"mask",
     With(LayerRequest,
          [](R& r) { r.mutable_layer_state()->set_mask_layer(std::string(300, 'm')); }),
     "layer_state.mask_layer", Reason::kInvalidValue, "has 300 bytes"},

    // objects
    {"object_empty", With(ObjectRequest, [](R& r) { r.mutable_define_object()->set_object(""); }),
     "define_object.object", Reason::kInvalidValue, "is empty"},
    {"object_undefined",
     With(ObjectRequest, [](R& r) { r.mutable_define_object()->clear_definition(); }),
     "define_object.definition", Reason::kInvalidValue, "is not set"},
    {"object_part",
     With(ObjectRequest,
          [](R& r) {
            r.mutable_define_object()
                ->mutable_definition()
                ->mutable_parts(1)
                ->mutable_primitive()
                ->mutable_sphere()
                ->set_radius(0);
          }),
     "define_object.definition.parts[1].primitive.sphere.radius", Reason::kInvalidValue, "is 0"},
    {"object_part_matrix",
     With(ObjectRequest,
          [](R& r) {
            SetMatrix(r.mutable_define_object()
                          ->mutable_definition()
                          ->mutable_parts(0)
                          ->mutable_transform(),
                      {1});
          }),
     "define_object.definition.parts[0].transform.m", Reason::kSizeMismatch, "has 1 values"},
    {"delete_object",
     With(
         +[] { return R(); }, [](R& r) { r.mutable_delete_object(); }),
     "delete_object.object", Reason::kInvalidValue, "is empty"},
};

class Refusals : public ::testing::TestWithParam<Case> {};

TEST_P(Refusals, NamesFieldReasonAndValue) {
  const Case& wrong = GetParam();
  const Decoded decoded = Decode(wrong.make());
  ASSERT_TRUE(decoded.status.ok()) << decoded.status;
  EXPECT_THAT(decoded.operations, IsEmpty());
  ASSERT_THAT(decoded.refused.issues, SizeIs(1));
  EXPECT_EQ(decoded.refused.issues[0].field, wrong.field);
  EXPECT_EQ(decoded.refused.issues[0].reason, wrong.reason);
  EXPECT_THAT(decoded.refused.issues[0].message, HasSubstr(wrong.value));
  EXPECT_EQ(decoded.refused.issues[0].sequence, decoded.sequence);
}

INSTANTIATE_TEST_SUITE_P(Field, Refusals, ::testing::ValuesIn(kCases),
                         [](const auto& info) { return std::string(info.param.name); });

}  // namespace refusals_test
}  // namespace voxeld::daemon::wire
