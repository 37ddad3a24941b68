#include "gpu/assemble/block_pool.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <memory>
#include <set>
#include <vector>

#include "gpu/cpu/executor.h"

namespace voxeld::gpu {
namespace {

constexpr size_t kBytes = 16448;

TEST(BlockPool, BlocksLieApartWhoeverTakesThem) {
  for (size_t most : {3u, 1000u}) {
    BlockPool pool;
    pool.Reset(kBytes, most);
    const std::unique_ptr<Executor> executor = MakeThreadExecutor(3);
    std::vector<std::byte*> blocks(most);
    for (size_t first : {size_t{0}, most / 3}) {
      const size_t count = first == 0 ? most / 3 : most - first;
      pool.Provide(count);
      executor->For(count, 1, [&](size_t i, int) {
        blocks[first + i] = static_cast<std::byte*>(pool.Take());
        std::memset(blocks[first + i], static_cast<int>((first + i) % 251), kBytes);
      });
      pool.Settle();
    }
    for (size_t i = 0; i < most; ++i) {
      EXPECT_EQ(reinterpret_cast<uintptr_t>(blocks[i]) % 64, 0u);
      for (size_t at : {size_t{0}, kBytes - 1}) {
        ASSERT_EQ(static_cast<size_t>(blocks[i][at]), i % 251) << "block " << i;
      }
    }
  }
}

TEST(BlockPool, WhatIsGivenIsTakenAgainAndTrimmingSparesWhatIsInUse) {
  constexpr size_t kMost = 600;
  BlockPool pool;
  pool.Reset(kBytes, kMost);
  pool.Provide(kMost);
  std::vector<std::byte*> blocks;
  for (size_t i = 0; i < kMost; ++i) blocks.push_back(static_cast<std::byte*>(pool.Take()));
  pool.Settle();
  // Every hundredth block stays in use.
  std::set<void*> given;
  for (size_t i = 0; i < kMost; ++i) {
    std::memset(blocks[i], static_cast<int>(i % 251), kBytes);
    if (i % 100 == 0) continue;
    pool.Give(blocks[i]);
    given.insert(blocks[i]);
  }
  pool.Provide(1);
  EXPECT_EQ(given.count(pool.Take()), 1u);
  pool.Settle();
  pool.Trim(0);
  for (size_t i = 0; i < kMost; i += 100) {
    EXPECT_EQ(static_cast<size_t>(blocks[i][kBytes - 1]), i % 251);
  }
  pool.Provide(kMost);
  std::set<void*> taken;
  for (size_t i = 0; i < kMost; ++i) {
    void* const block = pool.Take();
    std::memset(block, 0xFF, kBytes);
    EXPECT_TRUE(taken.insert(block).second);
  }
  for (size_t i = 0; i < kMost; i += 100) {
    EXPECT_EQ(taken.count(blocks[i]), 0u);
    EXPECT_EQ(static_cast<size_t>(blocks[i][kBytes - 1]), i % 251);
  }
}

}  // namespace
}  // namespace voxeld::gpu
