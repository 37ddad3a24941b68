#include "daemon/process/segment_watch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>

#include <memory>
#include <sstream>
#include <string>

#include "display/sync/fake_clock.h"

namespace voxeld::daemon {
namespace {

using ::testing::HasSubstr;

class SegmentWatchTest : public ::testing::Test {
 protected:
  SegmentWatchTest() {
    refused_ = 5;
    watch_ = std::make_unique<SegmentWatch>(clock_, log_, [] { return refused_; });
  }

  std::string Logged() {
    std::string text = out_.str();
    out_.str("");
    return text;
  }
  std::string Trouble() const {
    ProcessFigures figures;
    watch_->AddTo(figures);
    EXPECT_EQ(figures.segments_refused, refused_);
    return figures.trouble;
  }

  static inline uint64_t refused_ = 0;
  std::ostringstream out_;
  Logger log_{Logger::Level::kInfo, Logger::Format::kText,
              std::make_shared<spdlog::sinks::ostream_sink_mt>(out_, true)};
  sync::FakeClock clock_{sync::kSecond};
  std::unique_ptr<SegmentWatch> watch_;
};

TEST_F(SegmentWatchTest, IgnoresRefusalsFromBeforeItExisted) {
  watch_->Look();
  EXPECT_EQ(Logged(), "");
  EXPECT_EQ(Trouble(), "");
}

TEST_F(SegmentWatchTest, LogsEachRefusalOnceAndDegradesHealthForAMinute) {
  refused_ = 8;
  watch_->Look();
  const std::string line = Logged();
  EXPECT_THAT(line, HasSubstr("warning the system had no memory for arrays or engines"));
  EXPECT_THAT(line, HasSubstr("times=3"));
  watch_->Look();
  EXPECT_EQ(Logged(), "") << "twice";
  clock_.Advance(2 * sync::kSecond);
  EXPECT_EQ(Trouble(),
            "the system had no memory for arrays or engines 2 s ago (8 times since the start)");
  clock_.Advance(SegmentWatch::kDegradedFor);
  EXPECT_EQ(Trouble(), "");
}

}  // namespace
}  // namespace voxeld::daemon
