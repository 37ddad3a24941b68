// Tests interrupts, in a program of its own: signals go to a whole process, and threads that other
// code made may receive them.
#include "tools/voxelctl/process/interrupt.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>
#include <thread>

#include "display/sync/clock.h"

namespace voxeld::voxelctl {
namespace {

TEST(Interrupt, EndsWaitsAndTellsListenersOnce) {
  Interrupt interrupt(Interrupt::Watch::kNothing);
  sync::SystemClock clock;
  EXPECT_FALSE(interrupt.WaitUntil(clock, clock.Now() - 1));
  int told = 0, removed = 0;
  interrupt.AddListener([&] { ++told; });
  interrupt.RemoveListener(interrupt.AddListener([&] { ++removed; }));
  std::thread other([&] { interrupt.Request(); });
  EXPECT_TRUE(interrupt.WaitUntil(clock, sync::kNever));
  other.join();
  interrupt.Request();
  EXPECT_EQ(told, 1);
  EXPECT_EQ(removed, 0);
  interrupt.AddListener([&] { ++told; });
  EXPECT_EQ(told, 2);
}

TEST(Interrupt, TakesSignals) {
  Interrupt interrupt(Interrupt::Watch::kSignals);
  sync::SystemClock clock;
  ASSERT_EQ(::kill(::getpid(), SIGINT), 0);
  EXPECT_TRUE(interrupt.WaitUntil(clock, clock.Now() + 60 * sync::kSecond));
}

}  // namespace
}  // namespace voxeld::voxelctl
