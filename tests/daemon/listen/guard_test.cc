// The guard's rules, under a clock that is moved by hand and sockets that are numbers.
#include "daemon/listen/guard.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <deque>
#include <string>

#include "absl/strings/str_cat.h"
#include "display/sync/fake_clock.h"

namespace voxeld::daemon::listen {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// A connection, as the test sees it: it outlives the guard's wire.
struct Line {
  uint64_t bytes = 0;
  int cuts = 0;
  bool gone = false;
};

class FakeWire final : public Wire {
 public:
  explicit FakeWire(Line& line) : line_(line) {}
  ~FakeWire() override { line_.gone = true; }
  uint64_t BytesReceived() override { return line_.bytes; }
  void Cut() override { ++line_.cuts; }

 private:
  Line& line_;
};

Peer Tcp(int port, const std::string& address = "192.0.2.1") {
  return {absl::StrCat("ipv4:", address, ":", port), address, false};
}

class GuardTest : public ::testing::Test {
 protected:
  static constexpr ConnectionLimits kLimits{.max_connections = 5,
                                            .max_connections_per_address = 3,
                                            .unauthorised_bytes = 1000,
                                            .unauthorised_limit_ns = 5 * sync::kSecond,
                                            .max_cancelled_calls_per_second = 10};

  ConnectionId Enter(const Peer& peer, Line& line, bool own = false) {
    return guard_.Enter(peer, own, std::make_unique<FakeWire>(line));
  }

  // Looks as often as the guard asks for it.
  void Pass(sync::TimeNs time) {
    const sync::TimeNs end = clock_.Now() + time;
    while (clock_.Now() < end) {
      clock_.AdvanceTo(std::min(end, clock_.Now() + Guard::kLookInterval));
      guard_.Look();
    }
  }

  sync::FakeClock clock_;
  Counters counters_;
  std::deque<Line> lines_ = std::deque<Line>(9);  // they outlive the guard
  Line& line_ = lines_[8];
  Guard guard_{kLimits, clock_, counters_, nullptr};
};

TEST_F(GuardTest, CutsAtTheFirstByteBeyondTheLimitAndOnce) {
  const ConnectionId id = Enter(Tcp(1), line_);
  line_.bytes = 1000;
  EXPECT_TRUE(guard_.OnBytes(id));
  EXPECT_EQ(line_.cuts, 0);
  line_.bytes = 1001;
  EXPECT_FALSE(guard_.OnBytes(id));
  guard_.Look();
  guard_.OnMessage(Tcp(1).name);
  EXPECT_EQ(line_.cuts, 1);
  EXPECT_EQ(counters_.Read().cut_for_bytes, 1u);
  EXPECT_FALSE(line_.gone) << "until it is known to be closed";
  guard_.Leave(id);
  EXPECT_TRUE(line_.gone);
}

TEST_F(GuardTest, BytesThatNobodyToldOfAreSeenByTheNextLook) {
  Enter(Tcp(1), line_);
  EXPECT_EQ(guard_.Look(), clock_.Now() + Guard::kLookInterval);
  line_.bytes = 1001;
  EXPECT_EQ(guard_.Look(), sync::kNever) << "nobody is left to be looked at";
  EXPECT_EQ(line_.cuts, 1);
}

TEST_F(GuardTest, CutsWhenTheTimeIsOver) {
  Enter(Tcp(1), line_);
  Pass(kLimits.unauthorised_limit_ns - 1);
  EXPECT_EQ(line_.cuts, 0);
  Pass(1);
  EXPECT_EQ(line_.cuts, 1);
  EXPECT_EQ(counters_.Read().cut_for_time, 1u);
}

TEST_F(GuardTest, AuthorisedIsFreeForGood) {
  const ConnectionId id = Enter(Tcp(1), line_);
  line_.bytes = 1000;
  guard_.OnAuthorised(Tcp(1).name);
  line_.bytes = uint64_t{1} << 40;
  EXPECT_FALSE(guard_.OnBytes(id)) << "of no interest any more";
  EXPECT_EQ(guard_.Look(), sync::kNever);
  Pass(60 * sync::kSecond);
  EXPECT_EQ(line_.cuts, 0);
}

TEST_F(GuardTest, AFirstRequestBeyondTheLimitIsCutHoweverFastItWas) {
  Enter(Tcp(1), line_);
  line_.bytes = 1001;  // in no time: neither OnBytes nor Look had a chance
  guard_.OnAuthorised(Tcp(1).name);
  EXPECT_EQ(line_.cuts, 1);
  EXPECT_EQ(counters_.Read().cut_for_bytes, 1u);
}

TEST_F(GuardTest, TimeStandsStillWhileTheDaemonOwesAnAnswerBytesDoNot) {
  Enter(Tcp(1), line_);
  guard_.OnMessage(Tcp(1).name);
  Pass(60 * sync::kSecond);
  EXPECT_EQ(line_.cuts, 0);
  guard_.OnCallEnd(Tcp(1).name);  // refused: it begins anew
  Pass(kLimits.unauthorised_limit_ns - 1);
  EXPECT_EQ(line_.cuts, 0);
  Pass(1);
  EXPECT_EQ(line_.cuts, 1);

  Line& other = lines_[0];
  Enter(Tcp(2), other);
  guard_.OnMessage(Tcp(2).name);
  other.bytes = 1001;
  guard_.Look();
  EXPECT_EQ(other.cuts, 1);
}

TEST_F(GuardTest, CancelledCallsAreCountedASecondAlsoOfTheAuthorised) {
  Enter(Tcp(1), line_);
  guard_.OnAuthorised(Tcp(1).name);
  uint64_t cancelled = 0;
  for (int second = 0; second < 5; ++second) {
    for (int i = 0; i < 10; ++i) guard_.OnCancelled(Tcp(1).name, ++cancelled);
    clock_.Advance(sync::kSecond);
    guard_.OnCancelled(Tcp(1).name, cancelled);
  }
  EXPECT_EQ(line_.cuts, 0);
  guard_.OnCancelled(Tcp(1).name, cancelled + 10);
  EXPECT_EQ(line_.cuts, 0);
  guard_.OnCancelled(Tcp(1).name, cancelled + 11);
  EXPECT_EQ(line_.cuts, 1);
  EXPECT_EQ(counters_.Read().cut_for_cancelling, 1u);
}

TEST_F(GuardTest, BusyAreTheAuthorisedThatGotBytesSinceItWasAsked) {
  Enter(Tcp(1), line_);
  Enter(Tcp(2), lines_[0]);
  line_.bytes = lines_[0].bytes = 100;
  EXPECT_THAT(guard_.Busy(), IsEmpty());
  guard_.OnAuthorised(Tcp(1).name);
  EXPECT_THAT(guard_.Busy(), ElementsAre(Tcp(1).name));
  EXPECT_THAT(guard_.Busy(), IsEmpty());
  line_.bytes = 101;
  EXPECT_THAT(guard_.Busy(), ElementsAre(Tcp(1).name));
}

TEST_F(GuardTest, UnixSocketsAreFreeOfBytesAndTime) {
  const ConnectionId id = Enter({"unix:", "user 1000", true}, line_);
  line_.bytes = 1 << 20;
  EXPECT_FALSE(guard_.OnBytes(id));
  Pass(60 * sync::kSecond);
  EXPECT_EQ(line_.cuts, 0);
}

TEST_F(GuardTest, LimitsConnectionsByAddressAndInAll) {
  for (int i = 0; i < 3; ++i) Enter(Tcp(i), lines_[i]);
  const absl::Status same = guard_.MayEnter(Tcp(9));
  EXPECT_TRUE(absl::IsResourceExhausted(same));
  EXPECT_THAT(std::string(same.message()), HasSubstr("max_connections_per_address"));
  EXPECT_TRUE(guard_.MayEnter(Tcp(9, "192.0.2.2")).ok());
  ConnectionId last = 0;
  for (int i = 3; i < 5; ++i) last = Enter(Tcp(i, "192.0.2.2"), lines_[i]);
  const absl::Status all = guard_.MayEnter(Tcp(9, "192.0.2.3"));
  EXPECT_TRUE(absl::IsResourceExhausted(all));
  EXPECT_EQ(all.message(), "5 connections are open, which is max_connections");
  guard_.Leave(last);
  EXPECT_TRUE(guard_.MayEnter(Tcp(9, "192.0.2.3")).ok());
  const ListenFigures figures = counters_.Read();
  EXPECT_EQ(figures.open, 4u);
  EXPECT_EQ(figures.accepted, 5u);
  EXPECT_EQ(figures.refused_by_address, 1u);
  EXPECT_EQ(figures.refused_in_all, 1u);
}

TEST_F(GuardTest, TheDaemonsOwnCountAgainstNothingAndAreGuarded) {
  for (int i = 0; i < 8; ++i) Enter(Tcp(i), lines_[i], true);
  EXPECT_TRUE(guard_.MayEnter(Tcp(9)).ok());
  EXPECT_EQ(counters_.Read().open, 0u);
  EXPECT_EQ(counters_.Read().accepted, 0u);
  lines_[3].bytes = 1001;
  guard_.Look();
  EXPECT_EQ(lines_[3].cuts, 1);
}

TEST_F(GuardTest, ANameThatComesAgainIsTheNewConnections) {
  const ConnectionId old = Enter(Tcp(1), line_);
  Line& fresh = lines_[0];
  Enter(Tcp(1), fresh);
  guard_.OnAuthorised(Tcp(1).name);
  guard_.Leave(old);
  fresh.bytes = 1 << 20;
  guard_.Look();
  EXPECT_EQ(fresh.cuts, 0);
  guard_.OnCancelled(Tcp(1).name, 11);
  EXPECT_EQ(fresh.cuts, 1) << "it is still known by its name";
  EXPECT_EQ(line_.cuts, 0);
}

TEST_F(GuardTest, NobodysCallsAreIgnored) {
  guard_.OnMessage("ipv4:203.0.113.1:1");
  guard_.OnAuthorised("ipv4:203.0.113.1:1");
  guard_.OnCallEnd("ipv4:203.0.113.1:1");
  guard_.OnCancelled("ipv4:203.0.113.1:1", 1000);
  EXPECT_EQ(guard_.Look(), sync::kNever);
}

}  // namespace
}  // namespace voxeld::daemon::listen
