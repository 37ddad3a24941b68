// Tests explanations of entities whose voxels were counted by hand.
#include "daemon/explain/explain.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <string>

#include "daemon/explain/stage.h"
#include "tests/daemon/fakes/operations.h"
#include "tests/daemon/scene/store_fixture.h"

namespace voxeld::daemon {
namespace {

using testing::Define;
using testing::Entity1;
using ::testing::HasSubstr;
using testing::Put;
using testing::PutInstance;
using testing::SetLayer;
using testing::SetMask;
using testing::SetRegion;
using testing::Shift;
using testing::StoreFixture;

constexpr int32_t kSide = 16;

// From one corner to the other, in voxels: solid.
EntityData Box(std::array<int, 3> from, std::array<int, 3> to, uint32_t color = 0xFF8000) {
  auto data = std::make_shared<GeometryData>();
  data->record.kind = gpu::PrimitiveKind::kBox;
  data->record.fill = gpu::Fill::kSolid;
  data->record.color = color;
  for (size_t a = 0; a < 3; ++a) {
    data->record.params[a] = static_cast<float>(from[a] + to[a]) / 2;
    data->record.params[3 + a] = static_cast<float>(to[a] - from[a]);
    data->min[a] = from[a];
    data->max[a] = to[a];
  }
  return Entity1(GeometryPtr(std::move(data)));
}
EntityData WithPriority(EntityData data, uint32_t priority) {
  data.priority = priority;
  return data;
}

// 16 voxels a side, each a pixel; the scene's unit is a voxel.
gpu::Target Cube() {
  gpu::Target target;
  target.geometry.grid = {kSide, kSide, kSide, {1, 1, 1}, {-8, -8, -0.5}};
  return VoxelsOf(target);
}

class ExplainTest : public ::testing::Test {
 protected:
  template <typename... Ops>
  void Commit(Ops... ops) {
    const CommitResult result = fixture_.Commit(std::move(ops)...);
    ASSERT_EQ(result.refused_operations, 0u) << result.issues[0].message;
  }

  Explanation Ask(const std::string& id, const std::string& layer = "a") {
    const absl::StatusOr<Explanation> explanation =
        Explain(fixture_.store.snapshot(), {1, layer}, id, target_);
    EXPECT_EQ(explanation.status(), absl::OkStatus());
    return explanation.value_or(Explanation());
  }

  StoreFixture fixture_;
  gpu::Target target_ = Cube();
};

TEST_F(ExplainTest, WhatIsSeen) {
  Commit(Put("a", "x", Box({2, 3, 4}, {6, 7, 8})));
  const Explanation e = Ask("x");
  EXPECT_EQ(e.visibility, Visibility::kSeen);
  EXPECT_EQ(e.covered, 64u);
  EXPECT_EQ(e.lit, 64u);
  EXPECT_EQ(e.left, 64u);
  EXPECT_EQ(e.seen, 64u);
  EXPECT_EQ(e.voxels.min[2], 4);
  EXPECT_EQ(e.voxels.max[2], 8);
  EXPECT_THAT(Describe(e), HasSubstr("64 voxels"));
}

TEST_F(ExplainTest, BehindATurnedViewThatStretches) {
  // x → 2y + 1, y → −x + 12, z → z/2 + 3: the box becomes 8 × 4 × 2 voxels.
  target_.view.m[0] = 0, target_.view.m[1] = 2, target_.view.m[3] = 1;
  target_.view.m[4] = -1, target_.view.m[5] = 0, target_.view.m[7] = 12;
  target_.view.m[10] = 0.5, target_.view.m[11] = 3;
  Commit(Put("a", "x", Box({2, 2, 2}, {6, 6, 6})));
  const Explanation e = Ask("x");
  EXPECT_EQ(e.visibility, Visibility::kSeen);
  EXPECT_EQ(e.covered, 64u);
  EXPECT_EQ(e.voxels.min[0], 5);
  EXPECT_EQ(e.voxels.max[0], 13);
}

TEST_F(ExplainTest, WhatLiesOutside) {
  Commit(Put("a", "x", Box({17, 0, 0}, {20, 4, 4})));
  const Explanation e = Ask("x");
  EXPECT_EQ(e.visibility, Visibility::kOutside);
  EXPECT_EQ(e.covered, 0u);
  EXPECT_THAT(Describe(e), HasSubstr("from (17, 0, 0) to (20, 4, 4)"));
}

TEST_F(ExplainTest, WhatIsPartlyOutside) {
  Commit(Put("a", "x", Box({14, 0, 0}, {20, 4, 4})));
  const Explanation e = Ask("x");
  EXPECT_EQ(e.visibility, Visibility::kSeen);
  EXPECT_EQ(e.covered, 2u * 4 * 4);
}

TEST_F(ExplainTest, WhatHasNothingInIt) {
  Commit(Define("nothing", {}), PutInstance("a", "x", "nothing"));
  EXPECT_EQ(Ask("x").visibility, Visibility::kNothing);
}

TEST_F(ExplainTest, WhatIsBlack) {
  Commit(Put("a", "x", Box({0, 0, 0}, {4, 4, 4}, 0)));
  const Explanation e = Ask("x");
  EXPECT_EQ(e.visibility, Visibility::kBlack);
  EXPECT_EQ(e.covered, 64u);
  EXPECT_EQ(e.lit, 0u);
}

TEST_F(ExplainTest, WhatIsWhiteToo) {
  Commit(Put("a", "x", Box({0, 0, 0}, {4, 4, 4}, 0xFFFFFF)));
  EXPECT_EQ(Ask("x").seen, 64u);
}

TEST_F(ExplainTest, WhatIsClipped) {
  Commit(Put("a", "x", Box({0, 0, 0}, {4, 4, 4})));
  Commit(SetRegion("a", gpu::Region{{0, 0, 0}, {2, 4, 4}}));
  Explanation e = Ask("x");
  EXPECT_EQ(e.visibility, Visibility::kSeen);
  EXPECT_EQ(e.covered, 64u);
  EXPECT_EQ(e.left, 32u);
  EXPECT_EQ(e.seen, 32u);
  Commit(SetRegion("a", gpu::Region{{8, 8, 8}, {12, 12, 12}}));
  e = Ask("x");
  EXPECT_EQ(e.visibility, Visibility::kClipped);
  EXPECT_EQ(e.lit, 64u);
  EXPECT_EQ(e.left, 0u);
}

TEST_F(ExplainTest, WhatIsMasked) {
  Commit(Put("a", "x", Box({0, 0, 0}, {4, 4, 4})), Put("m", "hole", Box({0, 0, 0}, {1, 4, 4})),
         SetMask("a", "m"), SetLayer("m", false));
  Explanation e = Ask("x");
  EXPECT_EQ(e.visibility, Visibility::kSeen);
  EXPECT_EQ(e.left, 16u);
  EXPECT_EQ(e.seen, 16u);
  Commit(Put("m", "hole", Box({8, 8, 8}, {9, 9, 9})));
  EXPECT_EQ(Ask("x").visibility, Visibility::kMasked);
  Commit(SetMask("a", "none there"));
  EXPECT_EQ(Ask("x").visibility, Visibility::kMasked);
  // For the mask itself: its layer is not shown.
  EXPECT_EQ(Ask("hole", "m").visibility, Visibility::kLayerHidden);
}

TEST_F(ExplainTest, WhoseLayerIsHidden) {
  Commit(Put("a", "x", Box({0, 0, 0}, {4, 4, 4})), SetLayer("a", false));
  EXPECT_EQ(Ask("x").visibility, Visibility::kLayerHidden);
  LayerState state;
  state.layer = "a";
  state.visible = true;
  state.opacity = 0;
  Commit(Operation{0, state});
  EXPECT_EQ(Ask("x").visibility, Visibility::kTransparent);
}

TEST_F(ExplainTest, WhoseOwnerIsHidden) {
  Commit(Put("a", "x", Box({0, 0, 0}, {4, 4, 4})));
  fixture_.store.Suppress(1, true);
  EXPECT_EQ(Ask("x").visibility, Visibility::kOwnerHidden);
}

TEST_F(ExplainTest, WhatIsUnderAnEntityOfItsLayer) {
  Commit(Put("a", "x", Box({0, 0, 0}, {4, 4, 4})),
         Put("a", "aside", WithPriority(Box({8, 8, 8}, {12, 12, 12}), 3)),
         Put("a", "half", WithPriority(Box({0, 0, 0}, {2, 4, 4}, 0x0000FF), 1)));
  Explanation e = Ask("x");
  EXPECT_EQ(e.visibility, Visibility::kSeen);
  EXPECT_EQ(e.lit, 64u);
  EXPECT_EQ(e.seen, 32u);
  Commit(Put("a", "lid", WithPriority(Box({0, 0, 0}, {5, 5, 5}, 0x00FF00), 2)));
  e = Ask("x");
  EXPECT_EQ(e.visibility, Visibility::kCovered);
  EXPECT_EQ(e.seen, 0u);
  EXPECT_EQ(e.by_layer.name, "a");
  EXPECT_EQ(e.by_entity, "lid");
  EXPECT_THAT(Describe(e), HasSubstr("\"lid\""));
}

TEST_F(ExplainTest, WhatIsUnderAnotherLayer) {
  Commit(Put("a", "x", Box({0, 0, 0}, {4, 4, 4})),
         Put("below", "b", Box({0, 0, 0}, {8, 8, 8}, 0x808080)),
         Put("c", "other", Box({8, 8, 8}, {12, 12, 12})),
         Put("d", "over", Box({0, 0, 0}, {4, 4, 4}, 0x00FF00)),
         Put("e", "more", Box({0, 0, 0}, {4, 4, 4}, 0x0000FF)));
  LayerState state;
  state.layer = "below";
  state.order = -1;
  Commit(Operation{0, state});
  const Explanation e = Ask("x");
  EXPECT_EQ(e.visibility, Visibility::kCovered);
  EXPECT_EQ(e.by_layer.name, "d");
  EXPECT_EQ(e.by_entity, "");
  EXPECT_THAT(Describe(e), HasSubstr("layer \"d\" of owner 1"));
  EXPECT_EQ(Ask("b", "below").seen, 8u * 8 * 8 - 64);
  EXPECT_EQ(Ask("more", "e").visibility, Visibility::kSeen);
}

TEST_F(ExplainTest, WhatLooksAlike) {
  Commit(Put("a", "x", Box({0, 0, 0}, {4, 4, 4})), Put("a", "twin", Box({0, 0, 0}, {4, 4, 4})));
  const Explanation e = Ask("x");
  EXPECT_EQ(e.visibility, Visibility::kCovered);
  EXPECT_EQ(e.by_entity, "twin");
}

TEST_F(ExplainTest, WhatErases) {
  EntityData eraser = Box({0, 0, 0}, {2, 2, 2});
  eraser.erase = true;
  eraser.priority = 1;
  Commit(Put("a", "x", Box({0, 0, 0}, {4, 4, 4})), Put("a", "rubber", eraser));
  Explanation e = Ask("rubber");
  EXPECT_EQ(e.visibility, Visibility::kErases);
  EXPECT_EQ(e.covered, 8u);
  EXPECT_EQ(e.seen, 8u);
  EXPECT_EQ(Ask("x").seen, 56u);
}

TEST_F(ExplainTest, InstancesAndObjects) {
  Commit(Define("cube", {{Box({0, 0, 0}, {2, 2, 2}).content, {}}}),
         PutInstance("a", "x", "cube", Shift(4, 4, 4)),
         PutInstance("a", "far", "cube", Shift(40, 4, 4)));
  EXPECT_EQ(Ask("x").seen, 8u);
  EXPECT_EQ(Ask("x").voxels.min[0], 4);
  EXPECT_EQ(Ask("far").visibility, Visibility::kOutside);
}

TEST_F(ExplainTest, WhereTheDisplayHasNoLight) {
  // A colour that one bit per channel does not show.
  target_.layout.format = display::PixelFormat::kBitPlanes;
  Commit(Put("a", "x", Box({0, 0, 0}, {4, 4, 4}, 0x010101)),
         Put("a", "bright", Box({8, 8, 8}, {12, 12, 12})));
  const Explanation e = Ask("x");
  EXPECT_EQ(e.visibility, Visibility::kNoLight);
  EXPECT_EQ(e.seen, 64u);
  EXPECT_EQ(Ask("bright").visibility, Visibility::kSeen);
}

TEST_F(ExplainTest, WhereNoPixelLooks) {
  // Slices of only the lower half.
  auto& stack = std::get<display::PlanarStack>(target_.geometry.shape);
  stack.positions_mm.resize(kSide / 2);
  target_.layout.slices = kSide / 2;
  Commit(Put("a", "x", Box({0, 0, 12}, {4, 4, 16})), Put("a", "y", Box({0, 0, 0}, {4, 4, 4})));
  const Explanation e = Ask("x");
  EXPECT_EQ(e.visibility, Visibility::kNoLight);
  EXPECT_EQ(e.seen, 64u);
  EXPECT_EQ(Ask("y").visibility, Visibility::kSeen);
}

TEST_F(ExplainTest, WhatCannotBeAsked) {
  Commit(Put("a", "x", Box({0, 0, 0}, {4, 4, 4})));
  const SnapshotPtr scene = fixture_.store.snapshot();
  EXPECT_EQ(Explain(scene, {1, "a"}, "y", target_).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(Explain(scene, {2, "a"}, "x", target_).status().code(), absl::StatusCode::kNotFound);
  int asked = 0;
  EXPECT_EQ(Explain(scene, {1, "a"}, "x", target_, [&] { return ++asked == 3; }).status().code(),
            absl::StatusCode::kCancelled);
  EXPECT_EQ(asked, 3);
  target_.geometry.grid.nx = 100000;
  target_.geometry.grid.ny = 100000;
  EXPECT_EQ(Explain(scene, {1, "a"}, "x", target_).status().code(),
            absl::StatusCode::kResourceExhausted);
}

}  // namespace
}  // namespace voxeld::daemon
