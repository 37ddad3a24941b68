// Tests the effects of commits on the scene, rule by rule.
#include "daemon/scene/scene_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <iterator>
#include <limits>
#include <span>

#include "tests/daemon/scene/store_fixture.h"

namespace voxeld::daemon {
namespace {

using testing::Begin;
using testing::CheckIndices;
using testing::DeleteAllMine;
using testing::DeleteAllOf;
using testing::DeleteId;
using testing::DeletePrefix;
using testing::Dots;
using ::testing::ElementsAre;
using testing::End;
using testing::Entity1;
using ::testing::HasSubstr;
using testing::MakeAuthor;
using testing::Move;
using testing::Put;
using testing::Scale;
using testing::SetClip;
using testing::SetLayer;
using testing::SetRegion;
using testing::Shift;
using testing::StoreFixture;

TEST(SceneStore, ACommitMakesOneSnapshotAndLeavesTheOldOneAsItWas) {
  StoreFixture f;
  const SnapshotPtr empty = f.store.snapshot();
  EXPECT_EQ(empty->number, 1u);
  EXPECT_TRUE(f.Commit(Put("a", "x"), Put("b", "y")).applied);
  const SnapshotPtr first = f.store.snapshot();
  EXPECT_EQ(first->number, 2u);
  EXPECT_EQ(f.Scene(), "a: x; b: y");
  EXPECT_EQ(f.Commit(DeleteId("a", "x"), Put("a", "z")).applied_operations, 2u);
  EXPECT_EQ(f.Scene(), "a: z; b: y");
  EXPECT_NE(first->FindEntity({1, "a"}, "x"), nullptr);
  EXPECT_EQ(empty->layers.size(), 0u);
  // An untouched layer is the same object.
  EXPECT_EQ(first->FindLayer({1, "b"}), f.GetLayer("b"));
}

TEST(SceneStore, AReplacedEntityKeepsItsNumberAndTakesTheNewSequence) {
  StoreFixture f;
  f.Commit(Put("a", "x", 1));
  const EntityPtr before = f.Get("a", "x");
  f.Commit(Put("a", "x", 2));
  const EntityPtr after = f.Get("a", "x");
  EXPECT_EQ(after->number, before->number);
  EXPECT_EQ(before->sequence, 1u);
  EXPECT_EQ(after->sequence, 2u);
  EXPECT_EQ(f.store.snapshot()->entities, 1u);
}

TEST(SceneStore, SetTransformMovesWhatIsThereAndRefusesWhatIsNot) {
  StoreFixture f;
  f.Commit(Put("a", "x"));
  const EntityPtr before = f.Get("a", "x");
  EXPECT_EQ(f.Commit(Move("a", "x", Shift(3))).refused_operations, 0u);
  EXPECT_EQ(f.Get("a", "x")->data.transform, Shift(3));
  EXPECT_EQ(f.Get("a", "x")->sequence, before->sequence);
  EXPECT_EQ(f.Get("a", "x")->data.content, before->data.content);
  const CommitResult missing = f.Commit(Move("a", "nobody", Shift(3)));
  ASSERT_EQ(missing.issues.size(), 1u);
  EXPECT_EQ(missing.issues[0].reason, Reason::kNotFound);
  EXPECT_EQ(missing.issues[0].field, "set_transform.id");
  EXPECT_EQ(missing.issues[0].id, "nobody");
  EXPECT_EQ(missing.issues[0].sequence, f.last_sequence);
  EXPECT_THAT(missing.issues[0].message, HasSubstr("\"nobody\""));
}

TEST(SceneStore, ARefusedOperationLeavesItsEntityAndTheOthersGoOn) {
  StoreFixture f;
  f.store.SetViews({{"d", gpu::Affine()}});
  f.Commit(Put("a", "x", 5));
  const EntityPtr before = f.Get("a", "x");
  const CommitResult result =
      f.Commit(Put("a", "w"), Put("a", "x", 3e9f), Put("a", "y"), Move("a", "x", Shift(1e30)));
  EXPECT_TRUE(result.applied);
  EXPECT_EQ(result.applied_operations, 2u);
  EXPECT_EQ(result.refused_operations, 2u);
  EXPECT_EQ(f.Get("a", "x"), before);
  EXPECT_EQ(f.Scene(), "a: w x y");
}

TEST(SceneStore, OutOfRangeNamesTheDisplayAndTheValue) {
  StoreFixture f;
  f.store.SetViews({{"near", Scale(1, 1, 1)}, {"far", Scale(1024, 1024, 1024)}});
  f.Commit(Put("a", "x", 5));
  const EntityPtr before = f.Get("a", "x");
  const CommitResult result = f.Commit(Put("a", "x", 2e6f), Put("a", "y", 1e6f));
  ASSERT_EQ(result.issues.size(), 1u);
  EXPECT_EQ(result.issues[0].reason, Reason::kOutOfRange);
  EXPECT_THAT(result.issues[0].message, HasSubstr("2.048e+09 voxels on display \"far\""));
  EXPECT_EQ(f.Get("a", "x"), before);
  EXPECT_NE(f.Get("a", "y"), nullptr);
  EXPECT_EQ(f.Commit(Move("a", "x", Shift(0, -2e6))).issues[0].reason, Reason::kOutOfRange);
  EXPECT_EQ(f.Get("a", "x"), before);
}

TEST(SceneStore, ALayersTransformIsCheckedAgainstAllThatItHolds) {
  StoreFixture f;
  f.store.SetViews({{"d", gpu::Affine()}});
  f.Commit(Put("a", "x", 1000));
  const CommitResult refused = f.Commit(SetLayer("a", false, Scale(1e9, 1, 1)));
  ASSERT_EQ(refused.issues.size(), 1u);
  EXPECT_EQ(refused.issues[0].reason, Reason::kOutOfRange);
  EXPECT_EQ(refused.issues[0].field, "layer_state.transform");
  EXPECT_TRUE(f.GetLayer("a")->visible);  // nothing of it was applied
  // An entity that has since moved away no longer counts.
  f.Commit(Put("a", "x", 0.5f));
  EXPECT_EQ(f.Commit(SetLayer("a", std::nullopt, Scale(1e9, 1, 1))).refused_operations, 0u);
  // And new entities are transformed by it.
  EXPECT_EQ(f.Commit(Put("a", "y", 2)).issues[0].reason, Reason::kOutOfRange);
}

TEST(SceneStore, WhatIsNotFiniteAfterTransformsIsRefusedWithoutAnyDisplay) {
  StoreFixture f;
  f.Commit(SetLayer("a", true, Scale(1e200, 1, 1)));
  const CommitResult result = f.Commit(Put("a", "x", Entity1(Dots(1e30f), Scale(1e100, 1, 1))));
  ASSERT_EQ(result.issues.size(), 1u);
  EXPECT_EQ(result.issues[0].reason, Reason::kOutOfRange);
}

TEST(SceneStore, SingularTransformsAreRefusedOnSight) {
  StoreFixture f;
  const gpu::Affine flat = Scale(1, 0, 1);
  gpu::Affine parallel;  // rank 2, with a determinant that rounding may keep from 0
  const double rows[9] = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9};
  for (int i = 0; i < 9; ++i) parallel.m[i / 3 * 4 + i % 3] = rows[i];
  gpu::Affine nan;
  nan.m[5] = std::numeric_limits<double>::quiet_NaN();
  for (const gpu::Affine& bad : {flat, parallel}) {
    const CommitResult result =
        f.Commit(Put("a", "x", Entity1(Dots(0), bad)), Move("a", "x", bad),
                 SetLayer("a", true, bad), testing::Define("o", {{Dots(0), bad}}));
    ASSERT_EQ(result.issues.size(), 4u);
    for (const Issue& issue : result.issues) EXPECT_EQ(issue.reason, Reason::kSingularTransform);
    EXPECT_EQ(result.issues[0].field, "upsert.entity.transform");
    EXPECT_EQ(result.issues[3].field, "define_object.definition.parts[0].transform");
  }
  EXPECT_EQ(f.Commit(Put("a", "x", Entity1(Dots(0), nan))).issues[0].reason, Reason::kInvalidValue);
  // Stretching and shrinking alone never make a transform singular.
  EXPECT_EQ(f.Commit(Put("a", "x", Entity1(Dots(0), Scale(1e-9, 1e6, 1e-12)))).issues.size(), 0u);
  EXPECT_EQ(f.Scene(), "a: x");
}

TEST(SceneStore, ClipAndRegionStayUntilTheyAreReplacedOrRemoved) {
  StoreFixture f;
  const gpu::ClipPlane floor{0, 0, 1, 0}, wall{1, 0, 0, -2};
  const gpu::Region box{{0, 0, 0}, {1, 2, 3}};
  EXPECT_TRUE(f.Commit(SetClip("a", {floor, wall}), SetRegion("a", box)).applied);
  const SnapshotPtr clipped = f.store.snapshot();
  f.Commit(SetLayer("a", false), Put("a", "x"));
  EXPECT_EQ(f.GetLayer("a")->clip.count, 2u);
  EXPECT_EQ(f.GetLayer("a")->clip.planes[1], wall);
  EXPECT_EQ(f.GetLayer("a")->region, box);
  f.Commit(SetClip("a", {wall}));
  ASSERT_EQ(f.GetLayer("a")->clip.count, 1u);
  EXPECT_EQ(f.GetLayer("a")->clip.planes[0], wall);
  EXPECT_EQ(f.GetLayer("a")->region, box);
  f.Commit(SetClip("a", {}));
  EXPECT_EQ(f.GetLayer("a")->clip, Clip());
  EXPECT_EQ(f.GetLayer("a")->region, box);
  f.Commit(SetRegion("a", std::nullopt));
  EXPECT_EQ(f.GetLayer("a")->region, std::nullopt);
  EXPECT_EQ(clipped->FindLayer({1, "a"})->clip.count, 2u);
  EXPECT_EQ(f.Tally().bytes, f.GetLayer("a")->bytes + Draft::LayerBytes({1, "a"}));
}

TEST(SceneStore, ClipsAndRegionsThatAreNoneAreRefusedOnSight) {
  StoreFixture f({.max_clip_planes = 2});
  const gpu::ClipPlane good{0, 0, 1, 0};
  const double nan = std::nan("");
  f.Commit(SetClip("a", {good, good}), SetRegion("a", gpu::Region{{0, 0, 0}, {1, 1, 1}}));
  const auto refused = [&](Operation operation) {
    const CommitResult result = f.Commit(std::move(operation));
    EXPECT_EQ(result.issues.size(), 1u);
    return result.issues.empty() ? Issue() : result.issues[0];
  };
  Issue issue = refused(SetClip("a", {good, good, good}));
  EXPECT_EQ(issue.reason, Reason::kQuotaExceeded);
  EXPECT_EQ(issue.field, "layer_state.clip.planes");
  EXPECT_EQ(issue.message, "3 planes; max_clip_planes is 2");
  for (const gpu::ClipPlane& bad : {gpu::ClipPlane{0, 0, 0, 1}, gpu::ClipPlane{1, 0, 0, nan},
                                    gpu::ClipPlane{1, nan, 0, 0}, gpu::ClipPlane{HUGE_VAL}}) {
    issue = refused(SetClip("a", {good, bad}));
    EXPECT_EQ(issue.reason, Reason::kInvalidValue);
    EXPECT_EQ(issue.field, "layer_state.clip.planes[1]");
  }
  const auto with = [&](const std::function<void(Clip&)>& change) {
    Operation operation = SetClip("a", {});
    Clip clip;
    change(clip);
    std::get<LayerState>(operation.op).clip = std::make_shared<Clip>(clip);
    return refused(std::move(operation));
  };
  const auto one_cylinder = [](Clip& clip) {
    clip.cylinders_count = 1;
    clip.cylinders[0] = {{0, 0, 0}, {0, 0, 1}, 1e-200};
  };
  EXPECT_EQ(with(one_cylinder).message,
            "a box or a cylinder of it has no inside, or does not stay finite");
  EXPECT_EQ(with([](Clip& clip) {
              clip.boxes_count = 1;
              clip.boxes[0] = {{0, 0, 0}, {1, 1, 1}, {}};
            }).message,
            "6 planes; max_clip_planes is 2");
  for (const gpu::Region& bad :
       {gpu::Region{{0, 0, 1}, {1, 1, 1}}, gpu::Region{{0, 2, 0}, {1, 1, 1}},
        gpu::Region{{nan, 0, 0}, {1, 1, 1}}, gpu::Region{{0, 0, 0}, {1, 1, HUGE_VAL}}}) {
    issue = refused(SetRegion("a", bad));
    EXPECT_EQ(issue.reason, Reason::kInvalidValue);
    EXPECT_EQ(issue.field, "layer_state.region");
  }
  EXPECT_EQ(f.GetLayer("a")->clip.count, 2u);
  EXPECT_EQ(f.GetLayer("a")->region, (gpu::Region{{0, 0, 0}, {1, 1, 1}}));
}

TEST(SceneStore, StrictRefusesTheWholeCommit) {
  StoreFixture f;
  f.Commit(Put("a", "x"));
  const SnapshotPtr before = f.store.snapshot();
  f.strict = true;
  const CommitResult result = f.Commit(Put("a", "y"), Move("a", "nobody", Shift(1)));
  EXPECT_FALSE(result.applied);
  EXPECT_EQ(result.refused_operations, 1u);
  EXPECT_EQ(f.store.snapshot(), before);
  // Also if the operation was refused on arrival.
  EXPECT_FALSE(f.store.Apply(f.me, {}, f.now, true, 1).applied);
  EXPECT_TRUE(f.Commit(Put("a", "y")).applied);
}

TEST(SceneStore, DeletesByIdPrefixLayerAndAllMine) {
  StoreFixture f;
  const Author other = MakeAuthor(2, 22);
  f.Commit(other, Put("a", "theirs"));
  f.Commit(Put("a", "p1"), Put("a", "p2"), Put("a", "q"), Put("b", "r"));
  EXPECT_EQ(f.Scene(), "a: p1 p2 q; b: r; a: theirs");
  EXPECT_EQ(f.Commit(DeleteId("a", "nobody"), DeleteId("nowhere", "x")).refused_operations, 0u);
  f.Commit(DeletePrefix("a", "p"));
  EXPECT_EQ(f.Scene(), "a: q; b: r; a: theirs");
  // A layer's state outlives its contents; deleting all mine removes the layers too.
  f.Commit(SetLayer("a", false), DeleteAllOf("a"));
  EXPECT_EQ(f.Scene(), "a:; b: r; a: theirs");
  EXPECT_FALSE(f.GetLayer("a")->visible);
  f.Commit(DeleteAllMine());
  EXPECT_EQ(f.Scene(), "a: theirs");
  EXPECT_EQ(CheckIndices(*f.store.snapshot()), "");
}

TEST(SceneStore, AGuardKeepsWhatIsNewer) {
  StoreFixture f;
  f.Commit(Put("a", "old"), Put("a", "new"));  // sequences 1, 2
  const CommitResult stale = f.Commit(DeleteId("a", "new", 1));
  ASSERT_EQ(stale.issues.size(), 1u);
  EXPECT_EQ(stale.issues[0].reason, Reason::kStaleSequence);
  EXPECT_EQ(f.Commit(DeletePrefix("a", "", 1)).refused_operations, 0u);
  EXPECT_EQ(f.Scene(), "a: new");
  f.Commit(DeleteAllOf("a", 1));
  EXPECT_EQ(f.Scene(), "a: new");
  f.Commit(DeleteId("a", "new", 2));
  EXPECT_EQ(f.Scene(), "a:");
}

TEST(SceneStore, AFrameReplacesItsLayerWhole) {
  StoreFixture f;
  f.Commit(Put("a", "kept"), Put("a", "gone"), Put("b", "other"), SetLayer("a", false));
  const uint64_t number = f.Get("a", "kept")->number;
  const uint64_t layer = f.GetLayer("a")->number;
  const CommitResult result =
      f.Commit(Begin("a"), Put("a", "new"), Put("b", "between"), Put("a", "kept", 9),
               Put("a", "brief"), DeleteId("a", "brief"), End("a"));
  EXPECT_EQ(result.applied_operations, 7u);
  EXPECT_EQ(f.Scene(), "a: kept new; b: between other");
  EXPECT_EQ(f.Get("a", "kept")->number, number);
  EXPECT_EQ(f.GetLayer("a")->number, layer);
  EXPECT_FALSE(f.GetLayer("a")->visible);
  f.Commit(Begin("a"), End("a"));
  EXPECT_EQ(f.Scene(), "a:; b: between other");
  EXPECT_EQ(CheckIndices(*f.store.snapshot()), "");
}

TEST(SceneStore, AFrameWithoutItsEndLeavesTheLayerUntouched) {
  StoreFixture f;
  f.Commit(Put("a", "x"));
  const LayerPtr before = *f.store.snapshot()->layers.Find({1, "a"});
  const CommitResult result =
      f.Commit(Begin("a"), Put("a", "y"), Put("a", "z"), Put("b", "w"), Begin("new"));
  EXPECT_TRUE(result.applied);
  EXPECT_EQ(f.Scene(), "a: x; b: w");
  EXPECT_EQ(*f.store.snapshot()->layers.Find({1, "a"}), before);
  ASSERT_EQ(result.issues.size(), 2u);
  EXPECT_EQ(result.issues[0].reason, Reason::kOutOfOrder);
  EXPECT_EQ(result.issues[0].sequence, 2u);  // of the FrameBegin
  EXPECT_THAT(result.issues[0].message, HasSubstr("2 operations are discarded"));
  EXPECT_EQ(result.refused_operations, 3u + 1u);
  // It does not stay open.
  EXPECT_EQ(f.Commit(End("a")).issues[0].reason, Reason::kOutOfOrder);
}

TEST(SceneStore, FramesDoNotNest) {
  StoreFixture f;
  const CommitResult result =
      f.Commit(Begin("a"), Put("a", "x"), Begin("a"), Put("a", "y"), End("a"));
  ASSERT_EQ(result.issues.size(), 1u);
  EXPECT_EQ(result.issues[0].reason, Reason::kOutOfOrder);
  EXPECT_EQ(f.Scene(), "a: x y");
}

TEST(SceneStore, LifetimesEndInOrderOfTime) {
  StoreFixture f;
  const auto lasting = [&](int64_t lifetime) {
    EntityData data = Entity1(Dots(0));
    data.lifetime_ns = lifetime;
    return data;
  };
  f.Commit(Put("a", "stays"), Put("a", "second", lasting(20)), Put("a", "first", lasting(10)),
           Put("b", "also first", lasting(10)), Put("a", "ever", lasting(INT64_MAX)));
  EXPECT_EQ(f.store.next_expiry(), f.now + 10);
  const uint64_t number = f.store.snapshot()->number;
  EXPECT_FALSE(f.store.Expire(f.now + 9));
  EXPECT_TRUE(f.store.Expire(f.now + 10));
  EXPECT_EQ(f.Scene(), "a: ever second stays; b:");
  EXPECT_EQ(f.store.snapshot()->number, number + 1);
  // Replacing restarts the lifetime, moving does not, removing ends it.
  f.now += 15;
  f.Commit(Put("a", "second", lasting(20)), Put("a", "third", lasting(50)));
  f.Commit(Move("a", "third", Shift(1)));
  EXPECT_FALSE(f.store.Expire(f.now + 19));
  f.Commit(DeleteId("a", "third"));
  EXPECT_TRUE(f.store.Expire(f.now + 100));
  EXPECT_EQ(f.Scene(), "a: ever stays; b:");
  EXPECT_EQ(f.store.next_expiry(), sync::kNever);
  // One snapshot for each moment.
  f.Commit(Put("a", "x", lasting(1)), Put("a", "y", lasting(2)), Put("a", "z", lasting(2)));
  const uint64_t before = f.store.snapshot()->number;
  EXPECT_TRUE(f.store.Expire(f.now + 5));
  EXPECT_EQ(f.store.snapshot()->number, before + 2);
}

TEST(SceneStore, AViewIsCheckedAgainstWhatIsThere) {
  Limits limits;
  limits.max_coordinate_voxels = 100;
  StoreFixture f(limits);
  f.Commit(Put("a", "near"), Put("a", "far", Entity1(Dots(3, 1, 1))), SetLayer("a", true));
  DisplayView view{"disp", gpu::Affine()};
  EXPECT_TRUE(f.store.CheckNewView(view).ok());
  for (int axis = 0; axis < 3; ++axis) view.scene_to_voxel.m[axis * 5] = 1000;
  const absl::Status wrong = f.store.CheckNewView(view);
  EXPECT_EQ(wrong.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(wrong.message(), HasSubstr("layer \"a\" of owner 1"));
  EXPECT_THAT(wrong.message(), HasSubstr("must stay within ±100"));
  // The bounds of a layer stay wide when an entity in it is removed; that refuses nothing.
  f.Commit(DeleteId("a", "far"));
  EXPECT_TRUE(f.store.CheckNewView(view).ok());
}

TEST(SceneStore, HiddenMeansThatEveryOperationWasInAHiddenLayer) {
  StoreFixture f;
  EXPECT_FALSE(f.Commit(Put("a", "x"), SetLayer("h", false)).hidden);
  EXPECT_TRUE(f.Commit(Put("h", "x")).hidden);
  EXPECT_TRUE(f.Commit(Put("h", "x"), SetLayer("new", false), Put("new", "x")).hidden);
  EXPECT_FALSE(f.Commit(Put("h", "x"), Put("a", "x")).hidden);
  EXPECT_FALSE(f.Commit(SetLayer("a", false)).hidden);  // that is visible
  EXPECT_TRUE(f.Commit(DeleteAllOf("a")).hidden);
  EXPECT_FALSE(f.Commit(SetLayer("a", true)).hidden);
  EXPECT_FALSE(f.Commit(SetLayer("h", true), SetLayer("a", true)).hidden);
  EXPECT_FALSE(f.Commit().hidden);
  f.Commit(SetLayer("a", false));
  EXPECT_FALSE(f.Commit(testing::Define("o", {})).hidden);
  EXPECT_TRUE(f.Commit(Begin("a"), Put("a", "y"), End("a")).hidden);
  // A refused operation does not count.
  EXPECT_TRUE(f.Commit(Put("a", "y"), Move("b", "nobody", Shift(1))).hidden);
}

TEST(SceneStore, LayersAreRemovedByWhoWroteThemLast) {
  StoreFixture f;
  const Author again = MakeAuthor(1, 12);  // another session of the same owner
  f.Commit(Put("a", "x"), Put("b", "y"));
  f.Commit(again, Put("b", "z"));
  const auto mine = [](const OwnedName&, const Layer& layer) {
    return layer.writer->session == 11;
  };
  const SceneStore::Removed removed = f.store.RemoveLayers(mine, false);
  EXPECT_EQ(removed.entities, 1u);
  EXPECT_EQ(removed.layers, 1u);
  EXPECT_THAT(removed.owners, ElementsAre(1u));
  EXPECT_EQ(f.Scene(), "b: y z");
  const uint64_t number = f.store.snapshot()->number;
  f.store.RemoveLayers(mine, false);
  EXPECT_EQ(f.store.snapshot()->number, number);  // nothing to do, no snapshot
}

TEST(SceneStore, OnceAbandonedItAppliesNothing) {
  StoreFixture f;
  f.Commit(Put("a", "x"));
  f.store.Abandon();
  const CommitResult result = f.Commit(Put("a", "y"));
  EXPECT_FALSE(result.applied);
  EXPECT_TRUE(result.abandoned);
  EXPECT_EQ(f.Scene(), "a: x");
}

TEST(SceneStore, OfManyIssuesTheFirstAreKept) {
  Limits limits;
  limits.max_issues_per_commit = 2;
  StoreFixture f(limits);
  const CommitResult result =
      f.Commit(Begin("b"), Move("a", "1", Shift(1)), Move("a", "2", Shift(1)),
               Move("a", "3", Shift(1)), Put("a", "x"));
  EXPECT_EQ(result.issues.size(), 2u);
  EXPECT_EQ(result.more_issues, 2u) << "a third move, and the unfinished frame";
  EXPECT_EQ(result.refused_operations, 4u);
  EXPECT_EQ(f.Scene(), "a: x");
}

TEST(SceneStore, TenThousandEntitiesWithOneBad) {
  StoreFixture f;
  f.store.SetViews({{"d", gpu::Affine()}});
  std::vector<Operation> all;
  for (int i = 0; i < 10000; ++i) {
    all.push_back(Put("a", std::to_string(i), i == 4321 ? 3e9f : 1.0f));
    all.back().sequence = 1 + i;
  }
  const CommitResult result = f.CommitAll(f.me, std::move(all));
  ASSERT_EQ(result.issues.size(), 1u);
  EXPECT_EQ(result.issues[0].id, "4321");
  EXPECT_EQ(result.issues[0].sequence, 4322u);
  EXPECT_EQ(result.applied_operations, 9999u);
  EXPECT_EQ(f.store.snapshot()->entities, 9999u);
  EXPECT_EQ(f.Get("a", "4321"), nullptr);
  EXPECT_NE(f.Get("a", "4322"), nullptr);
}

}  // namespace
}  // namespace voxeld::daemon
