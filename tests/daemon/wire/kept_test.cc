// Tests rows of persistent state: encoding and decoding, and the errors for invalid rows.
#include "daemon/wire/kept.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <variant>

#include "daemon/text/fonts.h"
#include "tests/daemon/wire/requests.h"
#include "voxeld/v1/state.pb.h"

namespace voxeld::daemon::wire {
namespace kept_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// A length that reaches beyond the end.
const std::string kBroken = {0x0A, 0x7F, 0x00};

TEST(Kept, OwnersGoThereAndBack) {
  for (const uint64_t limit : {uint64_t{1}, uint64_t{77}, std::numeric_limits<uint64_t>::max()}) {
    OwnerRecord owner;
    owner.token = "token";
    owner.principal = "who";
    owner.hidden = true;
    owner.max_bytes = limit;
    owner.max_entities = limit;
    const absl::StatusOr<OwnerRecord> back = DecodeKeptOwner(EncodeKept(owner));
    ASSERT_TRUE(back.ok()) << back.status();
    EXPECT_EQ(back->token, "token");
    EXPECT_EQ(back->principal, "who");
    EXPECT_TRUE(back->hidden);
    EXPECT_EQ(back->max_bytes, limit);
    EXPECT_EQ(back->max_entities, limit);
  }
  EXPECT_FALSE(DecodeKeptOwner(EncodeKept(OwnerRecord{}))->hidden);
}

TEST(Kept, BytesThatAreNoneAreDataLoss) {
  const Limits limits;
  EXPECT_EQ(DecodeKeptOwner(kBroken).status().message(), "3 bytes are no voxeld.v1.KeptOwner");
  for (const absl::Status& status :
       {DecodeKeptOwner(kBroken).status(), DecodeKeptLayer(kBroken, limits).status(),
        DecodeKeptObject("o", kBroken, limits, nullptr, nullptr).status(),
        DecodeKeptEntity("l", "e", kBroken, {}, limits, nullptr, nullptr).status()}) {
    EXPECT_TRUE(absl::IsDataLoss(status)) << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr("3 bytes are no voxeld.v1.Kept"));
  }
}

TEST(Kept, ALayerSaysAllThatItIs) {
  v1::KeptLayer row;
  v1::LayerInfo* const info = row.mutable_info();
  info->set_layer("l");
  info->set_number(9);
  info->set_client_name("client");
  info->set_opacity(200);
  info->set_order(-3);
  info->set_blend(v1::BLEND_MODE_ADD);
  info->set_mask_layer("m");
  const absl::StatusOr<KeptLayerRow> plain = DecodeKeptLayer(row.SerializeAsString(), {});
  ASSERT_TRUE(plain.ok()) << plain.status();
  EXPECT_EQ(plain->number, 9u);
  EXPECT_EQ(plain->client_name, "client");
  const auto* state = &std::get<LayerState>(plain->operation.op);
  EXPECT_EQ(state->layer, "l");
  EXPECT_EQ(state->visible, false);
  EXPECT_EQ(state->opacity, 200u);
  EXPECT_EQ(state->order, -3);
  EXPECT_EQ(state->blend, gpu::BlendMode::kAdd);
  EXPECT_EQ(state->mask, "m");
  EXPECT_EQ(state->clip, nullptr);
  EXPECT_FALSE(state->region.has_value());

  info->mutable_clip()->add_planes()->set_c(2);
  info->mutable_region()->mutable_min()->set_x(-1);
  for (auto set : {&v1::Vec3::set_x, &v1::Vec3::set_y, &v1::Vec3::set_z})
    (info->mutable_region()->mutable_max()->*set)(5);
  info->mutable_region()->mutable_min()->set_y(-1);
  const absl::StatusOr<KeptLayerRow> cut = DecodeKeptLayer(row.SerializeAsString(), {});
  ASSERT_TRUE(cut.ok()) << cut.status();
  state = &std::get<LayerState>(cut->operation.op);
  EXPECT_EQ(state->clip->planes[0].c, 2);
  EXPECT_EQ(state->region.value()->max[1], 5);

  info->set_opacity(256);
  const absl::Status wrong = DecodeKeptLayer(row.SerializeAsString(), {}).status();
  EXPECT_TRUE(absl::IsInvalidArgument(wrong)) << wrong;
  EXPECT_THAT(std::string(wrong.message()), HasSubstr("layer_state.opacity: "));
}

TEST(Kept, AnObjectNamesThoseThatItNeeds) {
  v1::KeptObject row;
  row.mutable_definition()->add_parts()->mutable_primitive()->mutable_sphere()->set_radius(1);
  for (const char* name : {"a", "b"}) {
    row.mutable_definition()->add_parts()->mutable_primitive()->mutable_instance()->set_object(
        name);
  }
  const auto object = DecodeKeptObject("o", row.SerializeAsString(), {}, nullptr, nullptr);
  ASSERT_TRUE(object.ok()) << object.status();
  EXPECT_THAT(object->refers_to, ElementsAre("a", "b"));
  const auto& define = std::get<DefineObject>(object->operation.op);
  EXPECT_EQ(define.object, "o");
  EXPECT_EQ(define.data->parts.size(), 3u);
  row.mutable_definition()->mutable_parts(0)->mutable_primitive()->mutable_sphere()->set_radius(-1);
  const absl::Status wrong =
      DecodeKeptObject("o", row.SerializeAsString(), {}, nullptr, nullptr).status();
  EXPECT_TRUE(absl::IsInvalidArgument(wrong)) << wrong;
}

TEST(Kept, AnEntityLivesAsLongAsItHasLeft) {
  v1::KeptEntity row;
  row.mutable_entity()->mutable_primitive()->mutable_sphere()->set_radius(1);
  const TwoClocks now{.monotonic_ns = 5, .unix_ns = 1000};
  const auto lifetime = [&](int64_t expires) {
    row.set_expires_unix_ns(expires);
    const auto entity =
        DecodeKeptEntity("l", "e", row.SerializeAsString(), now, {}, nullptr, nullptr);
    EXPECT_TRUE(entity.ok()) << entity.status();
    if (!entity->has_value()) return int64_t{-1};
    const auto& upsert = std::get<Upsert>((*entity)->op);
    EXPECT_EQ(upsert.layer, "l");
    EXPECT_EQ(upsert.id, "e");
    return int64_t{upsert.entity.lifetime_ns};
  };
  EXPECT_EQ(lifetime(0), 0) << "for ever";
  EXPECT_EQ(lifetime(1001), 1);
  EXPECT_EQ(lifetime(1000), -1) << "it is over";
  EXPECT_EQ(lifetime(1), -1);
  EXPECT_EQ(lifetime(std::numeric_limits<int64_t>::min()), -1) << "from a damaged file";
  row.set_expires_unix_ns(0);
  row.mutable_entity()->mutable_primitive()->mutable_sphere()->set_radius(0);
  const absl::Status wrong =
      DecodeKeptEntity("l", "e", row.SerializeAsString(), now, {}, nullptr, nullptr).status();
  EXPECT_TRUE(absl::IsInvalidArgument(wrong)) << wrong;
  EXPECT_THAT(std::string(wrong.message()), HasSubstr("upsert.entity.primitive.sphere.radius: "));
}

TEST(Kept, ALifetimeOfCenturiesIsNotOverAfterwards) {
  v1::KeptEntity row;
  row.mutable_entity()->mutable_primitive()->mutable_sphere()->set_radius(1);
  const TwoClocks now{.monotonic_ns = 5, .unix_ns = 1'700'000'000'000'000'000};
  const auto decoded = [&](const std::string& bytes) {
    auto entity = DecodeKeptEntity("l", "e", bytes, now, {}, nullptr, nullptr);
    EXPECT_TRUE(entity.ok() && entity->has_value()) << entity.status();
    return std::get<Upsert>((**entity).op).entity;
  };
  Entity entity;
  entity.data = decoded(row.SerializeAsString());
  constexpr int64_t kLast = std::numeric_limits<int64_t>::max();
  entity.expires_ns = kLast - 1;
  const absl::StatusOr<std::string> kept = EncodeKept(entity, now);
  ASSERT_TRUE(kept.ok()) << kept.status();
  EXPECT_EQ(decoded(*kept).lifetime_ns, kLast - now.unix_ns) << "until the greatest possible time";
}

}  // namespace kept_test
}  // namespace voxeld::daemon::wire
