#include "daemon/process/process_watch.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <fstream>
#include <memory>
#include <optional>
#include <vector>

#include "daemon/process/process.h"
#include "display/sync/fake_clock.h"
#include "gpu/bulk/segment.h"

namespace voxeld::daemon {
namespace {

TEST(ProcessWatch, HasTheFiguresOfAll) {
  sync::FakeClock clock;
  Logger log(Logger::Level::kOff, Logger::Format::kText);
  ProcessWatch watch(clock, log);
  clock.Advance(sync::kSecond);
  watch.Look();
  watch.LookAtTime();
  const uint64_t before = watch.figures().segments_refused;
  ASSERT_FALSE(gpu::Segment::CreatePrivate(size_t{1} << 62).ok());
  EXPECT_EQ(watch.figures().segments_refused, before + 1);
  watch.Look();
  EXPECT_NE(watch.figures().trouble, "");
  EXPECT_EQ(watch.figures().pauses, 0u);
  EXPECT_EQ(watch.figures().clock_steps, 0u);
}

// An allocator whose calls take a time, and whose count has a value, that a test sets.
class ScriptedAllocator : public ::testing::Test {
 protected:
  ScriptedAllocator() {
    given_back_ = counted_ = 0;
    gives_back_for_ = counts_for_ = 0;
    bytes_.reset();
  }

  void Look(uint64_t bytes, uint64_t held = 0, uint64_t peak = 0) {
    bytes_ = bytes;
    Watch(1, held, peak);
  }
  void Watch(int seconds, uint64_t held = 0, uint64_t peak = 0) {
    for (int i = 0; i < seconds; ++i) {
      clock_.Advance(sync::kSecond);
      const int before = given_back_;
      EXPECT_EQ(watch_.Look(held, peak), given_back_ != before);
    }
  }

  static inline sync::FakeClock clock_{sync::kSecond};
  static inline sync::TimeNs gives_back_for_ = 0, counts_for_ = 0;
  static inline int given_back_ = 0;
  static inline uint64_t counted_ = 0;
  static inline std::optional<uint64_t> bytes_;  // nullopt: the number of counts
  Logger log_{Logger::Level::kOff, Logger::Format::kText};
  ProcessWatch watch_{clock_,
                      log_,
                      {.give_back =
                           [] {
                             ++given_back_;
                             clock_.Advance(gives_back_for_);
                           },
                       .count =
                           [] {
                             clock_.Advance(counts_for_);
                             ++counted_;
                             return bytes_.value_or(counted_);
                           }}};
};

TEST_F(ScriptedAllocator, GivesBackEachMinuteAndCountsEachSecondIfThatIsQuick) {
  for (int second = 1; second <= 150; ++second) {
    Watch(1);
    EXPECT_EQ(given_back_, second / 60) << second;
    EXPECT_EQ(watch_.figures().heap_bytes, static_cast<uint64_t>(second));
  }
  EXPECT_EQ(counted_, 150u) << "asking does not count";
}

TEST_F(ScriptedAllocator, HasAThousandthOfTheTime) {
  gives_back_for_ = 120 * sync::kMillisecond;
  counts_for_ = 5 * sync::kMillisecond;
  Watch(60);
  EXPECT_EQ(given_back_, 1);
  Watch(115);
  EXPECT_EQ(given_back_, 1);
  Watch(10);
  EXPECT_EQ(given_back_, 2);
  const uint64_t counted = counted_;
  Watch(100);
  EXPECT_LE(counted_, counted + 20);
  EXPECT_GE(counted_, counted + 18);
}

TEST_F(ScriptedAllocator, MuchThatWasFreedIsGivenBackAtOnce) {
  Look(100 << 20);
  Look(95 << 20);
  EXPECT_EQ(given_back_, 0) << "too little";
  Look(92 << 20);
  EXPECT_EQ(given_back_, 1) << "8 MiB since the most";
  Look(92 << 20);
  EXPECT_EQ(given_back_, 1) << "again without a reason";
  for (int i = 0; i < 3; ++i) Look(92 << 20);
  EXPECT_EQ(given_back_, 2) << "the rest may have followed";
  for (int i = 0; i < 50; ++i) Look(92 << 20);
  EXPECT_EQ(given_back_, 2);
  Look(200 << 20);
  Look(10 << 20);
  EXPECT_EQ(given_back_, 3);
}

TEST_F(ScriptedAllocator, WhatTheBudgetSaysIsEnough) {
  Look(0, 100 << 20);
  Look(0, 93 << 20);
  EXPECT_EQ(given_back_, 0);
  Look(0, 92 << 20);
  EXPECT_EQ(given_back_, 1);
}

TEST_F(ScriptedAllocator, ASceneThatCameAndWentBetweenTwoLooksIsNoticed) {
  Look(0, 0, 7 << 20);
  EXPECT_EQ(given_back_, 0);
  Look(0, 0, 8 << 20);
  EXPECT_EQ(given_back_, 1);
}

TEST_F(ScriptedAllocator, HasATwentiethOfTheTimeForThat) {
  gives_back_for_ = 250 * sync::kMillisecond;
  for (int i = 0; i < 60; ++i) Look(i % 2 == 0 ? 100 << 20 : 0);
  EXPECT_LE(given_back_, 13) << "each five seconds";
  EXPECT_GE(given_back_, 5);
}

#if defined(__GLIBC__) && !defined(VOXELD_SANITIZED)
TEST(ProcessWatch, TellsWhatIsAllocated) {
  sync::FakeClock clock;
  Logger log(Logger::Level::kOff, Logger::Format::kText);
  ProcessWatch watch(clock, log);
  const auto told = [&] {
    clock.Advance(ProcessWatch::kCount);
    watch.Look();
    return watch.figures().heap_bytes;
  };
  // One within an arena, and one that is mapped.
  for (const size_t bytes : {size_t{100} << 10, size_t{64} << 20}) {
    const uint64_t before = told();
    auto held = std::make_unique<char[]>(bytes);
    const uint64_t during = told();
    EXPECT_GE(during, before + bytes);
    EXPECT_LT(during, before + bytes + (16 << 10));
    held.reset();
    EXPECT_LT(told(), before + (16 << 10));
  }
}

TEST(Process, WhatIsFreeBetweenWhatIsHeldIsGivenBack) {
  // Every other place, of many of four pages each, is freed.
  constexpr size_t kPlace = 16 << 10, kPlaces = 4096;
  std::vector<std::unique_ptr<char[]>> places(kPlaces);
  for (std::unique_ptr<char[]>& place : places) {
    place = std::make_unique<char[]>(kPlace);
    std::memset(place.get(), 1, kPlace);
  }
  for (size_t i = 0; i < kPlaces; i += 2) places[i].reset();
  const auto resident = [] {
    std::ifstream file("/proc/self/statm");
    size_t pages = 0, in_memory = 0;
    file >> pages >> in_memory;
    return in_memory * static_cast<size_t>(sysconf(_SC_PAGESIZE));
  };
  const size_t before = resident();
  GiveBackFreeMemory();
  // For each, the pages that it shares with no other.
  EXPECT_LT(resident(), before - kPlaces / 2 * kPlace / 2);
}
#endif

}  // namespace
}  // namespace voxeld::daemon
