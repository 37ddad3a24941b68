// Tests rare requests: ranges in place of a texture's payloads, wrong updates, and control
// requests.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "daemon/core/budget.h"
#include "daemon/wire/clip.h"
#include "daemon/wire/convert.h"
#include "daemon/wire/decode.h"
#include "daemon/wire/memory_source.h"
#include "daemon/wire/primitive.h"
#include "tests/daemon/pictures/files.h"
#include "tests/daemon/wire/full_primitives.h"
#include "tests/daemon/wire/requests.h"

namespace voxeld::daemon::wire {
namespace far_requests_test {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// Contents under names of 32 bytes; records what was charged when each was requested.
class Shelf final : public AssetSource {
 public:
  explicit Shelf(const Budget* budget = nullptr) : budget_(budget) {}

  absl::StatusOr<MappedRange> FindAsset(std::string_view digest, uint64_t offset,
                                        uint64_t size) override {
    if (budget_ != nullptr) charged.push_back(budget_->used_bytes(Budget::Use::kArriving));
    const auto found = contents_.find(std::string(digest));
    if (found == contents_.end()) return absl::NotFoundError("is gone");
    const auto copy = std::make_shared<std::string>(found->second.substr(offset, size));
    return MappedRange{*copy, copy};
  }
  // Moves the bytes out of a field.
  void Take(std::string* bytes, v1::MemoryRange* range) {
    const std::string digest(32, static_cast<char>('a' + contents_.size()));
    range->set_asset(digest);
    range->set_size(bytes->size());
    contents_[digest] = std::exchange(*bytes, {});
  }

  std::vector<uint64_t> charged;

 private:
  const Budget* const budget_;
  std::map<std::string, std::string> contents_;
};

v1::StreamRequest TexturedRequest() {
  v1::StreamRequest request = MeshRequest();
  v1::Texture* const texture = PrimitiveOf(request)->mutable_mesh()->mutable_texture();
  texture->set_picture(pictures::PngOf(2, 2, {1, 2, 3, 4}));
  texture->set_coordinates(Packed<float>({0, 0, 1, 0, 0, 1}));
  return request;
}

v1::StreamRequest HeightsRequest() {
  v1::StreamRequest request = UpsertRequest();
  for (const v1::Primitive& p : FullPrimitives()) {
    if (p.has_height_map()) *PrimitiveOf(request) = p;
  }
  PrimitiveOf(request)->clear_color_scale();
  PrimitiveOf(request)->mutable_height_map()->set_picture(pictures::PngOf(2, 2, {1, 2, 3, 4}));
  return request;
}

Decoded DecodeFrom(const v1::StreamRequest& request, AssetSource* assets,
                   Budget* budget = nullptr) {
  const std::string bytes = request.SerializeAsString();
  const std::string_view slice = bytes;
  return DecodeStreamRequest(std::span(&slice, 1), {}, 0, nullptr, {nullptr, assets, budget});
}

const GeometryData& GeometryOf(const Decoded& decoded) {
  return *std::get<GeometryPtr>(std::get<Upsert>(decoded.operations.at(0).op).entity.content);
}

TEST(FarRanges, StandForATexturesPictureAndPlaces) {
  const Decoded want = Decode(TexturedRequest());
  ASSERT_THAT(want.refused.issues, IsEmpty());
  for (const int which : {1, 2, 3}) {
    SCOPED_TRACE(which);
    Shelf shelf;
    v1::StreamRequest request = TexturedRequest();
    v1::Texture* const texture = PrimitiveOf(request)->mutable_mesh()->mutable_texture();
    if (which & 1) shelf.Take(texture->mutable_picture(), texture->mutable_picture_in());
    if (which & 2) shelf.Take(texture->mutable_coordinates(), texture->mutable_coordinates_in());
    const Decoded got = DecodeFrom(request, &shelf);
    ASSERT_THAT(got.refused.issues, IsEmpty());
    EXPECT_TRUE(
        std::ranges::equal(GeometryOf(got).arrays.colors(), GeometryOf(want).arrays.colors()));
    EXPECT_EQ(GeometryOf(got).record.texture_width, 2u);
  }
}

TEST(FarRanges, StandForAHeightMapsPicture) {
  const Decoded want = Decode(HeightsRequest());
  ASSERT_THAT(want.refused.issues, IsEmpty());
  Shelf shelf;
  v1::StreamRequest request = HeightsRequest();
  v1::HeightMap* const map = PrimitiveOf(request)->mutable_height_map();
  shelf.Take(map->mutable_picture(), map->mutable_picture_in());
  const Decoded got = DecodeFrom(request, &shelf);
  ASSERT_THAT(got.refused.issues, IsEmpty());
  EXPECT_TRUE(
      std::ranges::equal(GeometryOf(got).arrays.colors(), GeometryOf(want).arrays.colors()));
  // Colours alone, too.
  v1::StreamRequest colored = HeightsRequest();
  PrimitiveOf(colored)->mutable_height_map()->clear_picture();
  PrimitiveOf(colored)->mutable_height_map()->set_colors("abcdefghijkl");
  const Decoded wanted = Decode(colored);
  v1::HeightMap* const own = PrimitiveOf(colored)->mutable_height_map();
  shelf.Take(own->mutable_colors(), own->mutable_colors_in());
  const Decoded found = DecodeFrom(colored, &shelf);
  ASSERT_THAT(found.refused.issues, IsEmpty());
  EXPECT_TRUE(
      std::ranges::equal(GeometryOf(found).arrays.colors(), GeometryOf(wanted).arrays.colors()));
}

TEST(FarRanges, AnIsosurfacesSamplesMayLieThereToo) {
  v1::StreamRequest request = UpsertRequest();
  for (const v1::Primitive& p : FullPrimitives()) {
    if (p.has_isosurface()) *PrimitiveOf(request) = p;
  }
  ASSERT_THAT(Decode(request).refused.issues, IsEmpty());
  Shelf shelf;
  v1::Grid* const grid = PrimitiveOf(request)->mutable_isosurface()->mutable_grid();
  shelf.Take(grid->mutable_samples(), grid->mutable_samples_in());
  EXPECT_THAT(DecodeFrom(request, &shelf).refused.issues, IsEmpty());
  grid->mutable_samples_in()->set_asset(std::string(32, 'z'));
  const Decoded decoded = DecodeFrom(request, &shelf);
  ASSERT_THAT(decoded.refused.issues, SizeIs(1));
  EXPECT_EQ(decoded.refused.issues[0].field,
            "upsert.entity.primitive.isosurface.grid.samples_in.asset");
  EXPECT_EQ(decoded.refused.issues[0].reason, Reason::kNotFound);
}

TEST(FarRanges, BesideTheBytesThemselvesAreRefused) {
  Shelf shelf;
  const auto issue = [&](const v1::StreamRequest& request) {
    const Decoded decoded = DecodeFrom(request, &shelf);
    EXPECT_THAT(decoded.operations, IsEmpty());
    EXPECT_THAT(decoded.refused.issues, SizeIs(1));
    return decoded.refused.issues.at(0).field + " " + decoded.refused.issues.at(0).message;
  };
  v1::StreamRequest textured = TexturedRequest();
  v1::Texture* const texture = PrimitiveOf(textured)->mutable_mesh()->mutable_texture();
  texture->mutable_picture_in()->set_size(7);
  EXPECT_EQ(
      issue(textured),
      absl::StrCat(
          "upsert.entity.primitive.mesh.texture.picture_in picture_in is set, and picture has ",
          texture->picture().size(), " bytes; give one of them"));
  texture->clear_picture_in();
  texture->mutable_coordinates_in();
  EXPECT_EQ(issue(textured),
            "upsert.entity.primitive.mesh.texture.coordinates_in coordinates_in is set, and "
            "coordinates has 24 "
            "bytes; give one of them");
  for (const char* name : {"heights", "colors", "picture"}) {
    v1::StreamRequest heights = HeightsRequest();
    v1::HeightMap* const map = PrimitiveOf(heights)->mutable_height_map();
    map->set_colors("abcdefghijkl");
    const auto* const field = map->GetDescriptor()->FindFieldByName(absl::StrCat(name, "_in"));
    map->GetReflection()->MutableMessage(map, field);
    EXPECT_THAT(issue(heights),
                HasSubstr(absl::StrCat("upsert.entity.primitive.height_map.", name, "_in ", name,
                                       "_in is set, and ", name, " has ")));
  }
}

TEST(FarRanges, WithoutAnythingToReadFromAreRefused) {
  v1::Primitive mesh = MeshRequest().upsert().entity().primitive();
  mesh.mutable_mesh()->mutable_vertices()->clear_positions();
  mesh.mutable_mesh()->mutable_vertices()->mutable_positions_in()->set_memory(4);
  mesh.mutable_mesh()->mutable_vertices()->mutable_positions_in()->set_size(36);
  const Limits limits;
  Content content;
  const MaybeFault fault = ToContent(FieldPath("primitive"), mesh, {limits}, &content);
  ASSERT_TRUE(fault.has_value());
  EXPECT_EQ(fault->field, "primitive.mesh.vertices.positions_in");
  EXPECT_THAT(fault->message, HasSubstr("names memory 4, and this call has no local socket"));
}

TEST(FarRanges, WhatIsReadOfAssetsIsChargedWhileItIsDecoded) {
  Budget budget(200);
  budget.ChargeAnyway(Budget::Use::kScene, 100);
  Shelf shelf(&budget);
  v1::StreamRequest request;
  for (const char* id : {"a", "b", "c"}) {
    v1::Upsert* const upsert = request.mutable_batch()->add_upserts();
    *upsert = PointsRequest().upsert();
    upsert->set_id(id);
    v1::Vertices* const vertices =
        upsert->mutable_entity()->mutable_primitive()->mutable_points()->mutable_vertices();
    shelf.Take(vertices->mutable_positions(), vertices->mutable_positions_in());
  }
  const Decoded decoded = DecodeFrom(request, &shelf, &budget);
  // Each takes 36 bytes: two fit in addition to the 100 of the scene, the third does not.
  EXPECT_THAT(shelf.charged, ::testing::ElementsAre(36u, 72u));
  EXPECT_THAT(decoded.operations, SizeIs(2));
  ASSERT_THAT(decoded.refused.issues, SizeIs(1));
  const Issue& issue = decoded.refused.issues[0];
  EXPECT_EQ(issue.field, "batch.upserts[2].entity.primitive.points.vertices.positions_in.size");
  EXPECT_EQ(issue.reason, Reason::kQuotaExceeded);
  EXPECT_THAT(
      issue.message,
      HasSubstr(
          "is 36, beside 172 bytes that are held for all clients; max_memory_bytes allows 200"));
  EXPECT_EQ(budget.used_bytes(), 100u) << "and given back after it";
  // A decoder that has read nothing gives nothing back.
  EXPECT_THAT(DecodeFrom(MeshRequest(), &shelf, &budget).refused.issues, IsEmpty());
  EXPECT_EQ(budget.used_bytes(), 100u);
}

TEST(FarUpdates, AreRefusedWhole) {
  v1::ApplyUpdateRequest request;
  *request.add_operations() = MeshRequest();
  const auto refusal = [&] {
    const Decoded decoded = DecodeUpdate(request, {});
    EXPECT_TRUE(absl::IsInvalidArgument(decoded.status)) << decoded.status;
    EXPECT_THAT(decoded.operations, IsEmpty());
    return std::string(decoded.status.message());
  };
  request.mutable_open()->set_linger_ns(1);
  EXPECT_THAT(refusal(), HasSubstr("open.linger_ns is 1"));
  request.mutable_open()->clear_linger_ns();
  request.mutable_open()->set_resume_token("0123456789abcdef");
  EXPECT_THAT(refusal(), HasSubstr("open.resume_token is set; an update is a session of its own"));
  request.mutable_open()->clear_resume_token();
  request.add_operations()->mutable_open();
  EXPECT_THAT(refusal(), HasSubstr("operations[1].open is set"));
  request.mutable_operations(1)->mutable_ping();
  EXPECT_THAT(refusal(), HasSubstr("operations[1].ping is set"));
  request.mutable_operations(1)->mutable_commit();
  EXPECT_THAT(refusal(), HasSubstr("operations[1].commit is set"));
}

// An operation belongs to the layer that its message names.
TEST(FarOperations, NameWhatTheyAreOf) {
  const auto decoded = [](const v1::StreamRequest& request) {
    const Decoded out = Decode(request);
    EXPECT_THAT(out.refused.issues, IsEmpty());
    return out.operations.at(0).op;
  };
  v1::StreamRequest request = MeshRequest();
  EXPECT_EQ(std::get<Upsert>(decoded(request)).layer, "layer");
  EXPECT_EQ(std::get<Upsert>(decoded(request)).id, "id");
  request.mutable_set_transform()->set_layer("l");
  request.mutable_set_transform()->set_id("i");
  EXPECT_EQ(std::get<SetTransform>(decoded(request)).layer, "l");
  EXPECT_EQ(std::get<SetTransform>(decoded(request)).id, "i");
  request.mutable_layer_state()->set_layer("l");
  EXPECT_EQ(std::get<LayerState>(decoded(request)).layer, "l");
  request.mutable_frame_begin()->set_layer("l");
  EXPECT_EQ(std::get<FrameBegin>(decoded(request)).layer, "l");
  request.mutable_frame_end()->set_layer("l");
  EXPECT_EQ(std::get<FrameEnd>(decoded(request)).layer, "l");
  request.mutable_define_object()->set_object("o");
  request.mutable_define_object()->mutable_definition();
  EXPECT_EQ(std::get<DefineObject>(decoded(request)).object, "o");
  request.mutable_delete_object()->set_object("o");
  request.mutable_delete_object()->set_cascade(true);
  EXPECT_EQ(std::get<DeleteObject>(decoded(request)).object, "o");
  EXPECT_TRUE(std::get<DeleteObject>(decoded(request)).cascade);
}

TEST(FarLayers, HaveEveryBlendAndAMaskThatCanBeTakenAway) {
  v1::StreamRequest request;
  request.mutable_layer_state()->set_layer("l");
  const std::pair<v1::BlendMode, gpu::BlendMode> modes[] = {
      {v1::BLEND_MODE_OVER, gpu::BlendMode::kOver},
      {v1::BLEND_MODE_ADD, gpu::BlendMode::kAdd},
      {v1::BLEND_MODE_ERASE, gpu::BlendMode::kErase}};
  for (const auto& [wire, ours] : modes) {
    request.mutable_layer_state()->set_blend(wire);
    EXPECT_EQ(std::get<LayerState>(Decode(request).operations.at(0).op).blend, ours);
  }
  EXPECT_FALSE(std::get<LayerState>(Decode(request).operations.at(0).op).mask.has_value());
  request.mutable_layer_state()->set_mask_layer("");
  EXPECT_EQ(std::get<LayerState>(Decode(request).operations.at(0).op).mask, "")
      << "the mask is removed";
  request.mutable_layer_state()->set_mask_layer("m");
  EXPECT_EQ(std::get<LayerState>(Decode(request).operations.at(0).op).mask, "m");
}

TEST(FarClips, EveryNumberIsLookedAt) {
  const auto fault_of = [](const v1::Clip& message) {
    Clip clip;
    const MaybeFault fault = ToClip(FieldPath("clip"), message, {}, &clip);
    return fault ? fault->field + ": " + fault->message : "";
  };
  v1::Clip clip;
  v1::Clip::Plane* const plane = clip.add_planes();
  plane->set_c(1);
  EXPECT_EQ(fault_of(clip), "") << "one of a, b and c is enough";
  clip.Clear();
  v1::Clip::Cylinder* const cylinder = clip.add_cylinders();
  cylinder->mutable_end()->set_z(1);
  cylinder->set_radius(1);
  ASSERT_EQ(fault_of(clip), "");
  cylinder->mutable_end()->set_y(NAN);
  EXPECT_EQ(fault_of(clip), "clip.cylinders[0].end.y: is NaN; give a finite number");
  cylinder->mutable_end()->set_y(0);
  for (const double radius : {std::nan(""), double{INFINITY}}) {
    cylinder->set_radius(radius);
    EXPECT_THAT(fault_of(clip), HasSubstr("clip.cylinders[0].radius: is "));
  }
}

TEST(FarConversions, ControlsHoldWhatIsPresent) {
  v1::ControlOwnerRequest request;
  request.set_owner(5);
  OwnerControl control = FromWire(request);
  EXPECT_EQ(control.owner, 5u);
  EXPECT_FALSE(control.hidden || control.max_bytes || control.max_entities || control.evict);
  request.set_hidden(false);
  request.set_max_bytes(0);
  request.set_max_entities(7);
  request.set_evict(true);
  control = FromWire(request);
  EXPECT_EQ(control.hidden, false);
  EXPECT_EQ(control.max_bytes, 0u);
  EXPECT_EQ(control.max_entities, 7u);
  EXPECT_TRUE(control.evict);
}

TEST(FarConversions, DisplaysHaveAPowerLimitAndAView) {
  v1::UpdateDisplayRequest request;
  EXPECT_FALSE(FromWire(request)->power_limit_w.has_value());
  request.set_power_limit_w(12.5);
  request.mutable_view();
  const absl::StatusOr<DisplayUpdate> update = FromWire(request);
  ASSERT_TRUE(update.ok()) << update.status();
  EXPECT_EQ(update->power_limit_w, 12.5);
  EXPECT_EQ(update->view->mode, ViewOptions::Mode::kFit) << "if it is not set";
  request.mutable_view()->set_mode(static_cast<v1::View::Mode>(9));
  EXPECT_THAT(std::string(FromWire(request).status().message()),
              HasSubstr("view.mode has the unknown value 9"));
}

TEST(FarConversions, LayoutsOfFramesBothWays) {
  const display::FrameLayout layout{3, 4, 5, 2, display::PixelFormat::kRgb888};
  v1::FrameLayout message;
  ToWire(layout, &message);
  const absl::StatusOr<display::FrameLayout> back = FromWire(message);
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(*back, layout);
  message.set_bits(message.bits() + 1);
  EXPECT_EQ(FromWire(message)->bits_per_channel(), layout.bits_per_channel() + 1);
  message.set_format(static_cast<v1::PixelFormat>(99));
  EXPECT_TRUE(absl::IsInvalidArgument(FromWire(message).status()));
}

}  // namespace far_requests_test
}  // namespace voxeld::daemon::wire
