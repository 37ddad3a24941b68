// Scenes drawn as they were sent: what the engine has of them is what the comparison counts.
#include "daemon/viewer/comparer.h"

#include <gtest/gtest.h>

#include <future>

#include "display/sync/clock.h"
#include "tests/daemon/scene/store_fixture.h"

namespace voxeld::daemon::viewer {
namespace {

using daemon::testing::DeleteId;
using daemon::testing::Put;
using daemon::testing::StoreFixture;

class ComparerTest : public ::testing::Test {
 protected:
  Comparer::Task TaskOf(std::vector<OwnedName> hidden = {}) {
    Comparer::Task task;
    task.display = "main";
    task.grid = {8, 8, 4, {1, 1, 2}, {-4, -4, -4}};
    task.from.scene = scene_.store.snapshot();
    task.from.tone.SetCurve(display::Tone::Linear());
    task.hidden = std::move(hidden);
    task.box = {{-4, -4, -4}, {4, 4, 4}};
    return task;
  }

  absl::StatusOr<Comparison> Run(Comparer::Task task) {
    std::promise<absl::StatusOr<Comparison>> promise;
    task.done = [&](absl::StatusOr<Comparison> c) { promise.set_value(std::move(c)); };
    comparer_.Post(std::move(task));
    return promise.get_future().get();
  }

  sync::SystemClock clock_;
  StoreFixture scene_;
  Comparer comparer_{clock_};
};

TEST_F(ComparerTest, VoxelsAreWhereTheSceneHasThem) {
  scene_.Commit(Put("a", "x", 2), Put("b", "y", 5));
  auto c = Run(TaskOf());
  ASSERT_TRUE(c.ok()) << c.status();
  EXPECT_EQ(c->voxels, 2u);
  EXPECT_EQ(c->missing, 2u) << "nothing is shown";
  ASSERT_EQ(c->sent.size(), 2u);
  // Voxel (2, 0, 0) of cells of 1 by 1 by 2 mm from −4 on; the box is from −4 to 4.
  EXPECT_NEAR(c->sent.x[0] * 8.0 / kPlaceSteps - 4, -1.5, 0.001);
  EXPECT_NEAR(c->sent.y[0] * 8.0 / kPlaceSteps - 4, -3.5, 0.001);
  EXPECT_NEAR(c->sent.z[0] * 8.0 / kPlaceSteps - 4, -3, 0.001);
  EXPECT_EQ(c->sent.rgb[0], 255);

  // The next scene, and the one before again: by what differs.
  const Comparer::Task before = TaskOf();
  scene_.Commit(DeleteId("a", "x"), Put("b", "z", 6), Put("b", "w", 7));
  EXPECT_EQ(Run(TaskOf())->voxels, 3u);
  EXPECT_EQ(Run(before)->voxels, 2u);
}

TEST_F(ComparerTest, LayersThatAreHiddenAreNotDrawn) {
  scene_.Commit(Put("a", "x", 2), Put("b", "y", 5));
  EXPECT_EQ(Run(TaskOf({{scene_.me.owner, "b"}, {7, "none"}}))->voxels, 1u);
  EXPECT_EQ(Run(TaskOf())->voxels, 2u);
  EXPECT_EQ(Run(TaskOf({{scene_.me.owner, "a"}, {scene_.me.owner, "b"}}))->voxels, 0u);
}

TEST_F(ComparerTest, AnotherViewAndAnotherGridAreDrawnAnew) {
  scene_.Commit(Put("a", "x", 2));
  EXPECT_EQ(Run(TaskOf())->voxels, 1u);
  Comparer::Task moved = TaskOf();
  moved.from.scene_to_voxel = daemon::testing::Shift(20);
  EXPECT_EQ(Run(moved)->voxels, 0u) << "it is outside";
  Comparer::Task wide = TaskOf();
  wide.from.scene_to_voxel = daemon::testing::Shift(20);
  wide.grid.nx = 32;
  EXPECT_EQ(Run(wide)->voxels, 1u);
}

TEST_F(ComparerTest, WhatCannotBeComparedSaysWhy) {
  Comparer::Task task = TaskOf();
  task.grid = {4096, 4096, 4096, {1, 1, 1}, {}};
  EXPECT_TRUE(absl::IsInvalidArgument(Run(task).status()));
}

TEST_F(ComparerTest, WhatIsNotBegunIsCancelledAtTheEnd) {
  std::atomic<int> done = 0, cancelled = 0;
  {
    Comparer comparer(clock_);
    for (int i = 0; i < 20; ++i) {
      Comparer::Task task = TaskOf();
      task.done = [&](const absl::StatusOr<Comparison>& c) {
        ++done;
        cancelled += absl::IsCancelled(c.status()) ? 1 : 0;
      };
      comparer.Post(std::move(task));
    }
  }
  EXPECT_EQ(done, 20) << "each has its answer, " << cancelled << " of them that it was cancelled";
}

}  // namespace
}  // namespace voxeld::daemon::viewer
