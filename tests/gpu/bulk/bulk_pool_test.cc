#include "gpu/bulk/bulk_pool.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <random>
#include <thread>
#include <vector>

#include "display/sync/mutex.h"

namespace voxeld::gpu {
namespace {

using testing::HasSubstr;

constexpr size_t kSegment = 64 << 10;

std::shared_ptr<BulkPool> Small(uint64_t limit = 4 * kSegment, uint64_t keep = 0) {
  return BulkPool::Create({.limit_bytes = limit, .segment_bytes = kSegment, .keep_bytes = keep});
}

BulkBlock Filled(BulkPool& pool, size_t size, uint8_t value) {
  BulkPool::Fresh fresh = pool.Allocate(size).value();
  EXPECT_EQ(fresh.bytes.size(), size);
  std::memset(fresh.bytes.data(), value, size);
  return fresh.block;
}

bool Holds(const BulkBlock& block, size_t size, uint8_t value) {
  const auto bytes = block.bytes().first(size);
  return std::all_of(bytes.begin(), bytes.end(),
                     [&](std::byte b) { return b == static_cast<std::byte>(value); });
}

TEST(BulkPool, BlocksAreAlignedApartAndCounted) {
  const auto pool = Small();
  const BulkBlock a = Filled(*pool, 1, 1), b = Filled(*pool, 100, 2), c = Filled(*pool, 64, 3);
  for (const BulkBlock* block : {&a, &b, &c}) {
    EXPECT_EQ(reinterpret_cast<uintptr_t>(block->bytes().data()) % BulkPool::kAlign, 0u);
    EXPECT_EQ(block->segment(), a.segment());
  }
  EXPECT_TRUE(Holds(a, 1, 1) && Holds(b, 100, 2) && Holds(c, 64, 3));
  EXPECT_EQ(pool->used_bytes(), 64u + 128 + 64);
  EXPECT_EQ(pool->held_bytes(), kSegment);
  const BulkBlock again = a;
  EXPECT_EQ(again.bytes().data(), a.bytes().data());
  EXPECT_EQ(pool->used_bytes(), 64u + 128 + 64);
}

TEST(BulkPool, PlacesAreUsedAgainAndNeighboursJoined) {
  const auto pool = Small(kSegment);
  std::vector<BulkBlock> blocks;
  for (uint8_t i = 0; i < 64; ++i) blocks.push_back(Filled(*pool, 1024, i));
  EXPECT_FALSE(pool->Allocate(1).ok());
  const std::byte* const hole = blocks[10].bytes().data();
  blocks[11] = {};
  blocks[10] = {};
  blocks[12] = {};
  blocks[40] = {};
  EXPECT_EQ(blocks[41].bytes()[0], std::byte{41});
  // The three adjacent ones are one hole; the single one fits better for less.
  EXPECT_NE(Filled(*pool, 1000, 1).bytes().data(), hole);
  EXPECT_EQ(Filled(*pool, 3072, 1).bytes().data(), hole);
  EXPECT_FALSE(pool->Allocate(3073).ok());
  EXPECT_EQ(pool->used_bytes(), 60u * 1024);
}

TEST(BulkPool, ExhaustionSaysWhatThereIs) {
  const auto pool = Small(kSegment + 1000);
  BulkBlock all = Filled(*pool, kSegment, 7);
  const absl::Status refused = pool->Allocate(2000).status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_THAT(std::string(refused.message()), HasSubstr("2048 bytes asked for, 65536 used"));
  EXPECT_THAT(std::string(refused.message()), HasSubstr("limit 66536"));
  EXPECT_TRUE(pool->Allocate(900).ok());  // a segment as small as the rest of the limit
  EXPECT_FALSE(pool->Allocate(SIZE_MAX).ok());
  EXPECT_FALSE(pool->Allocate(SIZE_MAX / 2).ok());
  all = {};
  EXPECT_TRUE(pool->Allocate(2000).ok());
  EXPECT_LE(pool->held_bytes(), pool->limit_bytes());
}

TEST(BulkPool, GreatBlocksHaveASegmentAndItGoesWithThem) {
  const auto pool = Small();
  const BulkBlock small = Filled(*pool, 10, 1);
  {
    const BulkBlock great = Filled(*pool, 2 * kSegment, 2);
    EXPECT_NE(great.segment(), small.segment());
    EXPECT_EQ(pool->held_bytes(), 3 * kSegment);
  }
  EXPECT_EQ(pool->held_bytes(), kSegment);
}

TEST(BulkPool, UnusedSegmentsAreKeptAsFarAsAskedForButNeverInTheWay) {
  const auto pool = Small(3 * kSegment, 2 * kSegment);
  std::vector<BulkBlock> blocks;
  for (int i = 0; i < 3; ++i) blocks.push_back(Filled(*pool, kSegment, 1));
  EXPECT_EQ(pool->held_bytes(), 3 * kSegment);
  blocks.clear();
  EXPECT_EQ(pool->held_bytes(), 2 * kSegment);
  // Retained memory is freed for what does not fit into it.
  EXPECT_TRUE(pool->Allocate(3 * kSegment).ok());
}

TEST(BulkPool, GivesBackKeptSegmentsThatAreNotUsed) {
  const auto pool = Small(3 * kSegment, 3 * kSegment);
  const BulkBlock used = Filled(*pool, 10, 4);
  { const BulkBlock left = Filled(*pool, kSegment, 5); }
  EXPECT_EQ(pool->held_bytes(), 2 * kSegment);
  pool->GiveBackUnused();
  EXPECT_EQ(pool->held_bytes(), kSegment);
  EXPECT_TRUE(Holds(used, 10, 4));
  EXPECT_TRUE(pool->Allocate(2 * kSegment).ok());
}

TEST(BulkPool, BlocksOutliveIt) {
  auto pool = Small();
  BulkBlock block = Filled(*pool, 500, 9);
  pool = nullptr;
  EXPECT_TRUE(Holds(block, 500, 9));
  block = {};
}

TEST(BulkSegment, SaysWhenItIsGone) {
  const auto pool = Small();
  BulkBlock a = Filled(*pool, 100, 1), b = Filled(*pool, 100, 1);
  int gone = 0, unheard = 0;
  const auto alive = std::make_shared<int>();
  auto dead = std::make_shared<int>();
  a.segment()->WhenGone(alive, [&] { ++gone; });
  a.segment()->WhenGone(dead, [&] { ++unheard; });
  dead = nullptr;
  a = {};
  EXPECT_EQ(gone, 0);
  b = {};
  EXPECT_EQ(gone, 1);
  EXPECT_EQ(unheard, 0);
}

TEST(BulkSegment, OthersReadWhatIsWrittenAndCannotWrite) {
  const auto pool = Small();
  const BulkBlock block = Filled(*pool, 100, 5);
  const Segment& memory = *block.segment()->memory();
  const auto theirs = Segment::AdoptReadOnly(dup(memory.fd()), memory.bytes().size());
  ASSERT_TRUE(theirs.ok()) << theirs.status();
  EXPECT_NE((*theirs)->bytes().data(), memory.bytes().data());
  EXPECT_EQ((*theirs)->bytes()[block.offset() + 99], std::byte{5});
  const BulkBlock later = Filled(*pool, 100, 6);
  EXPECT_EQ((*theirs)->bytes()[later.offset()], std::byte{6});
  EXPECT_FALSE(Segment::Adopt(dup(memory.fd()), memory.bytes().size()).ok());
  EXPECT_EQ(Segment::AdoptReadOnly(dup(memory.fd()), memory.bytes().size() - 1).status().code(),
            absl::StatusCode::kInvalidArgument);
}

TEST(BulkSegment, OfOneProcessHasNoDescriptor) {
  const auto pool = BulkPool::Create({.shared = false});
  EXPECT_EQ(Filled(*pool, 100, 5).segment()->memory()->fd(), -1);
}

TEST(BlockSource, FindsWhatCameAlongInAnyOrder) {
  const auto pool = Small();
  const std::vector<BulkBlock> blocks = {Filled(*pool, 64, 1), Filled(*pool, 64, 2),
                                         Filled(*pool, 64, 3)};
  BlockSource source(blocks);
  for (const int i : {0, 1, 2, 1, 1, 0, 2}) {
    const absl::StatusOr<BulkView> found = source.Find(RefOf(blocks[static_cast<size_t>(i)]));
    ASSERT_TRUE(found.ok());
    EXPECT_EQ(found->bytes[0], static_cast<std::byte>(i + 1));
  }
  const BulkBlock other = Filled(*pool, 64, 4);
  EXPECT_EQ(source.Find(RefOf(other)).status().code(), absl::StatusCode::kInvalidArgument);
  BulkRef longer = RefOf(blocks[0]);
  longer.size += 64;
  EXPECT_FALSE(source.Find(longer).ok());
  EXPECT_FALSE(BlockSource({}).Find(RefOf(other)).ok());
}

// Blocks that are passed between threads: the content of a held block does not change.
TEST(BulkPool, ThreadsShareIt) {
  const auto pool = Small(8 * kSegment, kSegment);
  struct Held {
    BulkBlock block;
    size_t size = 0;
    uint8_t value = 0;
  };
  sync::Mutex mutex;
  std::vector<Held> market;
  std::vector<int> wrong(4), refused(4);
  std::vector<std::thread> threads;
  for (size_t t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      std::mt19937 random(static_cast<uint32_t>(t));
      for (int i = 0; i < 4000; ++i) {
        const size_t size = 1 + random() % (random() % 20 == 0 ? 50'000 : 3000);
        absl::StatusOr<BulkPool::Fresh> fresh = pool->Allocate(size);
        Held held;
        if (fresh.ok()) {
          held = {fresh->block, size, static_cast<uint8_t>(random())};
          std::memset(fresh->bytes.data(), held.value, size);
        } else {
          ++refused[t];
        }
        Held other;
        {
          sync::MutexLock lock(mutex);
          if (held.block) market.push_back(std::move(held));
          const size_t at = random() % (market.size() + 1);
          if (at < market.size() && (market.size() > 100 || !fresh.ok() || random() % 2 == 0)) {
            std::swap(market[at], market.back());
            other = std::move(market.back());
            market.pop_back();
          }
        }
        if (other.block && !Holds(other.block, other.size, other.value)) ++wrong[t];
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (size_t t = 0; t < 4; ++t) EXPECT_EQ(wrong[t], 0);
  for (const Held& held : market) EXPECT_TRUE(Holds(held.block, held.size, held.value));
  market.clear();
  EXPECT_EQ(pool->used_bytes(), 0u);
  EXPECT_LE(pool->held_bytes(), kSegment);
}

}  // namespace
}  // namespace voxeld::gpu
