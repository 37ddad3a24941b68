// Tests the GPU that is played by the CPU: waiting threads get what CUDA promises, and behaviour
// that CUDA leaves undefined is detected.
#include "tests/gpu/simt/grid.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>
#include <set>
#include <vector>

#include "tests/gpu/simt/kernel.h"

namespace voxeld::simt {
namespace {

using ::testing::Each;
using ::testing::SizeIs;

constexpr uint32_t kAll = 0xFFFFFFFFu;

void NumberThreads(uint32_t* out) {
  out[(blockIdx.y * gridDim.x + blockIdx.x) * blockDim.x * blockDim.y + threadIdx.y * blockDim.x +
      threadIdx.x] += 1;
}

TEST(SimtGrid, EveryThreadOfEveryBlockRunsOnce) {
  std::vector<uint32_t> out(5 * 3 * 40 * 2);
  Launch(NumberThreads, dim3(5, 3), dim3(40, 2))(out.data());
  EXPECT_EQ(cudaGetLastError(), cudaSuccess);
  EXPECT_THAT(out, Each(1u));
}

// Each thread reads what another wrote before the barrier, in several rounds.
void PassRound(uint32_t rounds, uint32_t* out) {
  uint32_t* const places = static_cast<uint32_t*>(DynamicShared());
  const uint32_t self = threadIdx.x, count = blockDim.x;
  uint32_t mine = self;
  for (uint32_t round = 0; round < rounds; ++round) {
    places[self] = mine;
    __syncthreads();
    mine = places[(self + 1) % count];
    __syncthreads();
  }
  out[blockIdx.x * count + self] = mine;
}

TEST(SimtGrid, BarriersOrderWhatABlockShares) {
  constexpr uint32_t kThreads = 96, kBlocks = 7, kRounds = 11;
  std::vector<uint32_t> out(kThreads * kBlocks);
  Launch(PassRound, kBlocks, kThreads, kThreads * sizeof(uint32_t))(kRounds, out.data());
  for (uint32_t i = 0; i < out.size(); ++i) EXPECT_EQ(out[i], (i + kRounds) % kThreads) << i;
}

void NoteOrder(uint32_t* next, uint32_t* order) { order[atomicAdd(next, 1u)] = threadIdx.x; }

TEST(SimtGrid, NothingButBarriersOrdersThreads) {
  std::set<std::vector<uint32_t>> orders;
  for (int run = 0; run < 8; ++run) {
    uint32_t next = 0;
    std::vector<uint32_t> order(64);
    Launch(NoteOrder, 1, 64)(&next, order.data());
    orders.insert(order);
  }
  EXPECT_THAT(orders, SizeIs(8));
}

// Threads with an odd number leave before the barrier.
void LeaveEarly(uint32_t* any) {
  if (threadIdx.x % 2 != 0) return;
  any[threadIdx.x] = static_cast<uint32_t>(__syncthreads_or(threadIdx.x == 6 ? 1 : 0));
}

TEST(SimtGrid, EndedThreadsAreNotWaitedForAtABarrier) {
  std::vector<uint32_t> any(64);
  Launch(LeaveEarly, 1, 64)(any.data());
  for (uint32_t i = 0; i < 64; ++i) EXPECT_EQ(any[i], i % 2 == 0 ? 1u : 0u) << i;
}

struct Told {
  uint32_t ballot, sum_before, crossed, from_three;
  bool any, all;
};

void AskLanes(Told* out) {
  const uint32_t lane = threadIdx.x % 32;
  Told told{};
  told.ballot = __ballot_sync(kAll, lane % 3 == 0);
  told.any = __any_sync(kAll, lane == 31) != 0;
  told.all = __all_sync(kAll, lane != 31) != 0;
  uint32_t sum = lane;
  for (uint32_t lanes = 1; lanes < 32; lanes <<= 1) {
    const uint32_t other = __shfl_up_sync(kAll, sum, lanes);
    if (lane >= lanes) sum += other;
  }
  told.sum_before = sum - lane;
  told.crossed = __shfl_xor_sync(kAll, threadIdx.x, 5);
  told.from_three = __shfl_sync(kAll, threadIdx.x, 3);
  out[threadIdx.x] = told;
}

TEST(SimtGrid, LanesTellEachOther) {
  std::vector<Told> out(96);
  Launch(AskLanes, 1, 96)(out.data());
  for (uint32_t i = 0; i < out.size(); ++i) {
    const uint32_t lane = i % 32, first = i - lane;
    EXPECT_EQ(out[i].ballot, 0x49249249u);
    EXPECT_TRUE(out[i].any);
    EXPECT_FALSE(out[i].all);
    EXPECT_EQ(out[i].sum_before, lane * (lane - 1) / 2);
    EXPECT_EQ(out[i].crossed, first + (lane ^ 5));
    EXPECT_EQ(out[i].from_three, first + 3);
  }
}

// The two halves of a warp take different branches.
void AskInHalves(uint32_t* out) {
  const uint32_t lane = threadIdx.x;
  const uint32_t half = lane < 16 ? 0x0000FFFFu : 0xFFFF0000u;
  for (uint32_t round = 0; round < (lane < 16 ? 3 : 8); ++round) {
    out[lane] += __popc(__ballot_sync(half, lane % 2));
  }
}

TEST(SimtGrid, MasksDivideAWarp) {
  std::vector<uint32_t> out(32);
  Launch(AskInHalves, 1, 32)(out.data());
  for (uint32_t i = 0; i < 32; ++i) EXPECT_EQ(out[i], i < 16 ? 24u : 64u);
}

TEST(SimtGrid, WorkForLaterIsDoneWhenItIsWaitedFor) {
  std::vector<uint32_t> seen(2);
  const auto kernel = +[](uint32_t* out) {
    uint32_t value = 1;
    Later([&value] { value = 2; });
    out[0] = value;
    DoLater();
    out[1] = value;
  };
  Launch(kernel, 1, 1)(seen.data());
  EXPECT_THAT(seen, ::testing::ElementsAre(1, 2));
}

TEST(SimtGrid, LaunchesAreLimitedAsADevicesAre) {
  std::vector<uint32_t> out(2048);
  uint32_t next = 0;
  Launch(NoteOrder, 0, 64)(&next, out.data());
  EXPECT_EQ(cudaGetLastError(), cudaErrorInvalidConfiguration);
  EXPECT_EQ(cudaGetLastError(), cudaSuccess) << "reported once";
  Launch(NoteOrder, 1, 1025)(&next, out.data());
  EXPECT_EQ(cudaGetLastError(), cudaErrorInvalidConfiguration);
  Launch(NoteOrder, 1, 64, 100'000)(&next, out.data());
  EXPECT_EQ(cudaGetLastError(), cudaErrorInvalidConfiguration);
  EXPECT_EQ(next, 0u);
  EXPECT_EQ(cudaFuncSetAttribute(NoteOrder, cudaFuncAttributeMaxDynamicSharedMemorySize, 100'000),
            cudaSuccess);
  Launch(NoteOrder, 1, 64, 100'000)(&next, out.data());
  EXPECT_EQ(cudaGetLastError(), cudaSuccess);
  EXPECT_EQ(next, 64u);
  EXPECT_EQ(cudaFuncSetAttribute(NoteOrder, cudaFuncAttributeMaxDynamicSharedMemorySize, 300'000),
            cudaErrorInvalidValue);
}

// ------------------------------------------------------------------------- undefined behaviour

void WaitUnlessFirst(uint32_t*) {
  if (threadIdx.x / 32 == 0) {
    __syncwarp(threadIdx.x == 0 ? 3u : kAll);
  } else {
    __syncthreads();
  }
}

TEST(SimtGridDeathTest, MasksThatDifferAreFound) {
  EXPECT_DEATH(Launch(WaitUnlessFirst, 1, 64)(nullptr), "masks that differ");
}

void WaitForNobody(uint32_t*) {
  if (threadIdx.x == 0) {
    __syncwarp(3);
  } else {
    __syncthreads();
  }
}

TEST(SimtGridDeathTest, ThreadsThatWaitForEverAreFound) {
  EXPECT_DEATH(Launch(WaitForNobody, 1, 2)(nullptr), "waits for lanes 00000003");
}

void AskTheEnded(uint32_t*) {
  if (threadIdx.x == 5) return;
  __syncthreads();
  __ballot_sync(kAll, 1);
}

TEST(SimtGridDeathTest, LanesThatHaveEndedAreFound) {
  EXPECT_DEATH(Launch(AskTheEnded, 1, 32)(nullptr), "one that has ended");
}

void AskBeyondTheMask(uint32_t* out) {
  if (threadIdx.x < 16) out[threadIdx.x] = __shfl_sync(0xFFFFu, threadIdx.x, 20);
}

TEST(SimtGridDeathTest, ValuesOfLanesThatDoNotTakePartAreFound) {
  uint32_t out[16];
  EXPECT_DEATH(Launch(AskBeyondTheMask, 1, 32)(out), "does not take part");
}

}  // namespace
}  // namespace voxeld::simt
