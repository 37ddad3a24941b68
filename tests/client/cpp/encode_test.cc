// Tests the output of the wire writer, as protobuf reads it.
#include "client/cpp/src/encode.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "voxeld/v1/scene.pb.h"

namespace voxeld::client {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

v1::StreamRequest Parse(const Rope& rope) {
  v1::StreamRequest request;
  EXPECT_EQ(rope.Flat().size(), rope.size());
  EXPECT_TRUE(request.ParseFromString(rope.Flat()));
  EXPECT_TRUE(request.GetReflection()->GetUnknownFields(request).empty());
  return request;
}

v1::Primitive ParsePrimitive(const Shape& shape, Color color = {}) {
  const absl::StatusOr<Rope> rope = EncodePrimitive(shape, color);
  EXPECT_TRUE(rope.ok()) << rope.status();
  v1::Primitive primitive;
  EXPECT_TRUE(primitive.ParseFromString(rope->Flat()));
  return primitive;
}

template <typename T>
std::vector<T> Unpack(const std::string& bytes) {
  std::vector<T> values(bytes.size() / sizeof(T));
  std::memcpy(values.data(), bytes.data(), bytes.size());
  return values;
}

TEST(Encode, ArraysOfEveryKind) {
  const std::vector<float> positions = {0, 1, -2.5f, 3, 4, 5, 6, 7, 8};
  const std::vector<uint8_t> colors = {1, 2, 3, 4, 5, 6, 7, 8, 255};
  const v1::Primitive mesh = ParsePrimitive(Mesh{.vertices = {.positions = positions,
                                                              .colors = colors,
                                                              .indices = {0u, 2u, 1u},
                                                              .short_indices = {}},
                                                 .rule = SurfaceRule::kCover},
                                            {0x12, 0x34, 0x56});
  EXPECT_EQ(mesh.color().rgb(), 0x123456u);
  EXPECT_EQ(mesh.mesh().rule(), v1::SURFACE_RULE_COVER);
  const v1::Vertices& vertices = mesh.mesh().vertices();
  EXPECT_EQ(vertices.count(), 3u);
  EXPECT_EQ(vertices.position_type(), v1::ELEMENT_TYPE_F32);
  EXPECT_EQ(Unpack<float>(vertices.positions()), positions);
  EXPECT_EQ(vertices.color_type(), v1::ELEMENT_TYPE_RGB8);
  EXPECT_EQ(Unpack<uint8_t>(vertices.colors()), colors);
  EXPECT_EQ(vertices.index_type(), v1::ELEMENT_TYPE_U32);
  EXPECT_EQ(vertices.index_count(), 3u);
  EXPECT_THAT(Unpack<uint32_t>(vertices.indices()), ElementsAre(0, 2, 1));

  const v1::Primitive lines =
      ParsePrimitive(Segments{.vertices = {.positions = positions,
                                           .colors = {},
                                           .indices = {},
                                           .short_indices = {uint16_t{2}, uint16_t{0}}},
                              .topology = Segments::Topology::kLoop,
                              .sampling = LineSampling::kEuclidean,
                              .thickness = {2.5f, Thickness::Unit::kUnits}},
                     {0, 0, 0});
  EXPECT_TRUE(lines.has_color()) << "black is not white";
  EXPECT_EQ(lines.color().rgb(), 0u);
  EXPECT_EQ(lines.segments().topology(), v1::Segments::LOOP);
  EXPECT_EQ(lines.segments().sampling(), v1::LINE_SAMPLING_EUCLIDEAN);
  EXPECT_EQ(lines.segments().thickness().value(), 2.5f);
  EXPECT_EQ(lines.segments().thickness().unit(), v1::Thickness::UNITS);
  EXPECT_EQ(lines.segments().vertices().index_type(), v1::ELEMENT_TYPE_U16);
  EXPECT_THAT(Unpack<uint16_t>(lines.segments().vertices().indices()), ElementsAre(2, 0));
  EXPECT_EQ(lines.segments().vertices().color_type(), v1::ELEMENT_TYPE_UNSPECIFIED);

  EXPECT_EQ(
      ParsePrimitive(Points{.vertices = {.positions = positions}}).points().vertices().count(), 3u);
}

TEST(Encode, SolidsAndInstances) {
  const v1::Primitive box =
      ParsePrimitive(Box{.center = {1, 0, -3}, .size = {4, 5, 6}, .fill = Fill::kSolid});
  EXPECT_EQ(box.box().center().x(), 1);
  EXPECT_EQ(box.box().center().y(), 0);
  EXPECT_EQ(box.box().center().z(), -3);
  EXPECT_EQ(box.box().size().z(), 6);
  EXPECT_EQ(box.box().fill(), v1::FILL_SOLID);
  EXPECT_EQ(box.color().rgb(), 0xffffffu);
  const v1::Primitive sphere = ParsePrimitive(Sphere{.center = {0, 0, 1}, .radius = 0.25});
  EXPECT_EQ(sphere.sphere().radius(), 0.25);
  EXPECT_EQ(sphere.sphere().fill(), v1::FILL_SURFACE);
  const v1::Primitive cylinder =
      ParsePrimitive(Cylinder{.radius = 2, .height = 3, .rule = SurfaceRule::kCover});
  EXPECT_EQ(cylinder.cylinder().radius(), 2);
  EXPECT_EQ(cylinder.cylinder().height(), 3);
  EXPECT_EQ(cylinder.cylinder().rule(), v1::SURFACE_RULE_COVER);
  const v1::Primitive instance = ParsePrimitive(Instance{"tree"});
  EXPECT_EQ(instance.instance().object(), "tree");
  EXPECT_FALSE(instance.has_color());
}

TEST(Encode, ArraysThatDoNotFitAreRefusedWithTheNumbers) {
  const auto message = [](const Shape& shape) {
    return std::string(EncodePrimitive(shape, {}).status().message());
  };
  EXPECT_THAT(message(Points{.vertices = {.positions = {1.f, 2.f}}}), HasSubstr("has 2 numbers"));
  EXPECT_THAT(message(Points{}), HasSubstr("has 0 numbers"));
  EXPECT_THAT(message(Points{.vertices = {.positions = {1.f, 2.f, 3.f}, .colors = {uint8_t{1}}}}),
              HasSubstr("colors has 1 bytes for 1 vertices; 3"));
  EXPECT_THAT(message(Points{.vertices = {.positions = {1.f, 2.f, 3.f}, .indices = {0u}}}),
              HasSubstr("points have indices"));
  EXPECT_THAT(message(Mesh{.vertices = {.positions = {1.f, 2.f, 3.f},
                                        .colors = {},
                                        .indices = {0u},
                                        .short_indices = {uint16_t{0}}}}),
              HasSubstr("one of them must be empty"));
}

TEST(Encode, LargeArraysThatAreOwnedAreNotCopied) {
  std::vector<float> positions(30'000, 1.5f);
  const void* const where = positions.data();
  const absl::StatusOr<Rope> rope =
      EncodePrimitive(Points{.vertices = {.positions = std::move(positions)}}, {});
  ASSERT_TRUE(rope.ok());
  ASSERT_EQ(rope->tail().size(), 1u);
  EXPECT_EQ(static_cast<const void*>(rope->tail()[0].shared.data()), where);
  // Nor are they copied on their way into a message.
  Batcher batcher;
  batcher.Add({.layer = "l", .id = "i", .primitive = *rope, .label = {}});
  const std::vector<Batcher::Message> messages = batcher.Take();
  ASSERT_EQ(messages.size(), 1u);
  ASSERT_EQ(messages[0].bytes.tail().size(), 1u);
  EXPECT_EQ(static_cast<const void*>(messages[0].bytes.tail()[0].shared.data()), where);
  const v1::StreamRequest request = Parse(messages[0].bytes);
  EXPECT_EQ(request.batch().upserts(0).entity().primitive().points().vertices().positions().size(),
            120'000u);
}

TEST(Encode, ViewsMayGoWhenTheCallReturns) {
  std::vector<float> positions(30'000, 1.5f);
  const absl::StatusOr<Rope> rope =
      EncodePrimitive(Points{.vertices = {.positions = positions}}, {});
  std::fill(positions.begin(), positions.end(), 9.f);
  v1::Primitive primitive;
  ASSERT_TRUE(primitive.ParseFromString(rope->Flat()));
  EXPECT_EQ(Unpack<float>(primitive.points().vertices().positions()),
            std::vector<float>(30'000, 1.5f));
}

TEST(Encode, Operations) {
  Affine transform = Affine::Translate({1, 2, 3});
  v1::StreamRequest request =
      Parse(EncodeOperation(UpsertOperation{"layer", "id", *EncodePrimitive(Sphere{}, {}),
                                            transform, 126, true, 5'000'000'000, "label"}));
  EXPECT_EQ(request.upsert().layer(), "layer");
  EXPECT_EQ(request.upsert().id(), "id");
  const v1::Entity& entity = request.upsert().entity();
  EXPECT_TRUE(entity.primitive().has_sphere());
  EXPECT_THAT(entity.transform().m(), ElementsAre(1, 0, 0, 1, 0, 1, 0, 2, 0, 0, 1, 3));
  EXPECT_EQ(entity.priority(), 126u);
  EXPECT_TRUE(entity.erase());
  EXPECT_EQ(entity.lifetime_ns(), 5'000'000'000);
  EXPECT_EQ(entity.label(), "label");

  using What = DeleteOperation::What;
  EXPECT_EQ(Parse(EncodeOperation(DeleteOperation{"l", What::kId, "i"})).delete_().id(), "i");
  EXPECT_EQ(Parse(EncodeOperation(DeleteOperation{"l", What::kPrefix, ""})).delete_().what_case(),
            v1::Delete::kPrefix);
  EXPECT_TRUE(
      Parse(EncodeOperation(DeleteOperation{"l", What::kLayer, ""})).delete_().all_of_layer());
  EXPECT_TRUE(Parse(EncodeOperation(DeleteOperation{"", What::kAllMine, ""})).delete_().all_mine());

  request = Parse(EncodeOperation(TransformOperation{"l", "i", transform}));
  EXPECT_EQ(request.set_transform().id(), "i");
  EXPECT_EQ(request.set_transform().transform().m_size(), 12);

  request = Parse(EncodeOperation(LayerOperation{"l", {}}));
  EXPECT_EQ(request.layer_state().layer(), "l");
  EXPECT_FALSE(request.layer_state().has_visible());
  EXPECT_FALSE(request.layer_state().has_transform());
  for (const int32_t order : {0, 1, -1, -70'000, std::numeric_limits<int32_t>::min(),
                              std::numeric_limits<int32_t>::max()}) {
    request = Parse(EncodeOperation(LayerOperation{"l",
                                                   {.visible = false,
                                                    .opacity = uint8_t{0},
                                                    .order = order,
                                                    .blend = Blend::kErase,
                                                    .transform = transform}}));
    EXPECT_TRUE(request.layer_state().has_visible());
    EXPECT_FALSE(request.layer_state().visible());
    EXPECT_TRUE(request.layer_state().has_opacity());
    EXPECT_EQ(request.layer_state().order(), order);
    EXPECT_EQ(request.layer_state().blend(), v1::BLEND_MODE_ERASE);
    EXPECT_TRUE(request.layer_state().has_transform());
  }

  request = Parse(EncodeOperation(
      LayerOperation{"l",
                     {.clip = std::vector<ClipPart>{HalfSpace{1, 0, 0, 0.5}, HalfSpace{0, -2, 3, 0},
                                                    ClipBox{{1, 2, 3}, {4, 5, 6}, {}},
                                                    ClipCylinder{{0, 0, -1}, {0, 0, 1}, 2.5}},
                      .region = Region{.min = {-1, -2, -3}, .max = {1, 0, 3}},
                      .mask = "stencil"}}));
  EXPECT_EQ(request.layer_state().mask_layer(), "stencil");
  ASSERT_EQ(request.layer_state().clip().boxes_size(), 1);
  EXPECT_EQ(request.layer_state().clip().boxes(0).size().z(), 6);
  ASSERT_EQ(request.layer_state().clip().cylinders_size(), 1);
  EXPECT_EQ(request.layer_state().clip().cylinders(0).end().z(), 1);
  EXPECT_EQ(request.layer_state().clip().cylinders(0).radius(), 2.5);
  ASSERT_EQ(request.layer_state().clip().planes_size(), 2);
  EXPECT_EQ(request.layer_state().clip().planes(0).d(), 0.5);
  EXPECT_EQ(request.layer_state().clip().planes(1).b(), -2);
  EXPECT_EQ(request.layer_state().region().min().y(), -2);
  EXPECT_TRUE(request.layer_state().region().has_max());
  request = Parse(EncodeOperation(LayerOperation{
      "l", {.clip = std::vector<ClipPart>(), .region = Region{.everything = true}, .mask = ""}}));
  EXPECT_TRUE(request.layer_state().has_mask_layer());
  EXPECT_EQ(request.layer_state().mask_layer(), "");
  EXPECT_TRUE(request.layer_state().has_clip());
  EXPECT_EQ(request.layer_state().clip().planes_size(), 0);
  EXPECT_TRUE(request.layer_state().has_region());
  EXPECT_FALSE(request.layer_state().region().has_min());

  const absl::StatusOr<DefineOperation> define =
      EncodeDefinition("tree", {{.shape = Sphere{}, .color = {1, 0, 0}, .transform = {}},
                                {.shape = Instance{"leaf"}, .color = {}, .transform = transform}});
  ASSERT_TRUE(define.ok());
  EXPECT_THAT(define->uses, ElementsAre("leaf"));
  request = Parse(EncodeOperation(*define));
  EXPECT_EQ(request.define_object().object(), "tree");
  ASSERT_EQ(request.define_object().definition().parts_size(), 2);
  EXPECT_EQ(request.define_object().definition().parts(0).primitive().color().rgb(), 0x10000u);
  EXPECT_EQ(request.define_object().definition().parts(1).primitive().instance().object(), "leaf");
  EXPECT_EQ(request.define_object().definition().parts(1).transform().m(3), 1);

  request = Parse(EncodeOperation(RemoveObjectOperation{"tree", true}));
  EXPECT_EQ(request.delete_object().object(), "tree");
  EXPECT_TRUE(request.delete_object().cascade());
  EXPECT_EQ(Parse(EncodeFrameBegin("l")).frame_begin().layer(), "l");
  EXPECT_EQ(Parse(EncodeFrameEnd("l")).frame_end().layer(), "l");
  EXPECT_EQ(Parse(EncodePing(-5)).ping().client_time_ns(), -5);

  Rope commit = EncodeCommit({1, 2, 3, true, true, 4});
  AddSequence(300, &commit);
  request = Parse(commit);
  EXPECT_EQ(request.sequence(), 300u);
  EXPECT_EQ(request.commit().frame_id(), 1u);
  EXPECT_EQ(request.commit().send_time_ns(), 2);
  EXPECT_EQ(request.commit().present_at_ns(), 3);
  EXPECT_TRUE(request.commit().must_show());
  EXPECT_TRUE(request.commit().durable());
  EXPECT_EQ(request.commit().client_drops(), 4u);
}

TEST(Batcher, SplitsInOrderAndKeepsTheLargeAlone) {
  Batcher batcher;
  const auto upsert = [](int id, size_t vertices) {
    return UpsertOperation{
        .layer = "l",
        .id = std::to_string(id),
        .primitive = *EncodePrimitive(
            Points{.vertices = {.positions = std::vector<float>(vertices * 3)}}, {}),
        .label = {}};
  };
  int id = 0;
  for (int i = 0; i < 1000; ++i) batcher.Add(upsert(id++, 50));
  batcher.Add(upsert(id++, 100'000));
  for (int i = 0; i < 10; ++i) batcher.Add(upsert(id++, 50));
  const std::vector<Batcher::Message> messages = batcher.Take();
  int next = 0;
  for (size_t i = 0; i < messages.size(); ++i) {
    const v1::StreamRequest request = Parse(messages[i].bytes);
    EXPECT_EQ(messages[i].upserts, static_cast<size_t>(request.batch().upserts_size()));
    if (request.batch().upserts_size() > 1) {
      EXPECT_LE(messages[i].bytes.size(), kBatchBytes + 16);
    }
    if (i < 3) {
      EXPECT_GE(messages[i].bytes.size(), 64u << 10);
    }
    for (const v1::Upsert& each : request.batch().upserts())
      EXPECT_EQ(each.id(), std::to_string(next++));
  }
  EXPECT_EQ(next, id);
  EXPECT_TRUE(batcher.Take().empty());
}

TEST(Batcher, OfOneEntityThereIsOneInEach) {
  Batcher batcher;
  for (const char* id : {"a", "b", "a", "c", "a"})
    batcher.Add({.layer = "l", .id = id, .primitive = *EncodePrimitive(Sphere{}, {}), .label = {}});
  std::vector<std::string> ids;
  for (const Batcher::Message& message : batcher.Take()) {
    std::string& in = ids.emplace_back();
    const v1::StreamRequest request = Parse(message.bytes);
    for (const v1::Upsert& upsert : request.batch().upserts()) in += upsert.id();
  }
  EXPECT_THAT(ids, ElementsAre("ab", "ac", "a"));
}

TEST(Affine, ComposesRightToLeft) {
  const Affine both = Affine::Translate({1, 2, 3}) * Affine::Scale({2, 3, 4});
  EXPECT_THAT(both.m, ElementsAre(2, 0, 0, 1, 0, 3, 0, 2, 0, 0, 4, 3));
  const Affine quarter = Affine::Rotate({0, 0, 5}, 1.5707963267948966);
  EXPECT_NEAR(quarter.m[1], -1, 1e-12);
  EXPECT_NEAR(quarter.m[4], 1, 1e-12);
  EXPECT_NEAR(quarter.m[10], 1, 1e-12);
}

}  // namespace
}  // namespace voxeld::client
