#include "daemon/process/process_watch.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <fstream>
#include <memory>
#include <vector>

#include "daemon/process/process.h"
#include "display/sync/fake_clock.h"
#include "gpu/bulk/segment.h"

namespace voxeld::daemon {
namespace {

TEST(ProcessWatch, HasTheFiguresOfAll) {
  sync::FakeClock clock;
  Logger log(Logger::Level::kOff, Logger::Format::kText);
  ProcessWatch watch(0, clock, log);
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

int given_back = 0;

TEST(ProcessWatch, GivesBackFreeMemoryEachMinute) {
  sync::FakeClock clock;
  Logger log(Logger::Level::kOff, Logger::Format::kText);
  ProcessWatch watch(0, clock, log, [] { ++given_back; });
  for (int second = 1; second <= 150; ++second) {
    clock.Advance(sync::kSecond);
    watch.Look();
    EXPECT_EQ(given_back, second / 60) << second;
  }
}

#if defined(__GLIBC__) && !defined(VOXELD_SANITIZED)
TEST(ProcessWatch, TellsWhatIsAllocated) {
  sync::FakeClock clock;
  Logger log(Logger::Level::kOff, Logger::Format::kText);
  const ProcessWatch watch(0, clock, log);
  // One within an arena, and one that is mapped.
  for (const size_t bytes : {size_t{100} << 10, size_t{64} << 20}) {
    const uint64_t before = watch.figures().heap_bytes;
    auto held = std::make_unique<char[]>(bytes);
    const uint64_t during = watch.figures().heap_bytes;
    EXPECT_GE(during, before + bytes);
    EXPECT_LT(during, before + bytes + (16 << 10));
    held.reset();
    EXPECT_LT(watch.figures().heap_bytes, before + (16 << 10));
  }
}

TEST(Process, WhatIsFreeBetweenWhatIsHeldIsGivenBack) {
  // Every other of many places of four pages is let go.
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
  // Of each the pages that are its own alone.
  EXPECT_LT(resident(), before - kPlaces / 2 * kPlace / 2);
}
#endif

}  // namespace
}  // namespace voxeld::daemon
