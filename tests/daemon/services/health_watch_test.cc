#include "daemon/services/health_watch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>

#include <memory>
#include <optional>
#include <sstream>

namespace voxeld::daemon::services {
namespace {

using display::DisplayState;
using What = EngineEvent::What;

class HealthWatchTest : public ::testing::Test {
 protected:
  Logger log_{Logger::Level::kOff, Logger::Format::kText};
  HealthWatch watch_{log_};
  std::optional<bool> serving_;
};

TEST_F(HealthWatchTest, IsOfEveryDisplay) {
  watch_.Tell([this](bool serving) { serving_ = serving; });
  EXPECT_EQ(serving_, true);
  watch_.OnDisplay("a", DisplayState::kShowing, "");
  watch_.OnDisplay("b", DisplayState::kLost, "unplugged");
  EXPECT_EQ(serving_, false);
  watch_.OnDisplay("a", DisplayState::kShowing, "");
  EXPECT_EQ(serving_, false);
  watch_.OnDisplay("b", DisplayState::kAttaching, "");  // not back yet
  EXPECT_EQ(serving_, false);
  watch_.OnDisplay("b", DisplayState::kShowing, "");
  EXPECT_EQ(serving_, true);
  watch_.OnDisplay("b", DisplayState::kLost, "");
  watch_.OnDisplay("b", DisplayState::kBlanked, "");
  EXPECT_EQ(serving_, true);
}

TEST(HealthWatch, TransfersThatFailAreForTheLogAlone) {
  std::ostringstream out;
  Logger log(Logger::Level::kInfo, Logger::Format::kText,
             std::make_shared<spdlog::sinks::ostream_sink_mt>(out, true));
  HealthWatch watch(log);
  bool serving = false;
  watch.Tell([&serving](bool told) { serving = told; });
  watch.OnTransfers("a", 3);
  EXPECT_TRUE(serving);
  EXPECT_THAT(out.str(), ::testing::HasSubstr("warning transfers failed display=a transfers=3"));
}

TEST_F(HealthWatchTest, IsOfWhatIsDrawnToo) {
  watch_.OnEngine({"a", What::kLost, "hung"});
  watch_.OnEngine({"a", What::kHolding, "hung"});
  watch_.Tell([this](bool serving) { serving_ = serving; });
  EXPECT_EQ(serving_, false);  // the state now, not that when the watcher started
  watch_.OnDisplay("a", DisplayState::kLost, "unplugged");
  watch_.OnEngine({"a", What::kTookOver, "hung", 5});
  EXPECT_EQ(serving_, false);
  watch_.OnDisplay("a", DisplayState::kShowing, "");
  EXPECT_EQ(serving_, true);
  watch_.OnEngine({"a", What::kHolding, ""});
  watch_.OnEngine({"a", What::kNotHeld, ""});
  EXPECT_EQ(serving_, true);
  watch_.Tell(nullptr);
  watch_.OnDisplay("a", DisplayState::kLost, "");
  EXPECT_EQ(serving_, true);
}

}  // namespace
}  // namespace voxeld::daemon::services
