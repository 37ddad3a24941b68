// Tests payloads in bulk memory: which ones go there, and which do not fit.
#include <gmock/gmock.h>

#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/wire/decode.h"
#include "gpu/bulk/bulk_pool.h"
#include "tests/daemon/wire/requests.h"

namespace voxeld::daemon::wire {
namespace bulk_payload_test {

// Large payloads, in the pieces that gRPC makes of them, are in the pool as they were sent.
TEST(Bulk, PayloadsLieInThePool) {
  const auto pool = gpu::BulkPool::Create();
  v1::StreamRequest request = UpsertRequest();
  v1::Vertices* vertices = PrimitiveOf(request)->mutable_segments()->mutable_vertices();
  std::vector<float> positions(3 * 20'000);
  for (size_t i = 0; i < positions.size(); ++i) positions[i] = static_cast<float>(i) - 30'000.f;
  vertices->set_count(20'000);
  vertices->set_positions(Packed(positions));
  const std::string bytes = request.SerializeAsString();
  for (const size_t piece : {size_t{1}, size_t{7}, size_t{16377}, bytes.size()}) {
    std::vector<std::string_view> slices;
    for (size_t at = 0; at < bytes.size(); at += piece) {
      slices.push_back(std::string_view(bytes).substr(at, piece));
    }
    const Decoded decoded = DecodeStreamRequest(slices, {}, 0, pool.get());
    ASSERT_EQ(decoded.operations.size(), 1u);
    const GeometryData& data =
        *std::get<GeometryPtr>(std::get<Upsert>(decoded.operations[0].op).entity.content);
    ASSERT_TRUE(data.arrays.block());
    ASSERT_TRUE(std::ranges::equal(data.arrays.positions(), positions));
    EXPECT_EQ(data.min[0], -30'000);
    EXPECT_EQ(data.min[2], -29'998);
    EXPECT_EQ(data.max[1], 29'998);
    EXPECT_EQ(data.max[2], 29'999);
    EXPECT_GE(pool->used_bytes(), positions.size() * 4);
  }
  EXPECT_EQ(pool->used_bytes(), 0u);
}

TEST(Bulk, WhatThePoolCannotHoldIsRefusedByItself) {
  const auto pool = gpu::BulkPool::Create({.limit_bytes = 16 << 10});
  v1::StreamRequest request;
  for (int i = 0; i < 3; ++i) {
    v1::Upsert* upsert = request.mutable_batch()->add_upserts();
    upsert->set_layer("layer");
    upsert->set_id(absl::StrCat("id", i));
    v1::Vertices* vertices =
        upsert->mutable_entity()->mutable_primitive()->mutable_points()->mutable_vertices();
    vertices->set_count(i == 1 ? 2000 : 500);
    vertices->set_positions(std::string(size_t{12} * vertices->count(), '\0'));
  }
  const std::string bytes = request.SerializeAsString();
  const std::string_view view = bytes;
  const Decoded decoded = DecodeStreamRequest(std::span(&view, 1), {}, 0, pool.get());
  ASSERT_TRUE(decoded.status.ok());
  EXPECT_EQ(decoded.operations.size(), 2u);
  ASSERT_EQ(decoded.refused.issues.size(), 1u);
  const Issue& issue = decoded.refused.issues[0];
  EXPECT_EQ(issue.reason, Reason::kQuotaExceeded);
  EXPECT_EQ(issue.field, "batch.upserts[1].entity.primitive.points.vertices.positions");
  EXPECT_THAT(issue.message, testing::HasSubstr("24000 bytes asked for"));
  EXPECT_THAT(issue.message, testing::HasSubstr("limit 16384"));
}

}  // namespace bulk_payload_test
}  // namespace voxeld::daemon::wire
