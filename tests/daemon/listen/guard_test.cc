// Tests the guard's rules, under a clock that is moved by hand and with numbers as sockets.
#include "daemon/listen/guard.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <string>
#include <vector>

#include "absl/strings/match.h"
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
  int cuts = 0, armed = 0;
  bool gone = false, trusted = false;
};

class FakeWire final : public Wire {
 public:
  explicit FakeWire(Line& line) : line_(line) {}
  ~FakeWire() override { line_.gone = true; }
  uint64_t BytesReceived() override { return line_.bytes; }
  void Cut() override { ++line_.cuts; }
  void Trust() override { line_.trusted = true; }
  void Arm() override { ++line_.armed; }

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
                                            .unauthorised_bytes = 1600,
                                            .unauthorised_limit_ns = 8 * sync::kSecond,
                                            .max_message_bytes = 10'000,
                                            .lookahead_bytes = 500,
                                            .cut_penalty_ns = sync::kSecond,
                                            .max_cancelled_calls_per_second = 10};
  // The amounts that are not limited: thirteen sixteenths of the bytes, fifteen of the time.
  static constexpr uint64_t kFreeBytes = 1300;
  static constexpr sync::TimeNs kFreeTime = 7'500 * sync::kMillisecond;

  ConnectionId Enter(const Peer& peer, Line& line, bool own = false) {
    return guard_.Enter(peer, own, std::make_unique<FakeWire>(line));
  }

  // Calls Look as often as the guard asks for it.
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
  line_.bytes = 1600;
  guard_.OnBytes(id);
  EXPECT_EQ(line_.cuts, 0);
  line_.bytes = 1601;
  guard_.OnBytes(id);
  guard_.Look();
  guard_.OnMessage(Tcp(1).name);
  EXPECT_EQ(line_.cuts, 1);
  EXPECT_EQ(counters_.Read().cut_for_bytes, 1u);
  EXPECT_EQ(line_.armed, 1) << "its close must be reported";
  EXPECT_FALSE(line_.gone) << "until it is known to be closed";
  guard_.Leave(id);
  EXPECT_TRUE(line_.gone);
  EXPECT_EQ(counters_.Read().cut_for_bytes, 1u);
}

TEST_F(GuardTest, TheLastSixteenthsOfTheBytesAreLeftForAMoment) {
  Enter(Tcp(1), line_);
  line_.bytes = kFreeBytes;
  Pass(sync::kSecond);
  line_.bytes = kFreeBytes + 1;
  guard_.Look();
  Pass(Guard::kGrace - sync::kMillisecond);
  EXPECT_EQ(line_.cuts, 0);
  Pass(sync::kMillisecond);
  EXPECT_EQ(line_.cuts, 1);
  EXPECT_EQ(counters_.Read().cut_for_bytes, 1u);
}

TEST_F(GuardTest, BytesThatNobodyToldOfAreSeenByTheNextLook) {
  Enter(Tcp(1), line_);
  EXPECT_EQ(guard_.Look(), clock_.Now() + Guard::kLookInterval);
  line_.bytes = 1601;
  EXPECT_EQ(guard_.Look(), sync::kNever) << "no connection is left to check";
  EXPECT_EQ(line_.cuts, 1);
}

TEST_F(GuardTest, WhoEndsItFirstIsCountedAndPunishedTheSame) {
  const ConnectionId id = Enter(Tcp(1), line_);
  line_.bytes = 1601;  // and reset, before Look was called
  guard_.Leave(id);
  EXPECT_EQ(line_.cuts, 1) << "bytes that gRPC has not read are discarded";
  EXPECT_TRUE(line_.gone);
  EXPECT_EQ(counters_.Read().cut_for_bytes, 1u);
  EXPECT_FALSE(guard_.MayEnter(Tcp(2)).ok());
}

TEST_F(GuardTest, CutsBeforeTheTimeIsOver) {
  Enter(Tcp(1), line_);
  Pass(kFreeTime - 1);
  EXPECT_EQ(line_.cuts, 0);
  Pass(1);
  EXPECT_EQ(line_.cuts, 1);
  EXPECT_EQ(counters_.Read().cut_for_time, 1u);
  EXPECT_TRUE(guard_.MayEnter(Tcp(2)).ok()) << "silence is not punished";
}

TEST_F(GuardTest, AuthorisedIsFreeForGood) {
  const ConnectionId id = Enter(Tcp(1), line_);
  line_.bytes = kFreeBytes;
  EXPECT_FALSE(line_.trusted);
  guard_.OnAnswer(Tcp(1).name, true);
  EXPECT_TRUE(line_.trusted);
  line_.bytes = uint64_t{1} << 40;
  guard_.OnBytes(id);
  EXPECT_EQ(guard_.Look(), sync::kNever);
  Pass(60 * sync::kSecond);
  EXPECT_EQ(line_.cuts, 0);
}

TEST_F(GuardTest, AnAnswerThatAnybodyGetsBeginsBytesAndTimeAnewAndAuthorisesNobody) {
  Enter(Tcp(1), line_);
  for (int i = 0; i < 5; ++i) {
    Pass(kFreeTime - sync::kSecond);
    guard_.OnMessage(Tcp(1).name);
    line_.bytes += kFreeBytes;
    guard_.OnAnswer(Tcp(1).name, false);
    guard_.OnCallEnd(Tcp(1).name);
    EXPECT_EQ(line_.cuts, 0);
    EXPECT_FALSE(line_.trusted);
  }
  line_.bytes += 1601;
  guard_.Look();
  EXPECT_EQ(line_.cuts, 1);

  Line& silent = lines_[0];
  Pass(10 * sync::kSecond);
  Enter(Tcp(2), silent);
  Pass(sync::kSecond);
  guard_.OnMessage(Tcp(2).name);
  guard_.OnAnswer(Tcp(2).name, false);
  guard_.OnCallEnd(Tcp(2).name);
  Pass(kFreeTime);
  EXPECT_EQ(silent.cuts, 1);
}

TEST_F(GuardTest, AnAnswerBeyondTheLimitAuthorisesNobodyHoweverFastItWas) {
  Enter(Tcp(1), line_);
  line_.bytes = 1601;  // in no time: neither OnBytes nor Look was called in between
  guard_.OnAnswer(Tcp(1).name, true);
  EXPECT_EQ(line_.cuts, 1);
  EXPECT_FALSE(line_.trusted);
  EXPECT_EQ(counters_.Read().cut_for_bytes, 1u);
}

TEST_F(GuardTest, TimeStandsStillWhileTheDaemonOwesAnAnswerBytesDoNot) {
  Enter(Tcp(1), line_);
  guard_.OnMessage(Tcp(1).name);
  Pass(60 * sync::kSecond);
  EXPECT_EQ(line_.cuts, 0);
  guard_.OnCallEnd(Tcp(1).name);  // refused: its time starts again
  Pass(kFreeTime - 1);
  EXPECT_EQ(line_.cuts, 0);
  Pass(1);
  EXPECT_EQ(line_.cuts, 1);

  Line& other = lines_[0];
  Enter(Tcp(2), other);
  guard_.OnMessage(Tcp(2).name);
  other.bytes = 1601;
  guard_.Look();
  EXPECT_EQ(other.cuts, 1);
}

TEST_F(GuardTest, AWrongGreetingIsCutCountedAndPunished) {
  const ConnectionId id = Enter(Tcp(1), line_);
  guard_.OnWrongGreeting(id, "it begins with \"GET\"");
  guard_.OnWrongGreeting(id, "once more");
  EXPECT_EQ(line_.cuts, 1);
  EXPECT_EQ(counters_.Read().cut_for_greeting, 1u);
  EXPECT_FALSE(guard_.MayEnter(Tcp(2)).ok());
}

TEST_F(GuardTest, TheAddressOfWhatWasCutIsRefusedTwiceAsLongEachTime) {
  sync::TimeNs length = kLimits.cut_penalty_ns;
  for (int times = 0; times < 9; ++times) {
    const ConnectionId id = Enter(Tcp(times), line_);
    guard_.OnWrongGreeting(id, "");
    guard_.Leave(id);
    const absl::Status refused = guard_.MayEnter(Tcp(8));
    EXPECT_TRUE(absl::IsUnavailable(refused));
    EXPECT_THAT(std::string(refused.message()), HasSubstr("cut_penalty_ns"));
    EXPECT_TRUE(guard_.MayEnter(Tcp(8, "192.0.2.2")).ok()) << "others are not";
    clock_.Advance(length - 1);
    EXPECT_FALSE(guard_.MayEnter(Tcp(8)).ok());
    clock_.Advance(1);
    EXPECT_TRUE(guard_.MayEnter(Tcp(8)).ok());
    length = std::min(2 * length, Guard::kLongestPenalty * kLimits.cut_penalty_ns);
  }
  EXPECT_EQ(counters_.Read().refused_after_cut, 18u);
  clock_.Advance(length);  // as long as it was last refused
  guard_.OnWrongGreeting(Enter(Tcp(1), line_), "");
  clock_.Advance(kLimits.cut_penalty_ns);
  EXPECT_TRUE(guard_.MayEnter(Tcp(8)).ok()) << "the penalty starts again";
}

TEST_F(GuardTest, WhatIsCutTogetherIsPunishedOnce) {
  ConnectionId ids[3];
  for (int i = 0; i < 3; ++i) ids[i] = Enter(Tcp(i), lines_[i]);
  for (const ConnectionId id : ids) guard_.OnWrongGreeting(id, "");
  clock_.Advance(kLimits.cut_penalty_ns);
  EXPECT_FALSE(absl::StrContains(guard_.MayEnter(Tcp(8)).message(), "cut_penalty_ns"));
}

TEST_F(GuardTest, TheDaemonsOwnAddressIsNotPunished) {
  guard_.OnWrongGreeting(Enter(Tcp(1), line_, true), "");
  EXPECT_EQ(line_.cuts, 1);
  EXPECT_TRUE(guard_.MayEnter(Tcp(2)).ok());
}

TEST_F(GuardTest, PenaltiesAreAsManyAsThereAreToBeAtMost) {
  for (size_t i = 0; i <= Guard::kMostPenalties; ++i) {
    Line line;
    const Peer peer = Tcp(1, absl::StrCat("192.0.2.", i));
    const ConnectionId id = Enter(peer, line);
    guard_.OnWrongGreeting(id, "");
    guard_.Leave(id);
    clock_.Advance(1);
  }
  EXPECT_TRUE(guard_.MayEnter(Tcp(1, "192.0.2.0")).ok()) << "the oldest made room";
  EXPECT_FALSE(guard_.MayEnter(Tcp(1, "192.0.2.1")).ok());
}

Guard::Busy Of(const Line& line, int port = 1) { return {Tcp(port).name, line.bytes}; }

TEST_F(GuardTest, CancelledCallsAreCountedASecondAuthorisedOrNot) {
  for (const bool authorised : {false, true}) {
    Line& line = lines_[authorised ? 1 : 0];
    const ConnectionId id = Enter(Tcp(1), line);
    if (authorised) guard_.OnAnswer(Tcp(1).name, true);
    uint64_t cancelled = 0;
    for (int second = 0; second < 5; ++second) {
      for (int i = 0; i < 10; ++i) guard_.OnFigures(Of(line), {.cancelled = ++cancelled});
      clock_.Advance(sync::kSecond);
      guard_.OnFigures(Of(line), {.cancelled = cancelled});
    }
    EXPECT_EQ(line.cuts, 0);
    guard_.OnFigures(Of(line), {.cancelled = cancelled + 10});
    EXPECT_EQ(line.cuts, 0);
    guard_.OnFigures(Of(line), {.cancelled = cancelled + 11});
    EXPECT_EQ(line.cuts, 1);
    EXPECT_FALSE(guard_.MayEnter(Tcp(2)).ok());
    guard_.Leave(id);
    clock_.Advance(10 * sync::kSecond);
  }
  EXPECT_EQ(counters_.Read().cut_for_cancelling, 2u);
}

TEST_F(GuardTest, BytesOfWhichNothingComesAreCutThoughTheConnectionIsAuthorised) {
  Enter(Tcp(1), line_);
  guard_.OnAnswer(Tcp(1).name, true);
  uint64_t progress = 1;
  for (int i = 0; i < 10; ++i) {  // messages of the greatest size
    line_.bytes += kLimits.max_message_bytes + kLimits.lookahead_bytes;
    guard_.OnFigures(Of(line_), {.progress = progress, .open = 1});
    guard_.OnFigures(Of(line_), {.progress = ++progress, .open = 1});
  }
  EXPECT_EQ(line_.cuts, 0);
  line_.bytes += kLimits.max_message_bytes + 3 * kLimits.lookahead_bytes;
  guard_.OnFigures(Of(line_), {.progress = progress, .open = 3});
  EXPECT_EQ(line_.cuts, 0);
  ++line_.bytes;
  guard_.OnFigures(Of(line_), {.progress = progress, .open = 3});
  EXPECT_EQ(line_.cuts, 1);
  EXPECT_EQ(counters_.Read().cut_for_flooding, 1u);
  EXPECT_FALSE(guard_.MayEnter(Tcp(2)).ok());
}

std::vector<std::string> Names(const std::vector<Guard::Busy>& busy) {
  std::vector<std::string> out;
  for (const Guard::Busy& one : busy) out.push_back(one.peer);
  return out;
}

TEST_F(GuardTest, BusyAreThoseWhoseBytesWereToldOfAndNobodyElseIsLookedAt) {
  int told = 0;
  guard_.SetOnBusy([&] { ++told; });
  const ConnectionId first = Enter(Tcp(1), line_);
  const ConnectionId second = Enter(Tcp(2), lines_[0]);
  line_.bytes = lines_[0].bytes = 100;
  EXPECT_THAT(guard_.TakeBusy(), IsEmpty()) << "no bytes were reported";
  guard_.OnBytes(first);
  guard_.OnBytes(second);
  EXPECT_EQ(told, 1) << "once until they are taken";
  EXPECT_THAT(Names(guard_.TakeBusy()), ElementsAre(Tcp(1).name, Tcp(2).name));
  EXPECT_THAT(guard_.TakeBusy(), IsEmpty());
  EXPECT_EQ(line_.armed, 0) << "unauthorised connections report all bytes";

  guard_.OnAnswer(Tcp(1).name, true);
  EXPECT_EQ(line_.armed, 1);
  line_.bytes = 200;
  guard_.OnBytes(first);
  EXPECT_EQ(told, 2);
  EXPECT_EQ(line_.armed, 1) << "no further bytes are reported before these are taken";
  const std::vector<Guard::Busy> busy = guard_.TakeBusy();
  ASSERT_THAT(Names(busy), ElementsAre(Tcp(1).name));
  EXPECT_EQ(busy[0].bytes, 200u);
  EXPECT_EQ(line_.armed, 2);
  guard_.OnBytes(first);
  guard_.Leave(first);
  EXPECT_THAT(guard_.TakeBusy(), IsEmpty());
  guard_.SetOnBusy(nullptr);
}

TEST_F(GuardTest, UnixSocketsAreFreeOfBytesAndTime) {
  const ConnectionId id = Enter({"unix:", "user 1000", true}, line_);
  line_.bytes = 1 << 20;
  guard_.OnBytes(id);
  Pass(60 * sync::kSecond);
  EXPECT_EQ(line_.cuts, 0);
}

TEST_F(GuardTest, LimitsAuthorisedConnectionsByAddressAndInAll) {
  const auto authorised = [this](const Peer& peer, Line& line) {
    const ConnectionId id = Enter(peer, line);
    guard_.OnAnswer(peer.name, true);
    return id;
  };
  for (int i = 0; i < 3; ++i) authorised(Tcp(i), lines_[i]);
  const absl::Status same = guard_.MayEnter(Tcp(9));
  EXPECT_TRUE(absl::IsResourceExhausted(same));
  EXPECT_THAT(std::string(same.message()), HasSubstr("max_connections_per_address"));
  EXPECT_TRUE(guard_.MayEnter(Tcp(9, "192.0.2.2")).ok());
  ConnectionId last = 0;
  for (int i = 3; i < 5; ++i) last = authorised(Tcp(i, "192.0.2.2"), lines_[i]);
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

TEST_F(GuardTest, TheStrangerThatIsIdleLongestMakesRoom) {
  for (int i = 0; i < 3; ++i) {
    Enter(Tcp(i), lines_[i]);
    Pass(100 * sync::kMillisecond);
  }
  guard_.OnMessage(Tcp(0).name);  // busy, so not idle
  EXPECT_TRUE(guard_.MayEnter(Tcp(9)).ok());
  EXPECT_EQ(lines_[0].cuts, 0);
  EXPECT_EQ(lines_[1].cuts, 1);
  EXPECT_EQ(lines_[2].cuts, 0);
  EXPECT_EQ(counters_.Read().cut_for_room, 1u);
  EXPECT_EQ(counters_.Read().refused_by_address, 0u);
  EXPECT_TRUE(guard_.MayEnter(Tcp(10)).ok()) << "its address is not punished";
}

TEST_F(GuardTest, TheStrangerThatIsIdleLongestMakesRoomForAnotherAddress) {
  const std::vector<std::string> addresses = {"192.0.2.1", "192.0.2.2"};
  for (int i = 0; i < 5; ++i) Enter(Tcp(i, addresses[i / 3]), lines_[i]);
  Pass(Guard::kFirstCall);
  EXPECT_TRUE(guard_.MayEnter(Tcp(9, "192.0.2.3")).ok());
  EXPECT_EQ(lines_[0].cuts, 1);
}

TEST_F(GuardTest, EachConnectionHasTimeForItsFirstCall) {
  for (int i = 0; i < 6; ++i) {
    ASSERT_TRUE(guard_.MayEnter(Tcp(i)).ok()) << i << ": others are young, and it may be beyond";
    Enter(Tcp(i), lines_[i]);
  }
  for (int i = 0; i < 6; ++i) EXPECT_EQ(lines_[i].cuts, 0) << i;
  EXPECT_FALSE(guard_.MayEnter(Tcp(9)).ok()) << "twice the limit";
  Pass(Guard::kFirstCall + Guard::kLookInterval);
  int cuts = 0;
  for (int i = 0; i < 6; ++i) cuts += lines_[i].cuts;
  EXPECT_EQ(cuts, 3) << "at most the limit have stayed";
  EXPECT_EQ(lines_[5].cuts, 0) << "the youngest";
}

TEST_F(GuardTest, ThoseBeyondTheLimitMayNotAllBeAuthorised) {
  for (int i = 0; i < 4; ++i) {
    ASSERT_TRUE(guard_.MayEnter(Tcp(i)).ok());
    Enter(Tcp(i), lines_[i]);
  }
  for (int i = 0; i < 4; ++i) guard_.OnAnswer(Tcp(i).name, true);
  EXPECT_EQ(lines_[2].cuts, 0);
  EXPECT_EQ(lines_[3].cuts, 1);
  EXPECT_TRUE(lines_[2].trusted);
  EXPECT_FALSE(lines_[3].trusted);
}

TEST_F(GuardTest, ACallThatGoesOnAfterItsAnswerKeepsNobodyAway) {
  for (int i = 0; i < 3; ++i) {
    Enter(Tcp(i), lines_[i]);
    guard_.OnMessage(Tcp(i).name);
    guard_.OnAnswer(Tcp(i).name, false);  // a health call, which continues
  }
  Pass(Guard::kFirstCall);
  EXPECT_TRUE(guard_.MayEnter(Tcp(9)).ok());
  EXPECT_EQ(lines_[0].cuts, 1);
}

TEST_F(GuardTest, UsersOfUnixSocketsAreLimitedAsTheyAre) {
  const Peer user{"unix:", "user 1000", true};
  for (int i = 0; i < 3; ++i) Enter(user, lines_[i]);
  Pass(Guard::kFirstCall);
  EXPECT_FALSE(guard_.MayEnter(user).ok());
  for (int i = 0; i < 3; ++i) EXPECT_EQ(lines_[i].cuts, 0);
}

TEST_F(GuardTest, TheDaemonsOwnCountAgainstNothingAndAreGuarded) {
  for (int i = 0; i < 8; ++i) Enter(Tcp(i), lines_[i], true);
  EXPECT_TRUE(guard_.MayEnter(Tcp(9)).ok());
  EXPECT_EQ(counters_.Read().open, 0u);
  EXPECT_EQ(counters_.Read().accepted, 0u);
  lines_[3].bytes = 1601;
  guard_.Look();
  EXPECT_EQ(lines_[3].cuts, 1);
}

TEST_F(GuardTest, ANameThatComesAgainIsTheNewConnections) {
  const ConnectionId old = Enter(Tcp(1), line_);
  Line& fresh = lines_[0];
  Enter(Tcp(1), fresh);
  guard_.OnAnswer(Tcp(1).name, true);
  guard_.Leave(old);
  fresh.bytes = 1 << 20;
  guard_.Look();
  EXPECT_EQ(fresh.cuts, 0);
  guard_.OnFigures(Of(fresh), {.cancelled = 11});
  EXPECT_EQ(fresh.cuts, 1) << "it is still known by its name";
  EXPECT_EQ(line_.cuts, 0);
}

TEST_F(GuardTest, NobodysCallsAreIgnored) {
  guard_.OnMessage("ipv4:203.0.113.1:1");
  guard_.OnAnswer("ipv4:203.0.113.1:1", true);
  guard_.OnCallEnd("ipv4:203.0.113.1:1");
  guard_.OnFigures({"ipv4:203.0.113.1:1", 1 << 30}, {.cancelled = 1000});
  EXPECT_EQ(guard_.Look(), sync::kNever);
}

}  // namespace
}  // namespace voxeld::daemon::listen
