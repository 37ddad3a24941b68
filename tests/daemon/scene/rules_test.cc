// Tests what a scene refuses by itself and by its rules: quotas set by an operator, values that are
// beyond a limit or not finite, and that of several faults the first is reported.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/scene/clip.h"
#include "daemon/scene/quoted.h"
#include "tests/daemon/scene/store_fixture.h"

namespace voxeld::daemon {
namespace rules_test {

using testing::CheckIndices;
using testing::Define;
using testing::DeleteAllMine;
using testing::Dots;
using testing::Entity1;
using ::testing::HasSubstr;
using testing::MakeAuthor;
using testing::Put;
using testing::PutInstance;
using testing::Scale;
using testing::SetClip;
using testing::SetLayer;
using testing::SetRegion;
using testing::StoreFixture;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Returns the one issue of a commit of one operation.
Issue Refused(StoreFixture& f, const Author& author, Operation operation) {
  const std::string before = f.Scene();
  const CommitResult result = f.Commit(author, std::move(operation));
  EXPECT_EQ(result.issues.size(), 1u);
  EXPECT_EQ(result.refused_operations, 1u);
  EXPECT_EQ(f.Scene(), before);
  EXPECT_EQ(CheckIndices(*f.store.snapshot()), "");
  return result.issues.empty() ? Issue() : result.issues[0];
}
Issue Refused(StoreFixture& f, Operation operation) {
  return Refused(f, f.me, std::move(operation));
}

TEST(Rules, AnOperatorsQuotaIsTheOneThatIsNamed) {
  StoreFixture f({.max_entities_per_owner = 5});
  Author few = f.me;
  few.max_entities = 2;
  EXPECT_EQ(f.Commit(few, Put("a", "1"), Put("a", "2")).refused_operations, 0u);
  Issue issue = Refused(f, few, Put("a", "3"));
  EXPECT_EQ(issue.reason, Reason::kQuotaExceeded);
  EXPECT_EQ(issue.message,
            "its owner would have 3 entities (an instance counts as what it draws); what an "
            "operator has set for it is 2");
  EXPECT_EQ(f.Commit(few, Put("a", "2", 5)).refused_operations, 0u) << "in place of another";
  // A quota that is greater than the limit changes nothing.
  Author many = f.me;
  many.max_entities = 100;
  EXPECT_EQ(f.Commit(many, Put("a", "3"), Put("a", "4"), Put("a", "5")).refused_operations, 0u);
  issue = Refused(f, many, Put("a", "6"));
  EXPECT_THAT(issue.message, HasSubstr("max_entities_per_owner is 5"));

  Author small = f.me;
  small.max_bytes = f.Tally().bytes;
  issue = Refused(f, small, Put("a", "5", Entity1(Dots(0, 1, 100))));
  EXPECT_THAT(issue.message,
              HasSubstr(absl::StrCat("what an operator has set for it is ", small.max_bytes)));
  // An empty layer takes some memory, too.
  issue = Refused(f, small, SetLayer("b", true));
  EXPECT_EQ(issue.field, "layer_state.layer");
  EXPECT_EQ(issue.reason, Reason::kQuotaExceeded);
  EXPECT_THAT(issue.message, HasSubstr("its owner would hold "));
  small.max_bytes += Draft::LayerBytes({1, "b"});
  EXPECT_EQ(f.Commit(small, SetLayer("b", true)).refused_operations, 0u) << "to the byte";
  issue = Refused(f, small, Define("o", {{Dots(1), {}}}));
  EXPECT_EQ(issue.field, "define_object.definition");
  EXPECT_EQ(issue.reason, Reason::kQuotaExceeded);
}

TEST(Rules, WhoMayNotEraseDoesNot) {
  StoreFixture f;
  Author meek = f.me;
  meek.may_erase = false;
  LayerState state;
  state.layer = "a";
  state.blend = gpu::BlendMode::kErase;
  const Issue issue = Refused(f, meek, {0, state});
  EXPECT_EQ(issue.reason, Reason::kPermissionDenied);
  EXPECT_EQ(issue.field, "layer_state.blend");
  EXPECT_THAT(issue.message, HasSubstr("takes the scope control"));
  EXPECT_EQ(f.GetLayer("a"), nullptr);
  state.blend = gpu::BlendMode::kAdd;
  EXPECT_EQ(f.Commit(meek, Operation{0, state}).refused_operations, 0u);
  EXPECT_EQ(f.GetLayer("a")->blend, gpu::BlendMode::kAdd);
  state.blend = gpu::BlendMode::kErase;
  EXPECT_EQ(f.Commit(Operation{0, state}).refused_operations, 0u);
  EXPECT_EQ(f.GetLayer("a")->blend, gpu::BlendMode::kErase);
}

TEST(Rules, WhatIsGuardedKeepsItsLayer) {
  StoreFixture f;
  f.Commit(Put("a", "old"), Put("b", "old"));
  const uint64_t guard = f.last_sequence;
  f.Commit(Put("b", "new"));
  Operation all = DeleteAllMine();
  std::get<Delete>(all.op).guard_sequence = guard;
  f.Commit(std::move(all));
  EXPECT_EQ(f.Scene(), "b: new") << "what followed it in its layer";
  EXPECT_EQ(CheckIndices(*f.store.snapshot()), "");
}

TEST(Rules, CountsAreLimitedEach) {
  StoreFixture f({.max_indices_per_entity = 3, .max_parts_per_object = 2, .max_clip_cylinders = 1});
  auto data = std::make_shared<GeometryData>(*Dots(0, 1, 1));
  data->record.kind = gpu::PrimitiveKind::kSegments;
  data->record.index_count = 4;
  data->arrays =
      gpu::GeometryArrays::Of(data->record, std::vector<float>(3), std::vector<uint32_t>(4));
  Issue issue = Refused(f, Put("a", "x", Entity1(GeometryPtr(data))));
  EXPECT_EQ(issue.reason, Reason::kQuotaExceeded);
  EXPECT_EQ(issue.field, "upsert.entity.primitive");
  EXPECT_EQ(issue.message, "4 indices; max_indices_per_entity is 3");

  const auto clip = [](uint32_t cylinders) {
    Operation operation = SetClip("a", {});
    auto made = std::make_shared<Clip>();
    made->cylinders_count = cylinders;
    for (uint32_t i = 0; i < cylinders; ++i) made->cylinders[i] = {{0, 0, 0}, {0, 0, 1}, 1};
    std::get<LayerState>(operation.op).clip = std::move(made);
    return operation;
  };
  EXPECT_EQ(f.Commit(clip(1)).refused_operations, 0u);
  issue = Refused(f, clip(2));
  EXPECT_EQ(issue.field, "layer_state.clip.cylinders");
  EXPECT_EQ(issue.message, "2 cylinders; max_clip_cylinders is 1");

  EXPECT_EQ(f.Commit(Define("o", {{Dots(1), {}}, {Dots(2), {}}})).refused_operations, 0u);
  issue = Refused(f, Define("o", {{Dots(1), {}}, {Dots(2), {}}, {Dots(3), {}}}));
  EXPECT_EQ(issue.field, "define_object.definition.parts");
  EXPECT_EQ(issue.message, "3 parts; max_parts_per_object is 2");
}

TEST(Rules, OfSeveralFaultsTheFirstIsTold) {
  StoreFixture f;
  Issue issue = Refused(f, SetRegion("a", gpu::Region{{1, 1, 1}, {1, 0, -1}}));
  EXPECT_THAT(issue.message, HasSubstr("from 1 to 1 along x"));
  const double nan = std::nan("");
  issue = Refused(f, Define("o", {{Dots(1), Scale(1, nan, 1)}, {Dots(2), Scale(0, 1, 1)}}));
  EXPECT_EQ(issue.field, "define_object.definition.parts[0].transform");
  EXPECT_EQ(issue.reason, Reason::kInvalidValue);
  issue = Refused(f, Define("o", {{Dots(1), {}}, {Dots(2), Scale(0, 1, 1)}}));
  EXPECT_EQ(issue.field, "define_object.definition.parts[1].transform");
  EXPECT_EQ(issue.reason, Reason::kSingularTransform);
}

TEST(Rules, RegionsAndPlanesAreFinite) {
  StoreFixture f;
  EXPECT_EQ(Refused(f, SetRegion("a", gpu::Region{{0, -kInfinity, 0}, {1, 1, 1}})).field,
            "layer_state.region");
  for (const gpu::ClipPlane& bad :
       {gpu::ClipPlane{1, 0, std::nan(""), 0}, gpu::ClipPlane{0, 0, 1, kInfinity}})
    EXPECT_EQ(Refused(f, SetClip("a", {bad})).field, "layer_state.clip.planes[0]");
  for (const gpu::ClipPlane& good :
       {gpu::ClipPlane{1, 0, 0, 0}, gpu::ClipPlane{0, -1, 0, 0}, gpu::ClipPlane{0, 0, 1, 5}})
    EXPECT_EQ(f.Commit(SetClip("a", {good})).refused_operations, 0u);
  Operation box = SetClip("a", {});
  auto clip = std::make_shared<Clip>();
  clip->boxes_count = 1;
  clip->boxes[0] = {{0, 0, 0}, {1, 1, 1}, {}};
  std::get<LayerState>(box.op).clip = clip;
  EXPECT_EQ(f.Commit(std::move(box)).refused_operations, 0u);
  EXPECT_EQ(f.GetLayer("a")->clip.boxes_count, 1u);
}

TEST(Rules, AnObjectStaysFinite) {
  StoreFixture f;
  const Issue issue = Refused(f, Define("o", {{Dots(1e38f), Scale(1e300, 1e-10, 1)}}));
  EXPECT_EQ(issue.reason, Reason::kOutOfRange);
  EXPECT_EQ(
      issue.message,
      "object \"o\" would have a coordinate that is not finite after its transforms; it must be");
}

TEST(Rules, OfAnObjectWithVeryManyInstancesTheFirstAreLookedAt) {
  StoreFixture f({.max_issues_per_commit = 8});
  f.store.SetViews({{"only", Scale(64, 64, 64)}});
  f.Commit(Define("o", {{Dots(1), {}}}));
  constexpr int kInstances = 5000;
  for (int i = 0; i < kInstances; i += 50) {
    std::vector<Operation> puts;
    for (int k = 0; k < 50; ++k) {
      puts.push_back(PutInstance("a", absl::StrCat(i + k), "o"));
      puts.back().sequence = ++f.last_sequence;
    }
    f.CommitAll(f.me, std::move(puts));
  }
  ASSERT_EQ(f.Tally().drawables, static_cast<uint64_t>(kInstances));
  // A curve that is drawn coarser than stated, at any place.
  auto data = std::make_shared<GeometryData>();
  data->record.kind = gpu::PrimitiveKind::kCurves;
  data->record.vertex_count = 4 * 60'000;
  data->arrays = *gpu::GeometryArrays::Allocate(data->record, nullptr);
  const std::span<float> out = data->arrays.writable_positions();
  for (size_t i = 0; i < out.size(); i += 12) {
    constexpr float kSpan[] = {0, 0, 0, 1, 1, 0, 1, -1, 0, 2, 0, 0};
    std::copy(std::begin(kSpan), std::end(kSpan), out.begin() + static_cast<std::ptrdiff_t>(i));
  }
  data->max[0] = 2;
  data->need = gpu::CutNeed::Of(data->record, data->arrays.positions());
  const CommitResult result = f.Commit(Define("o", {{GeometryPtr(data), {}}}));
  EXPECT_EQ(result.refused_operations, 0u);
  const uint64_t told = result.issues.size() + result.more_issues;
  EXPECT_GE(told, 2048u) << "half of those that are looked at, at least";
  EXPECT_LE(told, 4096u) << "and no more";
  EXPECT_EQ(CheckIndices(*f.store.snapshot()), "");
}

TEST(Rules, AViewIsRefusedForTheFirstThatItWouldThrowOut) {
  StoreFixture f(Limits{.max_coordinate_voxels = 100});
  f.Commit(Put("a", "1", 5), Put("a", "2", 7), Put("b", "3", 9));
  const absl::Status status = f.store.CheckNewView({"disp", Scale(50, 1, 1)});
  EXPECT_EQ(status.message(),
            "through this view entity \"1\" of layer \"a\" of owner 1 would reach 250 voxels on "
            "display \"disp\"; it must "
            "stay within ±100");
  EXPECT_TRUE(f.store.CheckNewView({"disp", Scale(100.0 / 9, 1, 1)}).ok()) << "up to the limit";
}

TEST(Quoted, IsCutBetweenCharacters) {
  EXPECT_EQ(Quoted(""), "\"\"");
  const std::string most(64, 'x');
  EXPECT_EQ(Quoted(most), "\"" + most + "\"");
  EXPECT_EQ(Quoted(most + "y"), "\"" + most + "…\"");
  const std::string before(63, 'x');
  EXPECT_EQ(Quoted(before + "ä"), "\"" + before + "…\"") << "whose second byte would be the 65th";
  EXPECT_EQ(Quoted(before.substr(1) + "äz"), "\"" + before.substr(1) + "ä…\"");
  EXPECT_EQ(Quoted(std::string(100, '\x80')), "\"…\"") << "which has no beginning";
  EXPECT_EQ(Quoted("a\nb"), "\"a\\nb\"");
}

TEST(PutClip, KnowsWhatIsNotSound) {
  gpu::LayerRecord record;
  const auto planes = [&](const std::vector<gpu::ClipPlane>& all) {
    Clip clip;
    clip.count = static_cast<uint32_t>(all.size());
    std::copy(all.begin(), all.end(), clip.planes);
    return PutClip(clip, record);
  };
  EXPECT_TRUE(planes({{0, 0, -2, 5}, {0, 3, 0, 0}, {1, 0, 0, 0}}));
  for (int i = 0; i < 4; ++i) {
    for (const double wrong : {kInfinity, std::nan("")}) {
      double n[4] = {1, 1, 1, 1};
      n[i] = wrong;
      EXPECT_FALSE(planes({{n[0], n[1], n[2], n[3]}})) << i << " " << wrong;
    }
  }
  EXPECT_FALSE(planes({{0, 0, 0, 1}}));

  const auto boxes = [&](const std::vector<ClipBox>& all) {
    Clip clip;
    clip.boxes_count = static_cast<uint32_t>(all.size());
    std::copy(all.begin(), all.end(), clip.boxes);
    return PutClip(clip, record);
  };
  const ClipBox good = {{0, 0, 0}, {1, 1, 1}, {}};
  const ClipBox far = {{1.5e308, 0, 0}, {1.7e308, 1, 1}, {}};  // its far side is beyond all numbers
  const ClipBox small = {
      {0, 0, 0}, {1, 1, 1}, Scale(1e-100, 1e-100, 1e-110)};  // its volume is nearly zero
  EXPECT_TRUE(boxes({good, good}));
  EXPECT_FALSE(boxes({far}));
  EXPECT_FALSE(boxes({small}));
  EXPECT_FALSE(boxes({far, good})) << "regardless of what follows";
  EXPECT_FALSE(boxes({good, far}));

  const auto cylinders = [&](const std::vector<ClipCylinder>& all) {
    Clip clip;
    clip.cylinders_count = static_cast<uint32_t>(all.size());
    std::copy(all.begin(), all.end(), clip.cylinders);
    return PutClip(clip, record);
  };
  const ClipCylinder sound = {{0, 0, 0}, {0, 0, 1}, 1};
  const ClipCylinder beyond = {{1.5e308, 1.5e308, 0}, {1.5e308 + 1e300, 1.5e308 + 1e300, 0}, 1};
  EXPECT_TRUE(cylinders({sound, sound}));
  EXPECT_FALSE(cylinders({beyond}));
  EXPECT_FALSE(cylinders({beyond, sound})) << "regardless of what follows";
  EXPECT_FALSE(cylinders({sound, {{0, 0, 0}, {0, 0, 1}, 1e-200}}));
  EXPECT_FALSE(cylinders({{{kInfinity, 0, 0}, {0, 0, 1}, 1}}));
}

}  // namespace rules_test
}  // namespace voxeld::daemon
