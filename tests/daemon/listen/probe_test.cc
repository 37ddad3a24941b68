// Tests when the probe reports that clients cannot connect, under a clock that is moved by hand.
#include "daemon/listen/probe.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <map>
#include <thread>

#include "display/sync/fake_clock.h"

namespace voxeld::daemon::listen {
namespace {

using ::testing::ElementsAre;

class ProbeTest : public ::testing::Test {
 protected:
  static constexpr sync::TimeNs kInterval = 5 * sync::kSecond;

  ProbeTest()
      : probe_(
            {{{}, "a"}, {{}, "b"}}, kInterval,
            [this](const ProbeTarget& target) {
              sync::MutexLock lock(mutex_);
              ++tried_;
              return answers_[target.text];
            },
            [this](bool reachable) { changes_.push_back(reachable); }, counters_, clock_, nullptr) {
    AwaitIdle(0);
  }

  // Waits until the probe's thread has made that many attempts, and waits for the time to come.
  void AwaitIdle(int attempts) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    for (;;) {
      {
        sync::MutexLock lock(mutex_);
        if (tried_ == attempts && clock_.waiters() == 1) return;
      }
      ASSERT_LT(std::chrono::steady_clock::now(), end) << tried_ << " attempts";
      std::this_thread::yield();
    }
  }

  void Round(const absl::Status& a, const absl::Status& b) {
    {
      sync::MutexLock lock(mutex_);
      answers_ = {{"a", a}, {"b", b}};
      tried_ = 0;
    }
    clock_.Advance(kInterval);
    AwaitIdle(2);
  }

  sync::FakeClock clock_;
  Counters counters_;
  sync::Mutex mutex_;
  std::map<std::string, absl::Status> answers_;
  int tried_ = 0;
  std::vector<bool> changes_;
  Probe probe_;
};

const absl::Status kWell;
const absl::Status kDeaf = absl::DeadlineExceededError("no answer came in time");

TEST_F(ProbeTest, OneFailureIsNone) {
  for (int i = 0; i < 3; ++i) {
    Round(kDeaf, kWell);
    Round(kWell, kDeaf);
  }
  EXPECT_THAT(changes_, ElementsAre());
  EXPECT_EQ(counters_.Read().unreachable, "");
  EXPECT_EQ(counters_.Read().probe_failures, 6u);
}

TEST_F(ProbeTest, TwoInARowOfOneAddressAreSaidOnceAndTakenBackByASuccess) {
  Round(kWell, kDeaf);
  Round(kWell, kDeaf);
  EXPECT_THAT(changes_, ElementsAre(false));
  EXPECT_EQ(counters_.Read().unreachable, "b: no answer came in time");
  Round(kWell, kDeaf);
  EXPECT_THAT(changes_, ElementsAre(false));
  Round(kWell, kWell);
  EXPECT_THAT(changes_, ElementsAre(false, true));
  EXPECT_EQ(counters_.Read().unreachable, "");
}

}  // namespace
}  // namespace voxeld::daemon::listen
