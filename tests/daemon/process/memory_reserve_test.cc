#include "daemon/process/memory_reserve.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <new>
#include <stdexcept>
#include <thread>
#include <vector>

#include "gpu/want_of_memory.h"

namespace voxeld::daemon {
namespace {

constexpr size_t kPart = MemoryReserve::kPartBytes;

// Pages of the process: mapped, and there.
struct Pages {
  size_t mapped = 0, resident = 0;
};
Pages PagesNow() {
  Pages pages;
  std::FILE* file = std::fopen("/proc/self/statm", "r");
  if (file == nullptr || std::fscanf(file, "%zu %zu", &pages.mapped, &pages.resident) != 2) {
    std::abort();
  }
  std::fclose(file);
  return pages;
}

TEST(MemoryReserve, HoldsWholePartsThatAreThere) {
  MemoryReserve reserve;
  EXPECT_EQ(reserve.figures().held_bytes, 0u);
  const Pages before = PagesNow();
  EXPECT_TRUE(reserve.Fill(3 * kPart - 1));
  const size_t more = (PagesNow().resident - before.resident) * static_cast<size_t>(getpagesize());
  EXPECT_GE(more, 3 * kPart * 9 / 10) << "promised, and not there";
  EXPECT_EQ(reserve.figures().held_bytes, 3 * kPart);
  EXPECT_EQ(reserve.figures().wanted_bytes, 3 * kPart);
  EXPECT_TRUE(reserve.Fill(3 * kPart));
  EXPECT_EQ(reserve.figures().held_bytes, 3 * kPart);
}

TEST(MemoryReserve, GivesUpAPartAfterTheOtherAndSaysOnceThatNothingIsLeft) {
  MemoryReserve reserve;
  ASSERT_TRUE(reserve.Fill(2 * kPart));
  ::testing::internal::CaptureStderr();
  const Pages before = PagesNow();
  errno = EINTR;
  EXPECT_TRUE(reserve.Help(100, 0));
  EXPECT_EQ(reserve.figures().held_bytes, kPart);
  EXPECT_TRUE(reserve.Help(100, 1));
  EXPECT_EQ(reserve.figures().held_bytes, 0u);
  EXPECT_EQ((before.mapped - PagesNow().mapped) * static_cast<size_t>(getpagesize()), 2 * kPart)
      << "the system has not got it back";
  EXPECT_FALSE(reserve.Help(100, 2));
  EXPECT_EQ(errno, EINTR);
  EXPECT_TRUE(reserve.Help(7, 0)) << "what the allocator keeps may help";
  EXPECT_FALSE(reserve.Help(7, 1));
  EXPECT_EQ(::testing::internal::GetCapturedStderr(),
            "voxeld: out of memory: there are no 100 bytes to be had, and the reserve is used up "
            "or too small\n");
  EXPECT_EQ(reserve.figures().failed, 2u);
  EXPECT_EQ(reserve.figures().refused, 2u);
  EXPECT_EQ(reserve.figures().last_bytes, 7u);
  // Whole again it helps again, and says it again.
  EXPECT_TRUE(reserve.Fill(kPart));
  EXPECT_TRUE(reserve.Help(7, 0));
  ::testing::internal::CaptureStderr();
  EXPECT_FALSE(reserve.Help(7, 1));
  EXPECT_THAT(::testing::internal::GetCapturedStderr(), ::testing::HasSubstr("out of memory"));
}

TEST(MemoryReserve, IsNotGivenUpForWhatIsLarger) {
  MemoryReserve reserve;
  ASSERT_TRUE(reserve.Fill(kPart));
  ::testing::internal::CaptureStderr();
  EXPECT_TRUE(reserve.Help(kPart + 1, 0));
  EXPECT_FALSE(reserve.Help(kPart + 1, 1));
  ::testing::internal::GetCapturedStderr();
  EXPECT_EQ(reserve.figures().held_bytes, kPart);
}

TEST(MemoryReserve, WhatOneThreadWasGivenIsWorthAnotherAttemptOfTheOthers) {
  constexpr int kThreads = 8;
  MemoryReserve reserve;
  ASSERT_TRUE(reserve.Fill(2 * kPart));
  ::testing::internal::CaptureStderr();
  std::array<std::atomic<int>, kThreads> helped = {};
  std::vector<std::thread> threads;
  for (int i = 0; i < kThreads; ++i) {
    threads.emplace_back([&, i] {
      while (reserve.Help(100, 1)) ++helped[static_cast<size_t>(i)];
    });
  }
  for (std::thread& thread : threads) thread.join();  // it ends for all
  ::testing::internal::GetCapturedStderr();
  for (const std::atomic<int>& times : helped) EXPECT_GE(times, 1);
  EXPECT_EQ(reserve.figures().held_bytes, 0u);
}

// ---- the program's own allocations, which come by the reserve of the process (allocations.cc)

#ifndef VOXELD_SANITIZED

// Without more address space than the process has already.
void NoMore() {
  const size_t now = PagesNow().mapped * static_cast<size_t>(getpagesize());
  const rlimit limit = {now, now};
  if (setrlimit(RLIMIT_AS, &limit) != 0) _exit(99);
}

struct Kind {
  const char* name;
  void* (*allocate)();
};
constexpr size_t kBytes = 100'032;
const Kind kKinds[] = {
    {"operator new", [] { return ::operator new(kBytes); }},
    {"aligned operator new", [] { return ::operator new(kBytes, std::align_val_t{256}); }},
    {"malloc", [] { return std::malloc(kBytes); }},
    {"calloc", [] { return std::calloc(kBytes / 32, 32); }},
    {"realloc", [] { return std::realloc(std::malloc(10), kBytes); }},
    {"aligned_alloc", [] { return std::aligned_alloc(64, kBytes); }},
    {"posix_memalign", [] {
       void* memory = nullptr;
       return posix_memalign(&memory, 64, kBytes) == 0 ? memory : nullptr;
     }}};

// Asks until it was helped.
void UseTheReserve(const Kind& kind) {
  const MemoryReserve& reserve = MemoryReserve::OfProcess();
  if (!MemoryReserve::OfProcess().Fill(2 * kPart)) _exit(98);
  NoMore();
  for (int i = 0; i < 4096; ++i) {
    void* const memory = kind.allocate();
    if (memory == nullptr) _exit(8);
    std::memset(memory, 1, kBytes);
    if (reserve.figures().failed == 0) continue;
    _exit(reserve.figures().refused == 0 && reserve.figures().held_bytes == kPart ? 7 : 9);
  }
  _exit(10);
}

TEST(MemoryReserveDeathTest, AllocationsOfEachKindAreHelped) {
  for (const Kind& kind : kKinds) {
    EXPECT_EXIT(UseTheReserve(kind), ::testing::ExitedWithCode(7), "") << kind.name;
  }
}

void UseItUp() {
  EndWhenMemoryEnds();
  MemoryReserve::OfProcess().Fill(kPart);
  NoMore();
  struct Ring {
    Ring* next;
    char more[1000];
  };
  // As where nobody expects it.
  []() noexcept {
    for (Ring* last = nullptr;;) last = new Ring{last, {}};
  }();
}

TEST(MemoryReserveDeathTest, WithoutMemoryTheProcessEndsWithAReason) {
  EXPECT_EXIT(
      UseItUp(), ::testing::ExitedWithCode(1),
      "out of memory: there are no [0-9]+ bytes to be had(.|\n)*it cannot go on without memory");
}

void UseItUpWhereSomebodyCopes() {
  EndWhenMemoryEnds();
  MemoryReserve::OfProcess().Fill(kPart);
  NoMore();
  size_t bytes = 0;
  try {
    const gpu::WantOfMemory caught;
    for (std::vector<char> all;; bytes = all.size()) all.resize(2 * all.size() + 100);
  } catch (const std::bad_alloc&) {
    _exit(bytes > 0 ? 7 : 8);
  }
}

TEST(MemoryReserveDeathTest, WhoCopesWithItGetsAnException) {
  EXPECT_EXIT(UseItUpWhereSomebodyCopes(), ::testing::ExitedWithCode(7), "out of memory");
}

void AskForWhatCannotBe() {
  // Not constants, or they are found out at once.
  volatile size_t huge = SIZE_MAX / 2 + 100, half = SIZE_MAX / 2;
  if (!MemoryReserve::OfProcess().Fill(kPart)) _exit(98);
  errno = 0;
  const bool refused = std::malloc(huge) == nullptr && errno == ENOMEM &&
                       std::calloc(half, 3) == nullptr &&
                       new (std::nothrow) char[half - 100] == nullptr;
  _exit(refused && MemoryReserve::OfProcess().figures().held_bytes == kPart ? 7 : 8);
}

TEST(MemoryReserveDeathTest, AnswersWhatCannotBe) {
  EXPECT_EXIT(AskForWhatCannotBe(), ::testing::ExitedWithCode(7), "");
}

TEST(MemoryReserveDeathTest, OtherExceptionsEndItAsBefore) {
  EXPECT_DEATH(
      {
        EndWhenMemoryEnds();
        const auto fail = [] { throw std::runtime_error("something else"); };
        [&]() noexcept { fail(); }();
      },
      "something else");
}

#endif

}  // namespace
}  // namespace voxeld::daemon
