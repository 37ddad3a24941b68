#include "daemon/process/time_watch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>

#include <memory>
#include <sstream>
#include <utility>

namespace voxeld::daemon {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class TimeWatchTest : public ::testing::Test {
 protected:
  // Makes a turn after that long, in which the wall clock advances by that and by `step`.
  void Turn(sync::TimeNs after, sync::TimeNs step = 0) {
    time_.running += after;
    time_.wall += after + step;
    watch_.Look();
  }
  ProcessFigures figures() const {
    ProcessFigures figures;
    watch_.AddTo(figures);
    return figures;
  }
  std::string Logged() {
    std::string text = std::move(out_).str();
    out_.str("");
    return text;
  }

  std::ostringstream out_;
  Logger log_{Logger::Level::kInfo, Logger::Format::kText,
              std::make_shared<spdlog::sinks::ostream_sink_mt>(out_, true)};
  TimeWatch::Reading time_{.running = 50 * sync::kSecond,
                           .wall = int64_t{1'700'000'000} * sync::kSecond};
  TimeWatch watch_{log_, [this] { return time_; }};
};

TEST_F(TimeWatchTest, SaysNothingOfTurnsThatComeALittleLate) {
  Turn(TimeWatch::kTurn);
  Turn(TimeWatch::kTurn + TimeWatch::kPause - 1);
  Turn(0);
  Turn(TimeWatch::kTurn, TimeWatch::kStep - 1);
  Turn(TimeWatch::kTurn, -TimeWatch::kStep + 1);
  EXPECT_EQ(Logged(), "");
  EXPECT_EQ(figures().pauses, 0u);
  EXPECT_EQ(figures().clock_steps, 0u);
  EXPECT_EQ(figures().time_trouble, "");
}

TEST_F(TimeWatchTest, AClockThatIsSlewedNeverSteps) {
  for (int turn = 0; turn < 10'000; ++turn) Turn(TimeWatch::kTurn, sync::kMillisecond);
  EXPECT_EQ(figures().clock_steps, 0u);
}

TEST_F(TimeWatchTest, TellsThatTheDaemonDidNotRun) {
  Turn(TimeWatch::kTurn + 1'500 * sync::kMillisecond);
  EXPECT_THAT(Logged(),
              AllOf(HasSubstr("warning the daemon did not run"), HasSubstr("seconds=1.5")));
  EXPECT_EQ(figures().pauses, 1u);
  EXPECT_EQ(figures().clock_steps, 0u);
  EXPECT_EQ(figures().time_trouble, "the daemon did not run for 1.5 s until 0 s ago");
  Turn(TimeWatch::kTurn);
  EXPECT_EQ(Logged(), "") << "twice";

  Turn(TimeWatch::kTurn + TimeWatch::kPause);
  time_.running += 7 * sync::kSecond;
  EXPECT_EQ(figures().time_trouble,
            "the daemon did not run for 1.0 s until 7 s ago (2 times since the start)");
  time_.running += TimeWatch::kTold;
  EXPECT_EQ(figures().time_trouble, "");
  EXPECT_EQ(figures().pauses, 2u);
}

TEST_F(TimeWatchTest, TellsThatTheWallClockStepped) {
  Turn(TimeWatch::kTurn, 3600 * sync::kSecond);
  EXPECT_THAT(Logged(),
              AllOf(HasSubstr("warning the wall clock stepped"), HasSubstr("seconds=+3600.0")));
  EXPECT_EQ(figures().pauses, 0u);
  EXPECT_EQ(figures().clock_steps, 1u);
  EXPECT_EQ(figures().time_trouble, "the wall clock stepped by +3600.0 s 0 s ago");
  Turn(TimeWatch::kTurn);
  EXPECT_EQ(Logged(), "") << "it continues from there";

  Turn(TimeWatch::kTurn, -TimeWatch::kStep);
  EXPECT_THAT(Logged(), HasSubstr("seconds=-0.5"));
  EXPECT_EQ(figures().clock_steps, 2u);
}

TEST_F(TimeWatchTest, TellsOfBothAtOnce) {
  Turn(TimeWatch::kTurn + 2 * sync::kSecond, -2 * sync::kSecond);
  EXPECT_EQ(figures().time_trouble,
            "the daemon did not run for 2.0 s until 0 s ago; the wall clock stepped by -2.0 s 0 s "
            "ago");
}

TEST(TimeWatchOfSystem, GoesOnByBothClocks) {
  const TimeWatch::Reading first = TimeWatch::OfSystem();
  const TimeWatch::Reading then = TimeWatch::OfSystem();
  EXPECT_GT(first.wall, int64_t{1'600'000'000} * sync::kSecond);
  EXPECT_GT(first.running, 0);
  EXPECT_GE(then.running, first.running);
}

}  // namespace
}  // namespace voxeld::daemon
