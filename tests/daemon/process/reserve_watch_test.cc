#include "daemon/process/reserve_watch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>

#include <memory>
#include <sstream>

#include "display/sync/fake_clock.h"

namespace voxeld::daemon {
namespace {

using ::testing::HasSubstr;

class ReserveWatchTest : public ::testing::Test {
 protected:
  std::string Logged() {
    std::string text = out_.str();
    out_.str("");
    return text;
  }

  std::ostringstream out_;
  Logger log_{Logger::Level::kInfo, Logger::Format::kText,
              std::make_shared<spdlog::sinks::ostream_sink_mt>(out_, true)};
  sync::FakeClock clock_;
  MemoryReserve reserve_;
};

TEST_F(ReserveWatchTest, TakesBackWhatWasGivenUpAndTellsOfIt) {
  ReserveWatch watch(2 * MemoryReserve::kPartBytes, clock_, log_, reserve_);
  EXPECT_EQ(reserve_.figures().held_bytes, 2 * MemoryReserve::kPartBytes);
  watch.Look();
  EXPECT_EQ(Logged(), "");
  EXPECT_EQ(watch.figures().trouble, "");

  clock_.Advance(sync::kSecond);
  ASSERT_TRUE(reserve_.Help(4711, 0));
  EXPECT_THAT(watch.figures().trouble,
              HasSubstr("of its reserve of 4194304 bytes the daemon has 2097152"));
  EXPECT_EQ(watch.figures().reserve_held_bytes, MemoryReserve::kPartBytes);
  EXPECT_EQ(Logged(), "") << "from within an allocation";
  watch.Look();
  EXPECT_EQ(reserve_.figures().held_bytes, 2 * MemoryReserve::kPartBytes);
  const std::string told = Logged();
  EXPECT_THAT(told, HasSubstr("the system had no memory"));
  EXPECT_THAT(told, HasSubstr("4711"));
  watch.Look();
  EXPECT_EQ(Logged(), "") << "twice";

  clock_.Advance(3 * sync::kSecond);
  EXPECT_EQ(watch.figures().allocations_failed, 1u);
  EXPECT_EQ(watch.figures().allocations_refused, 0u);
  EXPECT_EQ(watch.figures().trouble,
            "the system had no memory 3 s ago (1 allocations since the start, the last of 4711 "
            "bytes); the "
            "reserve helped them all");
  clock_.Advance(ReserveWatch::kTold);
  EXPECT_EQ(watch.figures().trouble, "");
  EXPECT_EQ(watch.figures().allocations_failed, 1u);
}

TEST_F(ReserveWatchTest, TellsOfArraysThatThereWasNoMemoryFor) {
  static uint64_t refused = 0;
  refused = 5;  // before it was there: nobody's
  ReserveWatch watch(0, clock_, log_, reserve_, [] { return refused; });
  clock_.Advance(sync::kSecond);
  watch.Look();
  EXPECT_EQ(Logged(), "");
  EXPECT_EQ(watch.figures().trouble, "");
  refused = 8;
  EXPECT_EQ(watch.figures().segments_refused, 8u);
  watch.Look();
  const std::string told = Logged();
  EXPECT_THAT(told, HasSubstr("warning the system had no memory for arrays or engines"));
  EXPECT_THAT(told, HasSubstr("times=3"));
  watch.Look();
  EXPECT_EQ(Logged(), "") << "twice";
  clock_.Advance(2 * sync::kSecond);
  EXPECT_EQ(watch.figures().trouble,
            "the system had no memory for arrays or engines 2 s ago (8 times since the start)");
  clock_.Advance(ReserveWatch::kTold);
  EXPECT_EQ(watch.figures().trouble, "");
}

TEST_F(ReserveWatchTest, SaysHowManyWereRefused) {
  ReserveWatch watch(0, clock_, log_, reserve_);
  clock_.Advance(sync::kSecond);
  ::testing::internal::CaptureStderr();
  unsigned attempt = 0;
  while (reserve_.Help(100, attempt)) ++attempt;
  ::testing::internal::GetCapturedStderr();
  watch.Look();
  EXPECT_THAT(watch.figures().trouble, HasSubstr("the reserve helped all but 1"));
  EXPECT_EQ(watch.figures().allocations_refused, 1u);
}

}  // namespace
}  // namespace voxeld::daemon
