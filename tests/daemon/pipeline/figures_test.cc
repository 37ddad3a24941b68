// Tests sliding windows, the pool of buffers, and the loop.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "daemon/pipeline/frame_pool.h"
#include "daemon/pipeline/loop.h"
#include "daemon/pipeline/sliding_window.h"
#include "display/sync/fake_clock.h"

namespace voxeld::daemon {
namespace {

TEST(SlidingLatency, QuantilesAreOfTheNearestRank) {
  SlidingLatency window;
  EXPECT_EQ(window.Summary(0).count, 0u);
  for (int i = 200; i >= 1; --i) window.Add(1000, i);
  const LatencyStats stats = window.Summary(1000);
  EXPECT_EQ(stats.count, 200u);
  EXPECT_EQ(stats.p50_ns, 100);
  EXPECT_EQ(stats.p99_ns, 198);
  EXPECT_EQ(stats.max_ns, 200);
  SlidingLatency one;
  one.Add(0, 7);
  EXPECT_EQ(one.Summary(0).p50_ns, 7);
  EXPECT_EQ(one.Summary(0).p99_ns, 7);
}

TEST(SlidingLatency, ForgetsAfterTenSecondsAndBeyond4096) {
  SlidingLatency window;
  window.Add(0, 1000);
  window.Add(sync::kSecond, 5);
  EXPECT_EQ(window.Summary(10 * sync::kSecond - 1).max_ns, 1000);
  EXPECT_EQ(window.Summary(10 * sync::kSecond).max_ns, 5);
  EXPECT_EQ(window.Summary(11 * sync::kSecond).count, 0u);
  for (int i = 0; i < 5000; ++i) window.Add(2 * sync::kSecond, i);
  EXPECT_EQ(window.Summary(2 * sync::kSecond).count, 4096u);
  EXPECT_EQ(window.Summary(2 * sync::kSecond).p50_ns, 5000 - 4096 + 2047);
}

TEST(SlidingRate, IsOverTwoSeconds) {
  SlidingRate rate;
  EXPECT_EQ(rate.PerSecond(0), 0);
  for (int i = 0; i < 90; ++i) rate.Add(i * sync::kSecond / 30);
  EXPECT_NEAR(rate.PerSecond(3 * sync::kSecond), 30, 0.6);
  EXPECT_EQ(rate.PerSecond(6 * sync::kSecond), 0);
}

display::FrameLayout Layout() { return {2, 4, 4, 1, display::PixelFormat::kRgb332}; }

TEST(FramePool, GivesBackTheBufferFilledLast) {
  FramePool pool(Layout());
  FramePool::Lease a = pool.Acquire(), b = pool.Acquire(), c = pool.Acquire();
  EXPECT_EQ(a.holds, 0u);
  EXPECT_EQ(a.frame->bytes.size(), 32u);
  EXPECT_EQ(a.frame->changed_in.size(), 2u);
  const display::SliceFrame* newest = b.frame.get();
  a.frame->volume = 4;
  b.frame->volume = 6;  // c was never filled
  a = b = c = {};
  FramePool::Lease next = pool.Acquire();
  EXPECT_EQ(next.frame.get(), newest);
  EXPECT_EQ(next.holds, 6u);
  EXPECT_EQ(next.frame->volume, 0u);
  EXPECT_EQ(pool.Acquire().holds, 4u);
}

TEST(FramePool, ForgetsWhatAnEngineThatIsGoneFilled) {
  FramePool pool(Layout());
  pool.Acquire().frame->volume = 5;
  pool.Forget(5);
  FramePool::Lease lease = pool.Acquire();
  EXPECT_EQ(lease.holds, 0u);
  lease.frame->volume = 6;
  lease = {};
  EXPECT_EQ(pool.Acquire().holds, 6u);
}

TEST(FramePool, FramesMayOutliveItAndEndAnywhere) {
  auto pool = std::make_unique<FramePool>(Layout());
  FramePool::Lease kept = pool->Acquire();
  std::thread other([frame = pool->Acquire().frame]() mutable { frame = nullptr; });
  pool->Acquire();
  other.join();
  pool = nullptr;
  kept.frame->bytes[0] = std::byte{1};
  kept = {};
}

TEST(Loop, RunsInOrderAndWakesAWaiter) {
  sync::SystemClock clock;
  Loop loop(clock);
  std::string order;
  EXPECT_FALSE(loop.RunPosted());
  loop.Post([&] {
    order += "a";
    loop.Post([&] { order += "c"; });
  });
  loop.Post([&] { order += "b"; });
  EXPECT_TRUE(loop.RunPosted());
  EXPECT_EQ(order, "ab");
  EXPECT_TRUE(loop.RunPosted());
  EXPECT_EQ(order, "abc");
  loop.Wake();
  loop.Wait(sync::kNever);  // returns at once
  loop.RunPosted();
  std::thread other([&] { loop.Post([&] { order += "d"; }); });
  loop.Wait(sync::kNever);
  loop.RunPosted();
  other.join();
  EXPECT_EQ(order, "abcd");
  loop.Post([&] { order += "e"; });
  loop.Close();
  EXPECT_FALSE(loop.Post([&] { order += "f"; }));
  EXPECT_TRUE(loop.RunPosted());
  EXPECT_EQ(order, "abcde");
  loop.Wait(sync::kNever);
}

TEST(Loop, WaitsUntilTheDeadline) {
  sync::FakeClock clock(100);
  Loop loop(clock);
  loop.Wait(100);  // due already
  std::thread other([&] {
    while (clock.waiters() == 0) std::this_thread::yield();
    clock.AdvanceTo(200);
  });
  loop.Wait(200);
  other.join();
  EXPECT_EQ(clock.Now(), 200);
}

}  // namespace
}  // namespace voxeld::daemon
