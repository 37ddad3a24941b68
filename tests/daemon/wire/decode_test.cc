#include "daemon/wire/decode.h"

#include <gmock/gmock.h>

#include <limits>
#include <variant>

#include "absl/strings/str_cat.h"
#include "tests/daemon/wire/requests.h"

namespace voxeld::daemon::wire {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

const GeometryData& GeometryOf(const Decoded& decoded) {
  return *std::get<GeometryPtr>(std::get<Upsert>(decoded.operations.at(0).op).entity.content);
}

TEST(Decode, MeshWithEverything) {
  v1::StreamRequest request = MeshRequest();
  v1::Entity* entity = request.mutable_upsert()->mutable_entity();
  entity->set_priority(126);
  entity->set_erase(true);
  entity->set_lifetime_ns(5);
  entity->set_label("label");
  for (const double m : {2, 0, 0, 1, 0, 2, 0, 2, 0, 0, 2, 3}) entity->mutable_transform()->add_m(m);
  v1::Mesh* mesh = entity->mutable_primitive()->mutable_mesh();
  mesh->set_rule(v1::SURFACE_RULE_COVER);
  mesh->mutable_vertices()->set_index_type(v1::ELEMENT_TYPE_U16);
  mesh->mutable_vertices()->set_index_count(3);
  mesh->mutable_vertices()->set_indices(Packed<uint16_t>({2, 1, 0}));
  mesh->mutable_vertices()->set_color_type(v1::ELEMENT_TYPE_RGBX8);
  mesh->mutable_vertices()->set_colors(
      std::string("\x01\x02\x03\xFF\x04\x05\x06\xFF\x07\x08\x09\xFF"));

  const Decoded decoded = Decode(request);
  ASSERT_TRUE(decoded.status.ok());
  EXPECT_THAT(decoded.refused.issues, IsEmpty());
  ASSERT_THAT(decoded.operations, SizeIs(1));
  EXPECT_EQ(decoded.operations[0].sequence, 7u);
  const auto& upsert = std::get<Upsert>(decoded.operations[0].op);
  EXPECT_EQ(upsert.layer, "layer");
  EXPECT_EQ(upsert.id, "id");
  EXPECT_EQ(upsert.entity.priority, 126u);
  EXPECT_TRUE(upsert.entity.erase);
  EXPECT_EQ(upsert.entity.lifetime_ns, 5);
  EXPECT_EQ(upsert.entity.label, "label");
  EXPECT_EQ(upsert.entity.transform, (gpu::Affine{{2, 0, 0, 1, 0, 2, 0, 2, 0, 0, 2, 3}}));
  const GeometryData& data = GeometryOf(decoded);
  EXPECT_EQ(data.record.kind, gpu::PrimitiveKind::kTriangles);
  EXPECT_EQ(data.record.rule, gpu::SurfaceRule::kCover);
  EXPECT_EQ(data.record.color_mode, gpu::ColorMode::kPerVertex);
  EXPECT_EQ(data.record.vertex_count, 3u);
  EXPECT_EQ(data.record.index_count, 3u);
  EXPECT_THAT(data.arrays.positions(), ElementsAre(0, 0, 0, 1, 0, 0, 0, 1, 0));
  EXPECT_THAT(data.arrays.indices(), ElementsAre(2, 1, 0));
  EXPECT_THAT(data.arrays.colors(), ElementsAre(0x010203, 0x040506, 0x070809));
  EXPECT_THAT(data.min, ElementsAre(0, 0, 0));
  EXPECT_THAT(data.max, ElementsAre(1, 1, 0));
}

TEST(Decode, IntegerPositions) {
  v1::StreamRequest request = PointsRequest();
  v1::Points* points = PrimitiveOf(request)->mutable_points();
  points->mutable_thickness()->set_value(2.5f);
  points->mutable_thickness()->set_unit(v1::Thickness::UNITS);
  points->mutable_vertices()->set_count(2);
  points->mutable_vertices()->set_position_type(v1::ELEMENT_TYPE_I16);
  points->mutable_vertices()->set_positions(Packed<int16_t>({-32768, 0, 7, 32767, -1, 5}));
  PrimitiveOf(request)->mutable_color()->set_rgb(0xABCDEF);
  Decoded decoded = Decode(request);
  ASSERT_THAT(decoded.operations, SizeIs(1));
  EXPECT_THAT(GeometryOf(decoded).arrays.positions(), ElementsAre(-32768, 0, 7, 32767, -1, 5));
  EXPECT_THAT(GeometryOf(decoded).min, ElementsAre(-32768, -1, 5));
  EXPECT_THAT(GeometryOf(decoded).max, ElementsAre(32767, 0, 7));
  EXPECT_EQ(GeometryOf(decoded).record.color, 0xABCDEFu);
  EXPECT_EQ(GeometryOf(decoded).record.color_mode, gpu::ColorMode::kUniform);
  EXPECT_EQ(GeometryOf(decoded).record.thickness, 2.5f);
  EXPECT_EQ(GeometryOf(decoded).record.thickness_unit, gpu::ThicknessUnit::kUnits);

  points->mutable_vertices()->set_position_type(v1::ELEMENT_TYPE_I32);
  points->mutable_vertices()->set_positions(Packed<int32_t>({-16777216, 0, 16777216, 1, 2, 3}));
  decoded = Decode(request);
  ASSERT_THAT(decoded.operations, SizeIs(1));
  EXPECT_THAT(GeometryOf(decoded).arrays.positions(), ElementsAre(-16777216, 0, 16777216, 1, 2, 3));
}

TEST(Decode, ShapesAndTheirBounds) {
  v1::StreamRequest request = UpsertRequest();
  v1::Cylinder* cylinder = PrimitiveOf(request)->mutable_cylinder();
  cylinder->mutable_center()->set_x(1);
  cylinder->set_radius(2);
  cylinder->set_height(6);
  cylinder->set_fill(v1::FILL_SOLID);
  Decoded decoded = Decode(request);
  ASSERT_THAT(decoded.operations, SizeIs(1));
  EXPECT_EQ(GeometryOf(decoded).record.kind, gpu::PrimitiveKind::kCylinder);
  EXPECT_EQ(GeometryOf(decoded).record.fill, gpu::Fill::kSolid);
  EXPECT_EQ(GeometryOf(decoded).record.color, 0xFFFFFFu);
  EXPECT_THAT(GeometryOf(decoded).min, ElementsAre(-1, -2, -3));
  EXPECT_THAT(GeometryOf(decoded).max, ElementsAre(3, 2, 3));

  v1::Box* box = PrimitiveOf(request)->mutable_box();
  box->mutable_center()->set_z(10);
  box->mutable_size()->set_x(1);
  box->mutable_size()->set_y(2);
  box->mutable_size()->set_z(4);
  decoded = Decode(request);
  ASSERT_THAT(decoded.operations, SizeIs(1));
  EXPECT_THAT(
      std::vector<float>(GeometryOf(decoded).record.params, GeometryOf(decoded).record.params + 6),
      ElementsAre(0, 0, 10, 1, 2, 4));
  EXPECT_THAT(GeometryOf(decoded).min, ElementsAre(-0.5, -1, 8));
  EXPECT_THAT(GeometryOf(decoded).max, ElementsAre(0.5, 1, 12));

  PrimitiveOf(request)->mutable_sphere()->set_radius(3);
  decoded = Decode(request);
  ASSERT_THAT(decoded.operations, SizeIs(1));
  EXPECT_EQ(GeometryOf(decoded).record.params[3], 3);
  EXPECT_THAT(GeometryOf(decoded).max, ElementsAre(3, 3, 3));
}

TEST(Decode, BadItemsOfABatchAreRefusedAlone) {
  v1::StreamRequest request;
  request.set_sequence(3);
  for (int i = 0; i < 10'000; ++i) {
    *request.mutable_batch()->add_upserts() =
        (i == 137 || i == 9'999 ? PointsRequest() : MeshRequest()).upsert();
    request.mutable_batch()->mutable_upserts(i)->set_id(absl::StrCat("e", i));
  }
  request.mutable_batch()->mutable_upserts(9'999)->mutable_entity()->set_priority(500);
  request.mutable_batch()
      ->mutable_upserts(137)
      ->mutable_entity()
      ->mutable_primitive()
      ->mutable_points()
      ->mutable_vertices()
      ->set_positions(
          Packed<float>({0, 0, 0, 0, 0, 0, 0, std::numeric_limits<float>::infinity(), 0}));
  const Decoded decoded = Decode(request);
  EXPECT_THAT(decoded.operations, SizeIs(9'998));
  ASSERT_THAT(decoded.refused.issues, SizeIs(2));
  EXPECT_EQ(decoded.refused.issues[0].field,
            "batch.upserts[137].entity.primitive.points.vertices.positions[2].y");
  EXPECT_EQ(decoded.refused.issues[0].id, "e137");
  EXPECT_EQ(decoded.refused.issues[0].layer, "layer");
  EXPECT_EQ(decoded.refused.issues[0].sequence, 3u);
  EXPECT_EQ(decoded.refused.issues[1].field, "batch.upserts[9999].entity.priority");
}

TEST(Decode, LimitsAreQuotas) {
  Limits limits;
  limits.max_vertices_per_entity = 2;
  EXPECT_EQ(Decode(MeshRequest(), limits).refused.issues.at(0).reason, Reason::kQuotaExceeded);
  limits = {};
  limits.max_operations_per_commit = 1;
  v1::StreamRequest batch;
  *batch.mutable_batch()->add_upserts() = MeshRequest().upsert();
  EXPECT_THAT(Decode(batch, limits).operations, SizeIs(1));
  *batch.mutable_batch()->add_upserts() = MeshRequest().upsert();
  EXPECT_EQ(Decode(batch, limits).refused.issues.at(0).field, "batch.upserts");
  limits = {};
  limits.max_parts_per_object = 1;
  v1::StreamRequest object;
  object.mutable_define_object()->set_object("o");
  for (int i = 0; i < 2; ++i) object.mutable_define_object()->mutable_definition()->add_parts();
  EXPECT_EQ(Decode(object, limits).refused.issues.at(0).field, "define_object.definition.parts");
  limits = {};
  limits.max_message_bytes = 10;
  EXPECT_TRUE(absl::IsResourceExhausted(Decode(MeshRequest(), limits).status));
}

TEST(Decode, AbsurdlyManyElementsAreNotEvenParsed) {
  // Two bytes for each entity: tag 15, length 0.
  std::string entities;
  for (int i = 0; i < 100; ++i) entities += std::string("\x7a\x00", 2);
  const std::string batch = absl::StrCat("\x7a\xc8\x01", entities);  // 200 bytes of Batch
  Limits limits;
  EXPECT_THAT(DecodeBytes(batch, limits).refused.issues, SizeIs(100));
  limits.max_operations_per_commit = 99;
  EXPECT_THAT(DecodeBytes(batch, limits).refused.issues, SizeIs(1));
  limits.max_operations_per_commit = 24;
  EXPECT_EQ(DecodeBytes(batch, limits).status.message(),
            "batch.upserts has 100 elements; 24 are allowed");
  v1::StreamRequest clip;
  for (int i = 0; i < 5000; ++i) clip.mutable_layer_state()->mutable_clip()->add_planes();
  EXPECT_EQ(Decode(clip, limits).status.message(),
            "layer_state.clip.planes has 5000 elements; 1024 are allowed");
  v1::StreamRequest object;
  for (int i = 0; i < 50; ++i) object.mutable_define_object()->mutable_definition()->add_parts();
  limits.max_parts_per_object = 10;
  EXPECT_TRUE(absl::IsResourceExhausted(Decode(object, limits).status));
}

TEST(Decode, OfManyFaultsTheFirstAreToldAndTheOthersCounted) {
  v1::StreamRequest batch;
  for (int i = 0; i < 10; ++i) batch.mutable_batch()->add_upserts();
  Limits limits;
  limits.max_issues_per_commit = 4;
  const Decoded decoded = Decode(batch, limits);
  EXPECT_THAT(decoded.refused.issues, SizeIs(4));
  EXPECT_EQ(decoded.refused.more, 6u);
}

TEST(Decode, ACommitIsPassedOnWithItsIssue) {
  v1::StreamRequest request;
  request.mutable_commit()->set_frame_id(9);
  request.mutable_commit()->set_durable(true);
  request.mutable_commit()->set_present_at_ns(-1);
  const Decoded decoded = Decode(request);
  ASSERT_THAT(decoded.refused.issues, SizeIs(1));
  EXPECT_EQ(decoded.refused.issues[0].field, "commit.present_at_ns");
  EXPECT_EQ(decoded.refused.issues[0].reason, Reason::kInvalidValue);
  ASSERT_THAT(decoded.operations, SizeIs(1));
  EXPECT_EQ(std::get<Commit>(decoded.operations[0].op).frame_id, 9u);
  EXPECT_TRUE(std::get<Commit>(decoded.operations[0].op).durable);
}

TEST(Decode, SequencesAscendOrAreCounted) {
  v1::StreamRequest request = MeshRequest();
  request.set_sequence(0);
  EXPECT_EQ(Decode(request, {}, 41).operations.at(0).sequence, 42u);
  request.set_sequence(41);
  Decoded decoded = Decode(request, {}, 41);
  EXPECT_THAT(decoded.operations, IsEmpty());
  ASSERT_THAT(decoded.refused.issues, SizeIs(1));
  EXPECT_EQ(decoded.refused.issues[0].reason, Reason::kOutOfOrder);
  EXPECT_EQ(decoded.refused.issues[0].field, "sequence");
  EXPECT_EQ(decoded.sequence, 41u);
  request.mutable_commit();
  decoded = Decode(request, {}, 41);
  EXPECT_THAT(decoded.refused.issues, SizeIs(1));
  EXPECT_THAT(decoded.operations, SizeIs(1)) << "a commit is answered, whatever is wrong with it";
  // No sequence follows the greatest number.
  request.set_sequence(0);
  EXPECT_THAT(Decode(request, {}, UINT64_MAX).refused.issues, SizeIs(1));
}

TEST(Decode, LayerStateKeepsWhatIsNotSet) {
  v1::StreamRequest request;
  request.mutable_layer_state()->set_layer("l");
  Decoded decoded = Decode(request);
  const auto* state = &std::get<LayerState>(decoded.operations.at(0).op);
  EXPECT_FALSE(state->visible || state->opacity || state->order || state->blend ||
               state->transform || state->clip || state->region);
  request.mutable_layer_state()->set_visible(false);
  request.mutable_layer_state()->set_opacity(0);
  request.mutable_layer_state()->set_order(-3);
  request.mutable_layer_state()->set_blend(v1::BLEND_MODE_ADD);
  request.mutable_layer_state()->mutable_transform();
  decoded = Decode(request);
  state = &std::get<LayerState>(decoded.operations.at(0).op);
  EXPECT_EQ(state->visible, false);
  EXPECT_EQ(state->opacity, 0u);
  EXPECT_EQ(state->order, -3);
  EXPECT_EQ(state->blend, gpu::BlendMode::kAdd);
  EXPECT_EQ(state->transform, gpu::Affine());
}

TEST(Decode, ClipsAndRegions) {
  v1::StreamRequest request;
  request.mutable_layer_state()->set_layer("l");
  v1::Clip* clip = request.mutable_layer_state()->mutable_clip();
  const auto decode = [&] { return std::get<LayerState>(Decode(request).operations.at(0).op); };
  // An empty one: the clip is removed.
  ASSERT_NE(decode().clip, nullptr);
  EXPECT_EQ(decode().clip->count, 0u);
  EXPECT_FALSE(decode().region.has_value());
  for (int i = 0; i < 8; ++i) {
    v1::Clip::Plane* plane = clip->add_planes();
    plane->set_a(i == 0 ? 1e300 : 0);
    plane->set_b(i);
    plane->set_d(-i / 2.0);
  }
  clip->mutable_planes(7)->set_c(-3);
  ASSERT_EQ(decode().clip->count, 8u);
  EXPECT_EQ(decode().clip->planes[0], (gpu::ClipPlane{1e300, 0, 0, 0}));
  EXPECT_EQ(decode().clip->planes[5], (gpu::ClipPlane{0, 5, 0, -2.5}));
  EXPECT_EQ(decode().clip->planes[7], (gpu::ClipPlane{0, 7, -3, -3.5}));

  request.mutable_layer_state()->clear_clip();
  v1::Box3* region = request.mutable_layer_state()->mutable_region();
  EXPECT_EQ(decode().clip, nullptr);
  ASSERT_TRUE(decode().region.has_value());
  EXPECT_EQ(*decode().region, std::nullopt);
  region->mutable_min()->set_x(-1);
  region->mutable_max()->set_x(1);
  region->mutable_max()->set_y(2);
  region->mutable_max()->set_z(0.5);
  ASSERT_TRUE(decode().region.has_value());
  EXPECT_EQ(*decode().region, (gpu::Region{{-1, 0, 0}, {1, 2, 0.5}}));
}

TEST(Decode, ClipsOfBoxesAndCylinders) {
  v1::StreamRequest request;
  request.mutable_layer_state()->set_layer("l");
  v1::Clip* clip = request.mutable_layer_state()->mutable_clip();
  v1::Clip::Box* box = clip->add_boxes();
  box->mutable_center()->set_y(2);
  for (const auto set : {&v1::Vec3::set_x, &v1::Vec3::set_y, &v1::Vec3::set_z}) {
    (box->mutable_size()->*set)(3);
  }
  v1::Clip::Cylinder* cylinder = clip->add_cylinders();
  cylinder->mutable_end()->set_z(4);
  cylinder->set_radius(0.5);
  const auto got = std::get<LayerState>(Decode(request).operations.at(0).op).clip;
  ASSERT_NE(got, nullptr);
  EXPECT_EQ(got->planes_in_all(), 8u);
  EXPECT_EQ(got->boxes[0], (ClipBox{{0, 2, 0}, {3, 3, 3}, {}}));
  EXPECT_EQ(got->cylinders[0], (ClipCylinder{{0, 0, 0}, {0, 0, 4}, 0.5}));
}

TEST(Decode, SolidMeshesAreFilledIfTheyAreClosed) {
  v1::StreamRequest request = MeshRequest();
  v1::Mesh* mesh = request.mutable_upsert()->mutable_entity()->mutable_primitive()->mutable_mesh();
  mesh->set_fill(v1::FILL_SOLID);
  Decoded decoded = Decode(request);
  // For one triangle: its surface, and an Issue about it.
  ASSERT_THAT(decoded.operations, SizeIs(1));
  EXPECT_EQ(GeometryOf(decoded).record.kind, gpu::PrimitiveKind::kTriangles);
  ASSERT_THAT(decoded.refused.issues, SizeIs(1));
  const Issue& issue = decoded.refused.issues[0];
  EXPECT_TRUE(issue.applied) << "it is not a refusal";
  EXPECT_EQ(issue.field, "upsert.entity.primitive.mesh.fill");
  EXPECT_EQ(issue.id, "id");
  EXPECT_EQ(issue.reason, Reason::kInvalidValue);
  EXPECT_EQ(issue.message,
            "fill is FILL_SOLID, but the mesh is open: the edge of vertices 0 and 1 belongs to 1 "
            "triangle, and it takes an even number; its surface is drawn");
  // Together with a second copy of the triangle it is closed, however thin.
  v1::Vertices* vertices = mesh->mutable_vertices();
  vertices->set_positions(vertices->positions() + vertices->positions());
  vertices->set_count(2 * vertices->count());
  decoded = Decode(request);
  EXPECT_THAT(decoded.refused.issues, IsEmpty());
  EXPECT_EQ(GeometryOf(decoded).record.kind, gpu::PrimitiveKind::kFilled);
  EXPECT_EQ(GeometryOf(decoded).record.fill, gpu::Fill::kSurface);
}

TEST(Decode, Deletes) {
  v1::StreamRequest request;
  v1::Delete* del = request.mutable_delete_();
  del->set_layer("l");
  del->set_guard_sequence(12);
  del->set_prefix("p");
  Decoded decoded = Decode(request);
  EXPECT_EQ(std::get<Delete>(decoded.operations.at(0).op).what, Delete::What::kPrefix);
  EXPECT_EQ(std::get<Delete>(decoded.operations.at(0).op).id_or_prefix, "p");
  EXPECT_EQ(std::get<Delete>(decoded.operations.at(0).op).guard_sequence, 12u);
  del->set_all_of_layer(true);
  decoded = Decode(request);
  EXPECT_EQ(std::get<Delete>(decoded.operations.at(0).op).what, Delete::What::kAllOfLayer);
  del->clear_layer();
  del->set_all_mine(true);
  decoded = Decode(request);
  EXPECT_EQ(std::get<Delete>(decoded.operations.at(0).op).what, Delete::What::kAllMine);
}

TEST(Decode, BytesThatAreNoMessageEndTheStream) {
  EXPECT_TRUE(absl::IsInvalidArgument(DecodeBytes("\xFF\xFF\xFF").status));
  // A layer's name that is not UTF-8.
  std::string bytes = UpsertRequest("layer").SerializeAsString();
  bytes[bytes.find("layer")] = '\xFF';
  EXPECT_THAT(std::string(DecodeBytes(bytes).status.message()), HasSubstr("UTF-8"));
  std::string cut = MeshRequest().SerializeAsString();
  cut.pop_back();
  EXPECT_TRUE(absl::IsInvalidArgument(DecodeBytes(cut).status));
}

TEST(Decode, MessagesAreValidUtf8WhateverTheyQuote) {
  v1::StreamRequest request = DecodeBytes("").status.ok() ? UpsertRequest() : v1::StreamRequest();
  std::string id;
  while (id.size() < 300) id += "é";
  request.mutable_upsert()->set_id(id);
  const Decoded decoded = Decode(request);
  ASSERT_THAT(decoded.refused.issues, SizeIs(1));
  v1::Issue issue;
  issue.set_message(decoded.refused.issues[0].message);
  EXPECT_TRUE(v1::Issue().ParseFromString(issue.SerializeAsString()));
}

TEST(DecodeUpdate, IsOpenedOperatedAndCommitted) {
  v1::ApplyUpdateRequest request;
  *request.add_operations() = MeshRequest();
  *request.add_operations() = MeshRequest();  // the same sequence again
  request.add_operations()->mutable_frame_begin();
  Decoded decoded = DecodeUpdate(request, {});
  ASSERT_TRUE(decoded.status.ok());
  EXPECT_EQ(decoded.open->on_disconnect, DisconnectPolicy::kKeep);
  ASSERT_THAT(decoded.operations, SizeIs(2));
  EXPECT_TRUE(std::holds_alternative<Commit>(decoded.operations[1].op));
  EXPECT_EQ(decoded.operations[1].sequence, 9u);
  ASSERT_THAT(decoded.refused.issues, SizeIs(2));
  EXPECT_EQ(decoded.refused.issues[0].field, "operations[1].sequence");
  EXPECT_EQ(decoded.refused.issues[1].field, "operations[2].frame_begin.layer");

  request.mutable_open()->set_on_disconnect(v1::DISCONNECT_POLICY_CLEAR);
  EXPECT_EQ(DecodeUpdate(request, {}).open->on_disconnect, DisconnectPolicy::kClear);
  request.add_operations()->mutable_commit();
  decoded = DecodeUpdate(request, {});
  EXPECT_TRUE(absl::IsInvalidArgument(decoded.status));
  EXPECT_THAT(std::string(decoded.status.message()), HasSubstr("operations[3].commit"));
}

TEST(DecodeUpdate, IsLimitedBeforeItIsParsed) {
  const auto decode = [](const v1::ApplyUpdateRequest& request, const Limits& limits) {
    const std::string bytes = request.SerializeAsString();
    const std::string_view view = bytes;
    return DecodeUpdate(std::span(&view, 1), limits);
  };
  Limits limits;
  limits.max_operations_per_commit = 10;
  limits.max_issues_per_commit = 4;
  v1::ApplyUpdateRequest request;
  for (int i = 0; i < 10; ++i) request.add_operations();
  const Decoded most = decode(request, limits);
  EXPECT_TRUE(most.status.ok()) << most.status;
  EXPECT_THAT(most.refused.issues, SizeIs(4));
  EXPECT_EQ(most.refused.more, 6u);

  request.add_operations();
  for (const Decoded& more : {decode(request, limits), DecodeUpdate(request, limits)}) {
    EXPECT_TRUE(absl::IsInvalidArgument(more.status)) << more.status;
    EXPECT_THAT(std::string(more.status.message()),
                HasSubstr("operations has 11 elements; max_operations_per_commit allows 10"));
  }
  request.Clear();
  for (int i = 0; i < 10; ++i) request.add_operations()->mutable_batch()->add_upserts();
  EXPECT_TRUE(decode(request, limits).status.ok());
  for (int j = 0; j < 40; ++j) request.mutable_operations(0)->mutable_batch()->add_upserts();
  EXPECT_TRUE(absl::IsResourceExhausted(decode(request, limits).status));
  limits = {};
  limits.max_message_bytes = 10;
  EXPECT_TRUE(absl::IsResourceExhausted(decode(request, limits).status));
  const std::string_view text = "not a message";
  EXPECT_TRUE(absl::IsInvalidArgument(DecodeUpdate(std::span(&text, 1), Limits()).status));
}

}  // namespace
}  // namespace voxeld::daemon::wire
