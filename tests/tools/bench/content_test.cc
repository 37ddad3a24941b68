#include "tools/bench/voxel_bench/content.h"

#include <gmock/gmock.h>

#include <cmath>
#include <cstring>

#include "tools/bench/voxel_bench/memory_feed.h"

namespace voxeld::bench {
namespace {

std::vector<float> PositionsOf(const v1::Entity& entity) {
  const std::string& bytes = entity.primitive().segments().vertices().positions();
  std::vector<float> out(bytes.size() / sizeof(float));
  std::memcpy(out.data(), bytes.data(), bytes.size());
  return out;
}

TEST(Lines, HaveAsManyBytesAsTheirFormSays) {
  for (const LineForm form : {LineForm::k24Bytes, LineForm::k28Bytes, LineForm::k30Bytes}) {
    const v1::Vertices vertices =
        EntityOf({.count = 4096, .form = form}).primitive().segments().vertices();
    EXPECT_EQ(vertices.count(), 8192u);
    EXPECT_EQ(vertices.positions().size() + vertices.indices().size() + vertices.colors().size(),
              4096 * static_cast<size_t>(form));
    EXPECT_EQ(vertices.index_count(), form == LineForm::k28Bytes ? 8192u : 0u);
  }
}

TEST(Lines, HaveTheirLengthAndLieInTheScene) {
  const std::vector<float> positions = PositionsOf(EntityOf({.count = 1000, .length = 0.5}));
  ASSERT_EQ(positions.size(), 6000u);
  for (size_t i = 0; i < positions.size(); i += 6) {
    const double length =
        std::hypot(positions[i + 3] - positions[i], positions[i + 4] - positions[i + 1],
                   positions[i + 5] - positions[i + 2]);
    EXPECT_NEAR(length, 0.5, 1e-5);
    for (size_t k = i; k < i + 6; ++k) EXPECT_LE(std::abs(positions[k]), 1 + 1e-6);
  }
}

TEST(Lines, OfOneSeedAreTheSameAndOfAnotherAllOthers) {
  const std::vector<float> one = PositionsOf(EntityOf({.count = 100, .seed = 1}));
  EXPECT_EQ(one, PositionsOf(EntityOf({.count = 100, .seed = 1})));
  const std::vector<float> two = PositionsOf(EntityOf({.count = 100, .seed = 2}));
  for (size_t i = 0; i < one.size(); i += 6) EXPECT_NE(one[i], two[i]);
}

TEST(Batch, HasEveryEntityWhereItBelongs) {
  const v1::StreamRequest request = BatchOf({{"a", "1", {.count = 2}}, {"b", "2", {.count = 3}}});
  ASSERT_EQ(request.batch().upserts_size(), 2);
  EXPECT_EQ(request.batch().upserts(0).layer(), "a");
  EXPECT_EQ(request.batch().upserts(1).id(), "2");
  EXPECT_EQ(request.batch().upserts(1).entity().primitive().segments().vertices().count(), 6u);
  EXPECT_EQ(request.sequence(), 0u);  // counted by the server, so that it can be sent again
}

TEST(InMemory, EveryPayloadIsNamedWhereItLiesAndNoneIsLeft) {
  const v1::StreamRequest batch = BatchOf({{"a", "1", {.count = 3, .form = LineForm::k30Bytes}},
                                           {"a", "2", {.count = 5, .form = LineForm::k28Bytes}}});
  const Named named = InMemory(batch, 9);
  ASSERT_EQ(named.request.batch().upserts_size(), 2);
  const auto vertices = [](const v1::StreamRequest& request, int i) -> const v1::Vertices& {
    return request.batch().upserts(i).entity().primitive().segments().vertices();
  };
  const auto expect = [&](const v1::MemoryRange& range, const std::string& payload) {
    EXPECT_EQ(range.memory(), 9u);
    EXPECT_EQ(range.offset() % 4, 0u);
    EXPECT_EQ(named.memory.substr(range.offset(), range.size()), payload);
  };
  for (int i = 0; i < 2; ++i) {
    const v1::Vertices &before = vertices(batch, i), &after = vertices(named.request, i);
    EXPECT_EQ(after.count(), before.count());
    EXPECT_TRUE(after.positions().empty() && after.colors().empty() && after.indices().empty());
    expect(after.positions_in(), before.positions());
  }
  expect(vertices(named.request, 0).colors_in(), vertices(batch, 0).colors());
  EXPECT_FALSE(vertices(named.request, 0).has_indices_in());
  expect(vertices(named.request, 1).indices_in(), vertices(batch, 1).indices());
  EXPECT_FALSE(vertices(named.request, 1).has_colors_in());
}

}  // namespace
}  // namespace voxeld::bench
