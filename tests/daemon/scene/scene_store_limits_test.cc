// Tests the limits of a scene: per owner, for all owners, per entity, and in bytes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "daemon/scene/scene_store.h"
#include "gpu/derived_bytes.h"
#include "tests/daemon/scene/store_fixture.h"

namespace voxeld::daemon {
namespace {

using testing::Begin;
using testing::CheckIndices;
using testing::Define;
using testing::DeleteAllMine;
using testing::DeleteId;
using testing::Dots;
using testing::End;
using testing::Entity1;
using ::testing::HasSubstr;
using testing::MakeAuthor;
using testing::Put;
using testing::SetLayer;
using testing::StoreFixture;

TEST(SceneStore, QuotasRefuseWhatGoesBeyondThem) {
  Limits limits;
  limits.max_entities_per_owner = 3;
  limits.max_layers_per_owner = 2;
  StoreFixture f(limits);
  const Author other = MakeAuthor(2, 22);
  f.Commit(other, Put("a", "theirs"), Put("b", "theirs"));  // counts only for them
  CommitResult result = f.Commit(Put("a", "1"), Put("a", "2"), Put("b", "3"), Put("a", "4"),
                                 Put("c", "5"), SetLayer("c", true), Begin("c"), End("c"));
  ASSERT_EQ(result.issues.size(), 4u);
  for (const Issue& issue : result.issues) EXPECT_EQ(issue.reason, Reason::kQuotaExceeded);
  EXPECT_THAT(result.issues[0].message, HasSubstr("max_entities_per_owner is 3"));
  EXPECT_THAT(result.issues[1].message, HasSubstr("max_layers_per_owner, 2"));
  EXPECT_EQ(result.applied_operations, 3u);
  EXPECT_EQ(result.refused_operations, 5u);
  // Replacing costs nothing, and a frame counts without the entities that it replaces.
  EXPECT_EQ(f.Commit(Put("a", "1", 7)).refused_operations, 0u);
  EXPECT_EQ(f.Commit(Begin("a"), Put("a", "8"), Put("a", "9"), End("a")).refused_operations, 0u);
  EXPECT_EQ(f.Commit(Begin("a"), Put("a", "8"), Put("a", "9"), Put("a", "10"), End("a"))
                .refused_operations,
            1u);
  EXPECT_EQ(CheckIndices(*f.store.snapshot()), "");
}

TEST(SceneStore, QuotasOverAllOwnersRefuseTheLastToCome) {
  Limits limits;
  limits.max_entities = 4;
  limits.max_layers = 3;
  limits.max_scene_bytes = 40000;
  StoreFixture f(limits);
  const Author other = MakeAuthor(2, 22);
  EXPECT_EQ(f.Commit(other, Put("a", "1"), Put("b", "2")).refused_operations, 0u);
  CommitResult result =
      f.Commit(Put("a", "3"), Put("a", "4"), Put("a", "5"), Put("c", "6"), SetLayer("d", true));
  ASSERT_EQ(result.issues.size(), 3u);
  for (const Issue& issue : result.issues) EXPECT_EQ(issue.reason, Reason::kQuotaExceeded);
  EXPECT_THAT(result.issues[0].message, HasSubstr("5 entities"));
  EXPECT_THAT(result.issues[0].message, HasSubstr("max_entities, which all owners share, is 4"));
  EXPECT_THAT(result.issues[1].message, HasSubstr("max_layers, 3"));
  EXPECT_THAT(result.issues[2].message, HasSubstr("max_layers, 3"));
  EXPECT_EQ(CheckIndices(*f.store.snapshot()), "");
  // Memory that others release is available.
  f.Commit(other, DeleteAllMine());
  EXPECT_EQ(f.Commit(Put("a", "5"), Put("c", "6")).refused_operations, 0u);
  EXPECT_EQ(f.Commit(other, Put("z", "big", Entity1(Dots(0, 1, 1)))).refused_operations, 1u);
  f.Commit(DeleteAllMine());
  result = f.Commit(other, Put("z", "big", Entity1(Dots(0, 1, 2000))),
                    Put("z", "bigger", Entity1(Dots(0, 1, 2000))));
  ASSERT_EQ(result.issues.size(), 1u);
  EXPECT_THAT(result.issues[0].message,
              HasSubstr("max_scene_bytes, which all owners share, is 40000"));
  EXPECT_EQ(CheckIndices(*f.store.snapshot()), "");
}

TEST(SceneStore, BytesAreCountedAndLimited) {
  Limits limits;
  limits.max_bytes_per_owner = 20000;
  StoreFixture f(limits);
  EXPECT_EQ(f.Commit(Put("a", "big", Entity1(Dots(0, 1, 1000)))).refused_operations, 0u);
  EXPECT_GE(f.Tally().bytes, 12000u);
  CommitResult result = f.Commit(Put("a", "more", Entity1(Dots(0, 1, 1000))));
  ASSERT_EQ(result.issues.size(), 1u);
  EXPECT_EQ(result.issues[0].reason, Reason::kQuotaExceeded);
  EXPECT_THAT(result.issues[0].message, HasSubstr("max_bytes_per_owner is 20000"));
  EXPECT_EQ(f.Commit(Put("a", "big", Entity1(Dots(0, 1, 1200)))).refused_operations, 0u);
  f.Commit(DeleteAllMine());
  EXPECT_EQ(f.Tally(), OwnerTally());
}

// The object "many" draws 4^depth dots.
void DefineMany(StoreFixture& f, int depth) {
  std::string name = "dot";
  f.Commit(Define(name, {{Dots(0, 1, 1), {}}}));
  for (int i = 0; i < depth; ++i) {
    const std::string next = i == depth - 1 ? "many" : "many" + std::to_string(i);
    f.Commit(Define(next, std::vector<ObjectPart>(4, {InstanceRef{name}, {}})));
    name = next;
  }
}

constexpr uint64_t kOfADot =
    kHeldBytesPerDrawable + gpu::kMostDrawableBytes + gpu::HeapBytes(3 * sizeof(int32_t));

TEST(SceneStore, AnInstanceThatDerivesMoreThanThereIsRoomForIsRefused) {
  StoreFixture f{Limits()};
  DefineMany(f, 5);
  const uint64_t needed = 2 * 1024 * kOfADot;  // on two engines
  f.store.SetMemoryRoom({.bytes = needed, .engines = 2});
  const CommitResult result = f.Commit(Put("a", "it", Entity1(InstanceRef{"many"})));
  ASSERT_EQ(result.issues.size(), 1u);
  EXPECT_EQ(result.issues[0].reason, Reason::kQuotaExceeded);
  EXPECT_EQ(result.issues[0].layer, "a");
  EXPECT_EQ(result.issues[0].id, "it");
  EXPECT_THAT(result.issues[0].message, HasSubstr("what 2 engines would derive from it"));
  EXPECT_THAT(result.issues[0].message,
              HasSubstr("max_memory_bytes leaves " + std::to_string(needed)));
  EXPECT_EQ(f.Scene(), "");
  // The entity itself takes memory, too.
  f.store.SetMemoryRoom({.bytes = needed + 4096, .engines = 2});
  EXPECT_EQ(f.Commit(Put("a", "it", Entity1(InstanceRef{"many"}))).refused_operations, 0u);
  EXPECT_EQ(f.Tally().derived, 1024 * kOfADot);
  EXPECT_EQ(CheckIndices(*f.store.snapshot()), "");
}

TEST(SceneStore, AnObjectThatGrowsCountsForEachInstance) {
  StoreFixture f{Limits()};
  DefineMany(f, 2);
  f.Commit(Put("a", "1", Entity1(InstanceRef{"many"})),
           Put("a", "2", Entity1(InstanceRef{"many"})));
  EXPECT_EQ(f.Tally().derived, 2 * 16 * kOfADot);
  f.store.SetMemoryRoom({.bytes = 31 * kOfADot, .engines = 1});
  const Operation twice = Define("dot", {{Dots(0, 1, 1), {}}, {Dots(0, 1, 1), {}}});
  CommitResult result = f.Commit(twice);
  ASSERT_EQ(result.issues.size(), 1u);
  EXPECT_EQ(result.issues[0].reason, Reason::kQuotaExceeded);
  EXPECT_THAT(result.issues[0].message, HasSubstr("max_memory_bytes"));
  f.store.SetMemoryRoom({.bytes = 33 * kOfADot, .engines = 1});
  EXPECT_EQ(f.Commit(twice).refused_operations, 0u);
  EXPECT_EQ(f.Tally().derived, 2 * 32 * kOfADot);
  EXPECT_EQ(CheckIndices(*f.store.snapshot()), "");
}

TEST(SceneStore, WithoutRoomWhatTakesNoMoreIsApplied) {
  StoreFixture f{Limits()};
  f.Commit(Put("a", "big", Entity1(Dots(0, 1, 1000))), Put("a", "small"));
  f.store.SetMemoryRoom({.bytes = 0, .engines = 1});
  EXPECT_EQ(f.Commit(Put("a", "new")).refused_operations, 1u);
  EXPECT_EQ(f.Commit(Put("a", "big", Entity1(Dots(0, 1, 1000)))).refused_operations, 0u)
      << "the same again";
  EXPECT_EQ(f.Commit(DeleteId("a", "big"), Put("a", "new")).refused_operations, 0u)
      << "what the commit itself made room for";
  EXPECT_EQ(f.Scene(), "a: new small");
  EXPECT_EQ(CheckIndices(*f.store.snapshot()), "");
}

TEST(SceneStore, CountsAgainstTheLimitsOfAnEntity) {
  Limits limits;
  limits.max_vertices_per_entity = 10;
  StoreFixture f(limits);
  const CommitResult result =
      f.Commit(Put("a", "x", Entity1(Dots(0, 1, 11))), Put("a", "y", Entity1(Dots(0, 1, 10))));
  ASSERT_EQ(result.issues.size(), 1u);
  EXPECT_THAT(result.issues[0].message, HasSubstr("11 vertices; max_vertices_per_entity is 10"));
  EXPECT_EQ(f.Scene(), "a: y");
}

}  // namespace
}  // namespace voxeld::daemon
