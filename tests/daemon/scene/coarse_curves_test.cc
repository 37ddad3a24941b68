// Curves that may be drawn coarser than stated are reported, whichever transform causes it.
#include "daemon/scene/scene_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <memory>
#include <span>

#include "tests/daemon/scene/store_fixture.h"

namespace voxeld::daemon {
namespace {

using testing::Entity1;
using ::testing::HasSubstr;
using testing::Move;
using testing::Put;
using testing::Scale;
using testing::SetLayer;
using testing::Shift;
using testing::StoreFixture;
// Returns that many spans, each of which takes 5 pieces, or 36 if it is 64 times as large.
GeometryPtr Waves(uint32_t count) {
  auto data = std::make_shared<GeometryData>();
  data->record.kind = gpu::PrimitiveKind::kCurves;
  data->record.vertex_count = 4 * count;
  data->arrays = *gpu::GeometryArrays::Allocate(data->record, nullptr);
  const std::span<float> out = data->arrays.writable_positions();
  for (size_t i = 0; i < out.size(); i += 12) {
    constexpr float kSpan[] = {0, 0, 0, 1, 1, 0, 1, -1, 0, 2, 0, 0};
    std::copy(std::begin(kSpan), std::end(kSpan), out.begin() + static_cast<std::ptrdiff_t>(i));
  }
  data->max[0] = 2;
  data->need = gpu::CutNeed::Of(data->record, data->arrays.positions());
  return data;
}

TEST(CoarseCurves, WhatMayBeDrawnCoarserIsToldAndTaken) {
  StoreFixture f;
  f.strict = true;  // it is not a refusal
  f.store.SetViews({{"coarse", Scale(1, 1, 1)}, {"fine", Scale(64, 64, 64)}});
  EXPECT_TRUE(f.Commit(Put("a", "few", Entity1(Waves(1000)))).issues.empty());
  const CommitResult result = f.Commit(Put("a", "many", Entity1(Waves(60'000))));
  EXPECT_TRUE(result.applied);
  EXPECT_EQ(result.refused_operations, 0u);
  EXPECT_NE(f.Get("a", "many"), nullptr);
  ASSERT_EQ(result.issues.size(), 1u);
  const Issue& issue = result.issues[0];
  EXPECT_TRUE(issue.applied);
  EXPECT_EQ(issue.field, "upsert.entity");
  EXPECT_EQ(issue.id, "many");
  EXPECT_EQ(issue.layer, "a");
  EXPECT_EQ(issue.sequence, f.last_sequence);
  EXPECT_THAT(issue.message, HasSubstr("straight pieces on display \"fine\" to be within 0.125 of "
                                       "a voxel; 1048576 are made, so it may be drawn coarser"));
  // When it is smaller, it is fine; when it is larger, it is reported again.
  EXPECT_TRUE(f.Commit(Move("a", "many", Scale(0.1, 0.1, 0.1))).issues.empty());
  const CommitResult moved = f.Commit(Move("a", "many", Scale(1, 2, 1)));
  ASSERT_EQ(moved.issues.size(), 1u);
  EXPECT_TRUE(moved.issues[0].applied);
  EXPECT_EQ(moved.issues[0].field, "set_transform.transform");
  EXPECT_EQ(f.Get("a", "many")->data.transform.m[5], 2);
}

// A patch whose second differences are 6 units.
GeometryPtr Patches(uint32_t count, float bulge) {
  auto data = std::make_shared<GeometryData>();
  data->record.kind = gpu::PrimitiveKind::kPatches;
  data->record.vertex_count = 16 * count;
  data->arrays = *gpu::GeometryArrays::Allocate(data->record, nullptr);
  const std::span<float> out = data->arrays.writable_positions();
  for (size_t i = 0; i < 16u * count; ++i) {
    out[3 * i] = static_cast<float>(i % 4);
    out[3 * i + 1] = static_cast<float>(i / 4 % 4);
    out[3 * i + 2] = i % 16 == 5 ? bulge : 0;
  }
  data->max[0] = data->max[1] = 3;
  data->max[2] = bulge;
  data->need = gpu::CutNeed::Of(data->record, data->arrays.positions());
  return data;
}

TEST(CoarseCurves, PatchesAreToldInVertices) {
  StoreFixture f;
  f.store.SetViews({{"only", Scale(1, 1, 1)}});
  EXPECT_TRUE(f.Commit(Put("a", "few", Entity1(Patches(1000, 1)))).issues.empty());
  const CommitResult many = f.Commit(Put("a", "many", Entity1(Patches(300'000, 1))));
  ASSERT_EQ(many.issues.size(), 1u);
  EXPECT_THAT(many.issues[0].message,
              HasSubstr("vertices on display \"only\" to be within 0.25 of a voxel; 1048576 are "
                        "made, 512 squares along a side, so it may be drawn coarser"));
  EXPECT_EQ(f.Commit(Put("a", "high", Entity1(Patches(1, 900'000)))).issues.size(), 1u);
}

TEST(CoarseCurves, ALayersTransformIsToldOfEachOfItsEntities) {
  StoreFixture f;
  f.store.SetViews({{"only", Scale(1, 1, 1)}});
  EXPECT_TRUE(f.Commit(Put("a", "x", Entity1(Waves(60'000))), Put("a", "y", Entity1(Waves(10))),
                       Put("a", "z", Entity1(Waves(60'000))))
                  .issues.empty());
  const CommitResult moved =
      f.Commit(Operation{0, LayerState{.layer = "a", .transform = Scale(64, 64, 64)}});
  EXPECT_TRUE(moved.applied);
  ASSERT_EQ(moved.issues.size(), 2u);
  EXPECT_EQ(moved.issues[0].id, "x");
  EXPECT_EQ(moved.issues[1].id, "z");
  EXPECT_EQ(moved.issues[0].field, "layer_state.transform");
  EXPECT_TRUE(f.Commit(SetLayer("a", true)).issues.empty());
}

TEST(CoarseCurves, InstancesAndGroupsAreToldOfTheirParts) {
  StoreFixture f;
  f.store.SetViews({{"only", Scale(64, 64, 64)}});
  auto definition = std::make_shared<ObjectData>();
  definition->parts.push_back({Waves(10), Scale(1, 1, 1)});
  EXPECT_TRUE(f.Commit(Operation{0, DefineObject{"o", definition}},
                       Put("a", "i", Entity1(InstanceRef{"o"})))
                  .issues.empty());
  auto more = std::make_shared<ObjectData>(*definition);
  more->parts.push_back({Waves(60'000), Scale(1, 1, 1)});
  const CommitResult defined = f.Commit(Operation{0, DefineObject{"o", more}});
  ASSERT_EQ(defined.issues.size(), 1u);
  EXPECT_EQ(defined.issues[0].layer + "/" + defined.issues[0].id, "a/i");
  EXPECT_EQ(defined.issues[0].field, "define_object.definition");
  EXPECT_THAT(defined.issues[0].message, HasSubstr("a part of it takes up to "));
  EXPECT_EQ(f.Commit(Put("a", "j", Entity1(InstanceRef{"o"}))).issues.size(), 1u);
  auto group = std::make_shared<GroupData>();
  group->parts.push_back({Waves(60'000), Scale(1, 1, 1)});
  EXPECT_EQ(f.Commit(Put("a", "g", Entity1(GroupPtr(group)))).issues.size(), 1u);
}

TEST(CoarseCurves, AreNoRefusalsWhereThereAreTooManyToTell) {
  Limits limits;
  limits.max_issues_per_commit = 2;
  StoreFixture f(limits);
  f.strict = true;
  f.store.SetViews({{"only", Scale(64, 64, 64)}});
  const GeometryPtr many = Waves(60'000);
  const CommitResult taken = f.Commit(Put("a", "1", Entity1(many)), Put("a", "2", Entity1(many)),
                                      Put("a", "3", Entity1(many)));
  EXPECT_TRUE(taken.applied);
  EXPECT_EQ(taken.issues.size(), 2u);
  EXPECT_EQ(taken.more_issues, 1u);
  EXPECT_FALSE(taken.first_refusal.has_value());
  const CommitResult refused = f.Commit(Put("a", "1", Entity1(many)), Put("a", "2", Entity1(many)),
                                        Move("a", "nobody", Shift(1)));
  EXPECT_FALSE(refused.applied);
  EXPECT_EQ(refused.more_issues, 1u);
  ASSERT_TRUE(refused.first_refusal.has_value());
  EXPECT_EQ(refused.first_refusal->id, "nobody");
}

}  // namespace
}  // namespace voxeld::daemon
