// Tests notifications of newer snapshots: SceneWatch alone, and from a core.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "daemon/core/scene_watch.h"
#include "tests/daemon/fakes/simulation.h"

namespace voxeld::daemon {
namespace {

using testing::Put;
using testing::Simulation;

SnapshotPtr Numbered(uint64_t number) {
  Snapshot snapshot;
  snapshot.number = number;
  return std::make_shared<const Snapshot>(std::move(snapshot));
}

TEST(SceneWatch, CallsOnceWhenThereIsMore) {
  SceneWatch watch(Numbered(1));
  int calls = 0;
  watch.Await(0, [&] { ++calls; });
  EXPECT_EQ(calls, 1);  // existed already
  watch.Await(1, [&] { ++calls; });
  watch.Await(1, [&] { ++calls; });
  EXPECT_EQ(calls, 1);
  watch.Publish(Numbered(2));
  EXPECT_EQ(calls, 3);
  EXPECT_EQ(watch.newest()->number, 2u);
  watch.Publish(Numbered(3));
  EXPECT_EQ(calls, 3);
}

TEST(SceneWatch, MayBeAskedAgainFromTheCall) {
  SceneWatch watch(Numbered(1));
  std::vector<uint64_t> seen;
  std::function<void()> newer = [&] {
    seen.push_back(watch.newest()->number);
    watch.Await(seen.back(), newer);
  };
  watch.Await(1, newer);
  for (uint64_t n = 2; n < 6; ++n) watch.Publish(Numbered(n));
  EXPECT_THAT(seen, ::testing::ElementsAre(2, 3, 4, 5));
}

TEST(SceneWatch, CancelledCallsDoNotCome) {
  SceneWatch watch(Numbered(1));
  int kept = 0, cancelled = 0;
  const auto alive = std::make_shared<int>();
  watch.Await(1, [&] { ++kept; });
  const SnapshotWaitId id = watch.Await(1, [&cancelled, alive] { ++cancelled; });
  EXPECT_EQ(alive.use_count(), 2);
  watch.Cancel(id);
  watch.Cancel(id);
  EXPECT_EQ(alive.use_count(), 1);
  watch.Publish(Numbered(2));
  EXPECT_EQ(kept, 1);
  EXPECT_EQ(cancelled, 0);
}

TEST(SceneWatch, KeepsTheNewestOnly) {
  SceneWatch watch(Numbered(1));
  const std::weak_ptr<const Snapshot> first = watch.newest();
  watch.Publish(Numbered(2));
  EXPECT_TRUE(first.expired());
}

// A waiter does not miss the end, whichever thread it asks from: every one sees the last number.
TEST(SceneWatch, ServesManyThreads) {
  constexpr uint64_t kLast = 2000;
  SceneWatch watch(Numbered(1));
  std::vector<std::thread> threads;
  for (int t = 0; t < 3; ++t) {
    threads.emplace_back([&watch] {
      sync::Mutex mutex;
      sync::CondVar changed;
      uint64_t seen = 0;
      while (seen < kLast) {
        bool told = false;
        const SnapshotWaitId dropped = watch.Await(seen, [] {});
        watch.Await(seen, [&] {
          sync::MutexLock lock(mutex);
          told = true;
          changed.NotifyAll();
        });
        watch.Cancel(dropped);
        sync::MutexLock lock(mutex);
        while (!told) changed.Wait(mutex);
        const uint64_t now = watch.newest()->number;
        EXPECT_GT(now, seen);
        seen = now;
      }
    });
  }
  for (uint64_t n = 2; n <= kLast; ++n) watch.Publish(Numbered(n));
  for (std::thread& thread : threads) thread.join();
}

// Watchers are notified of every change of the scene.
TEST(CoreWatch, EveryNewSnapshotIsTold) {
  Simulation sim;
  sim.Start();
  SceneWatch& watch = sim.core->scene_watch();
  EXPECT_EQ(watch.newest()->number, 1u);
  std::vector<uint64_t> told;
  std::function<void()> newer = [&] {
    told.push_back(watch.newest()->number);
    watch.Await(told.back(), newer);
  };
  watch.Await(1, newer);
  OpenOptions keep;
  keep.on_disconnect = DisconnectPolicy::kKeep;
  auto client = sim.Open(keep);
  auto other = sim.Open();
  EXPECT_EQ(told.size(), 0u);
  Operation put = Put("a", "x");
  std::get<Upsert>(put.op).entity.lifetime_ns = 5;
  sim.Send(client, 1, put, Put("b", "y"));
  EXPECT_EQ(told.size(), 1u);
  sim.Advance(5);  // x is removed
  EXPECT_EQ(told.size(), 2u);
  sim.Send(other, 1, Put("c", "z"));
  EXPECT_EQ(told.size(), 3u);
  sim.Close(other);  // c is removed
  EXPECT_EQ(told.size(), 4u);
  EXPECT_FALSE(watch.newest()->FindLayer({client.info.owner, "b"})->writer->ended);
  sim.Close(client);  // its layers are orphaned
  EXPECT_EQ(told.size(), 5u);
  EXPECT_TRUE(watch.newest()->FindLayer({client.info.owner, "b"})->writer->ended);
  sim.core->ClearLayer(0, "", false, {}, [](absl::StatusOr<Cleared>) {});
  sim.core->Step();
  EXPECT_EQ(told.size(), 6u);
  EXPECT_EQ(watch.newest()->layers.size(), 0u);
}

}  // namespace
}  // namespace voxeld::daemon
