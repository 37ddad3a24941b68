#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <fstream>
#include <memory>
#include <new>
#include <stdexcept>
#include <system_error>
#include <thread>
#include <vector>

#include "gpu/call_queue.h"
#include "gpu/cpu/abandonable_executor.h"
#include "gpu/cpu/executor.h"
#include "gpu/staging.h"

namespace voxeld::gpu {
namespace {

void ExpectEachIndexOnce(Executor& executor) {
  for (size_t count : {size_t{0}, size_t{1}, size_t{5}, size_t{1000}}) {
    for (size_t grain : {size_t{1}, size_t{7}, size_t{5000}}) {
      std::vector<std::atomic<int>> calls(count);
      std::vector<std::atomic<int>> inside(static_cast<size_t>(executor.concurrency()));
      std::atomic<bool> alone{true};
      executor.For(count, grain, [&](size_t i, int worker) {
        ASSERT_LT(worker, executor.concurrency());
        std::atomic<int>& mine = inside[static_cast<size_t>(worker)];
        if (mine.fetch_add(1) != 0) alone = false;
        ++calls[i];
        mine.fetch_sub(1);
      });
      for (const std::atomic<int>& c : calls) EXPECT_EQ(c, 1);
      EXPECT_TRUE(alone) << "two ran under one worker's number";
    }
  }
}

TEST(Executor, EveryKindRunsEachIndexOnce) {
  ExpectEachIndexOnce(*MakeSerialExecutor());
  for (int threads : {1, 2, 5}) {
    std::unique_ptr<Executor> executor = MakeThreadExecutor(threads);
    EXPECT_EQ(executor->concurrency(), threads);
    ExpectEachIndexOnce(*executor);
    ExpectEachIndexOnce(*MakeExecutor(threads));
  }
}

#ifndef VOXELD_SANITIZED  // their own memory exceeds any limit
void AskForMoreThreadsThanThereAre() {
  uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  const rlim_t most = pages * static_cast<uint64_t>(getpagesize()) + (rlim_t{64} << 20);
  const rlimit limit = {most, RLIM_INFINITY};
  if (setrlimit(RLIMIT_AS, &limit) != 0) _exit(2);
  try {
    MakeThreadExecutor(10'000);
  } catch (const std::system_error&) {
    _exit(0);
  }
  _exit(1);
}

TEST(ExecutorDeathTest, WithoutThreadsThereIsNoneAndThoseThatBeganHaveEnded) {
  EXPECT_EXIT(AskForMoreThreadsThanThereAre(), ::testing::ExitedWithCode(0), "");
}
#endif

TEST(Executor, WhatABodyThrowsComesOutOnceNoneRuns) {
  for (int threads : {1, 2, 5}) {
    for (bool own : {false, true}) {
      std::unique_ptr<Executor> executor =
          own ? MakeThreadExecutor(threads) : MakeExecutor(threads);
      std::atomic<int> running{0};
      // Whichever thread runs it, the caller or another.
      for (size_t at : {size_t{0}, size_t{499}, size_t{999}}) {
        EXPECT_THROW(executor->For(1000, 1,
                                   [&](size_t i, int) {
                                     ++running;
                                     if (i == at) {
                                       --running;
                                       throw std::bad_alloc();
                                     }
                                     std::this_thread::yield();
                                     --running;
                                   }),
                     std::bad_alloc);
        EXPECT_EQ(running, 0) << "it returned while others ran";
      }
      ExpectEachIndexOnce(*executor);
    }
  }
}

TEST(AbandonableExecutor, RunsLoopsUntilTheyAreGivenUp) {
  for (int threads : {1, 3}) {
    const auto abandoned = std::make_shared<std::atomic<bool>>(false);
    const std::unique_ptr<Executor> executor =
        MakeAbandonableExecutor(MakeThreadExecutor(threads), abandoned);
    EXPECT_EQ(executor->concurrency(), threads);
    ExpectEachIndexOnce(*executor);
    executor->ThrowIfAbandoned();
    std::atomic<int> ran{0};
    EXPECT_THROW(executor->For(1000, 1,
                               [&](size_t, int) {
                                 ++ran;
                                 *abandoned = true;
                               }),
                 std::runtime_error);
    EXPECT_LE(ran, threads) << "those that ran at once";
    EXPECT_THROW(executor->For(1, 1, [&](size_t, int) { ++ran; }), std::runtime_error);
    EXPECT_THROW(executor->ThrowIfAbandoned(), std::runtime_error);
  }
}

TEST(StagingPool, CountsWhatIsHeld) {
  StagingPool pool(100);
  absl::StatusOr<StagingBlock> a = pool.Acquire(60);
  ASSERT_TRUE(a.ok());
  EXPECT_FALSE(pool.Acquire(41).ok());
  absl::StatusOr<StagingBlock> b = pool.Acquire(40);
  ASSERT_TRUE(b.ok());
  EXPECT_FALSE(pool.Acquire(1).ok());
  EXPECT_TRUE(pool.Acquire(0).ok());
  *a = StagingBlock();
  EXPECT_TRUE(pool.Acquire(60).ok());
  EXPECT_EQ(pool.Acquire(101).status().code(), absl::StatusCode::kResourceExhausted);
}

TEST(StagingPool, BlocksOutliveIt) {
  StagingBlock block;
  {
    StagingPool pool(100);
    block = *pool.Acquire(32);
  }
  block.bytes()[31] = std::byte{1};
  EXPECT_EQ(block.bytes().size(), 32u);
}

TEST(CallQueue, InlineRunsBeforePostReturns) {
  CallQueue queue(/*run_inline=*/true);
  int calls = 0;
  queue.Post([&](bool cancelled) { calls += !cancelled; });
  EXPECT_EQ(calls, 1);
}

// Each call is answered once and in order; from the first that is cancelled on, all are cancelled.
TEST(CallQueue, DestructionCancelsWhatHasNotBegun) {
  sync::Mutex mutex;
  sync::CondVar changed;
  bool begun = false, release = false;
  std::vector<int> order;
  std::vector<bool> cancelled;
  {
    CallQueue queue(/*run_inline=*/false);
    for (int i = 0; i < 50; ++i) {
      queue.Post([&, i](bool c) {
        sync::MutexLock lock(mutex);
        order.push_back(i);
        cancelled.push_back(c);
        begun = true;
        changed.NotifyAll();
        while (!release) changed.Wait(mutex);
      });
    }
    sync::MutexLock lock(mutex);
    while (!begun) changed.Wait(mutex);
    release = true;
    changed.NotifyAll();
  }
  ASSERT_EQ(order.size(), 50u);
  for (int i = 0; i < 50; ++i) EXPECT_EQ(order[static_cast<size_t>(i)], i);
  EXPECT_FALSE(cancelled[0]);
  EXPECT_TRUE(std::is_sorted(cancelled.begin(), cancelled.end()));
}

}  // namespace
}  // namespace voxeld::gpu
