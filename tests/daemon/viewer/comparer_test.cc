// Tests scenes drawn as they were sent: what the engine has drawn is what the comparison counts.
#include "daemon/viewer/comparer.h"

#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <memory>
#include <optional>
#include <thread>

#include "display/sync/clock.h"
#include "display/sync/fake_clock.h"
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
    task.info = InfoOf({8, 8, 4, {1, 1, 2}, {-4, -4, -4}});
    task.shown.volume.layout = task.info->layout;
    task.shown.volume.pictures.assign(
        4, std::make_shared<std::vector<std::byte>>(task.info->layout.bytes_per_slice()));
    task.shown.from.scene = scene_.store.snapshot();
    task.shown.from.tone.SetCurve(display::Tone::Linear());
    task.hidden = std::move(hidden);
    return task;
  }

  // Four dark planes of 8 by 8, whatever the grid.
  static std::shared_ptr<const display::DisplayInfo> InfoOf(const display::VoxelGrid& grid) {
    auto info = std::make_shared<display::DisplayInfo>();
    display::PlanarStack stack;
    stack.width_px = 8, stack.height_px = 8;
    stack.positions_mm = {-3, -1, 1, 3};
    info->geometry = {.shape = stack, .grid = grid};
    info->layout = {.slices = 4, .width = 8, .height = 8};
    return info;
  }

  absl::StatusOr<Comparison> Run(Comparer::Task task) {
    std::promise<absl::StatusOr<Comparison>> promise;
    task.done = [&](absl::StatusOr<Comparison> c) { promise.set_value(std::move(c)); };
    comparer_.Post(std::move(task));
    return promise.get_future().get();
  }

  sync::SystemClock clock_;
  StoreFixture scene_;
  Comparer comparer_{clock_, nullptr};
};

TEST_F(ComparerTest, VoxelsAreWhereTheSceneHasThem) {
  scene_.Commit(Put("a", "x", 2), Put("b", "y", 5));
  auto c = Run(TaskOf());
  ASSERT_TRUE(c.ok()) << c.status();
  EXPECT_EQ(c->voxels, 2u);
  EXPECT_EQ(c->missing, 2u) << "nothing is shown";
  ASSERT_EQ(c->sent.size(), 2u);
  // Voxel (2, 0, 0) of cells of 1 by 1 by 2 mm from −4 on; the box surrounds their centres.
  EXPECT_NEAR(c->sent.x[0] * 7.0 / kPlaceSteps - 3.5, -1.5, 0.001);
  EXPECT_NEAR(c->sent.y[0] * 7.0 / kPlaceSteps - 3.5, -3.5, 0.001);
  EXPECT_NEAR(c->sent.z[0] * 6.0 / kPlaceSteps - 3, -3, 0.001);
  EXPECT_EQ(c->sent.rgb[0], 255);

  // The next scene, and then the previous one again: only the differences are applied.
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
  moved.shown.from.scene_to_voxel = daemon::testing::Shift(20);
  EXPECT_EQ(Run(moved)->voxels, 0u) << "it is outside";
  Comparer::Task wide = TaskOf();
  wide.shown.from.scene_to_voxel = daemon::testing::Shift(20);
  wide.info = InfoOf({32, 8, 4, {1, 1, 2}, {-4, -4, -4}});
  EXPECT_EQ(Run(wide)->voxels, 1u);
}

TEST_F(ComparerTest, WhatCannotBeComparedSaysWhy) {
  Comparer::Task task = TaskOf();
  task.info = InfoOf({4096, 4096, 4096, {1, 1, 1}, {}});
  EXPECT_TRUE(absl::IsInvalidArgument(Run(task).status()));
}

TEST_F(ComparerTest, WhatIsShownIsHeldAgainstIt) {
  scene_.Commit(Put("a", "x", 2));
  Comparer::Task task = TaskOf();
  std::vector<std::byte> first(task.info->layout.bytes_per_slice());
  for (size_t i = 0; i < 3; ++i) first[2 * 3 + i] = std::byte{255};  // the pixel of that voxel
  task.shown.volume.pictures[0] = std::make_shared<std::vector<std::byte>>(first);
  const auto c = Run(std::move(task));
  ASSERT_TRUE(c.ok()) << c.status();
  EXPECT_EQ(c->pixels, 1u);
  EXPECT_EQ(c->missing + c->stray + c->off, 0u);
}

TEST_F(ComparerTest, WithoutRoomInTheBudgetItIsRefusedAndNothingStaysCharged) {
  const auto small = std::make_shared<Budget>(1000);
  const auto large = std::make_shared<Budget>(1 << 30);
  for (const auto& [budget, fits] : {std::pair(small, false), {large, true}}) {
    Comparer comparer(clock_, budget);
    std::promise<absl::Status> promise;
    Comparer::Task task = TaskOf();
    task.done = [&](const absl::StatusOr<Comparison>& c) { promise.set_value(c.status()); };
    comparer.Post(std::move(task));
    const absl::Status status = promise.get_future().get();
    EXPECT_EQ(status.ok(), fits) << status;
    EXPECT_EQ(budget->used_bytes(), 0u);
  }
}

TEST_F(ComparerTest, ASceneThatNobodyAsksForAnyMoreIsLetGo) {
  sync::FakeClock clock;
  Comparer comparer(clock, nullptr);
  const auto idle = [&clock] {
    while (clock.waiters() == 0) std::this_thread::yield();
  };
  scene_.Commit(Put("a", "x", 2));
  std::weak_ptr<const Layer> layer;
  scene_.store.snapshot()->layers.ForEach(
      [&](const OwnedName&, const LayerPtr& each) { layer = each; });
  std::promise<bool> promise;
  Comparer::Task task = TaskOf();
  task.done = [&](const absl::StatusOr<Comparison>& c) { promise.set_value(c.ok()); };
  comparer.Post(std::move(task));
  EXPECT_TRUE(promise.get_future().get());
  scene_.Commit(DeleteId("a", "x"));  // from now on only the comparer holds it
  idle();
  clock.Advance(Comparer::kLinger - 1);
  idle();
  EXPECT_FALSE(layer.expired());
  clock.Advance(1);
  while (!layer.expired()) std::this_thread::yield();
}

TEST_F(ComparerTest, OneMoreThanMayWaitIsRefusedAndThoseThatWaitAreCancelledAtTheEnd) {
  std::promise<void> first_is_done, go_on;
  std::atomic<int> refused = 0, cancelled = 0, done = 0;
  std::optional<Comparer> comparer(std::in_place, clock_, nullptr);
  Comparer::Task first = TaskOf();
  first.done = [&](const absl::StatusOr<Comparison>&) {
    first_is_done.set_value();
    go_on.get_future().wait();  // the thread is blocked here, and no other task is started
  };
  comparer->Post(std::move(first));
  first_is_done.get_future().wait();
  for (size_t i = 0; i < Comparer::kMostTasks + 3; ++i) {
    Comparer::Task task = TaskOf();
    task.done = [&](const absl::StatusOr<Comparison>& c) {
      ++done;
      refused += absl::IsResourceExhausted(c.status()) ? 1 : 0;
      cancelled += absl::IsCancelled(c.status()) ? 1 : 0;
    };
    comparer->Post(std::move(task));
  }
  EXPECT_EQ(refused, 3);
  std::thread ends([&] { comparer.reset(); });
  go_on.set_value();
  ends.join();
  EXPECT_EQ(done, static_cast<int>(Comparer::kMostTasks) + 3);
  EXPECT_LE(cancelled, static_cast<int>(Comparer::kMostTasks));
}

}  // namespace
}  // namespace voxeld::daemon::viewer
