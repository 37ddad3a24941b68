#include "daemon/process/process_watch.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace voxeld::daemon
