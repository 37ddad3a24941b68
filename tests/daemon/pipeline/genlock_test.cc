#include "daemon/pipeline/genlock.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "display/sync/fake_clock.h"

namespace voxeld::daemon {
namespace {

using What = Genlock::Command::What;

constexpr sync::TimeNs kPeriod = 10 * sync::kMillisecond;

SnapshotPtr SnapshotOf(uint64_t number) {
  auto snapshot = std::make_shared<Snapshot>();
  snapshot->number = number;
  return snapshot;
}

class Locked : public ::testing::Test {
 protected:
  // Adds members whose sweeps begin that long after the clock's whole periods.
  void Join(const std::vector<sync::TimeNs>& phases) {
    clock_.AdvanceTo(100 * kPeriod);
    for (size_t m = 0; m < phases.size(); ++m) {
      EXPECT_EQ(genlock_.Add([this] { ++wakes_; }), m);
      genlock_.SetPresent(m, true);
      genlock_.SetSweeps(m, 100 * kPeriod + phases[m], kPeriod);
    }
    members_ = phases.size();
  }
  // Makes all hold a round. Returns its number.
  uint64_t Hold(uint64_t snapshot) {
    genlock_.Want(0, SnapshotOf(snapshot));
    const auto round = genlock_.ToDraw(0);
    EXPECT_TRUE(round.has_value());
    if (!round.has_value()) return 0;
    EXPECT_EQ(round->snapshot->number, snapshot);
    for (size_t m = 0; m < members_; ++m) {
      EXPECT_EQ(genlock_.NextCommand(m).what, What::kNothing);
      EXPECT_EQ(genlock_.ToDraw(m)->volume, round->volume);
    }
    for (size_t m = 0; m < members_; ++m) genlock_.Held(m, round->volume);
    return round->volume;
  }
  std::vector<Genlock::Command> Orders(What what = What::kShow) {
    std::vector<Genlock::Command> orders;
    for (size_t m = 0; m < members_; ++m) {
      orders.push_back(genlock_.NextCommand(m));
      EXPECT_EQ(orders.back().what, what) << "member " << m;
      EXPECT_EQ(genlock_.NextCommand(m).what, What::kNothing) << "twice";
    }
    return orders;
  }

  sync::FakeClock clock_;
  Genlock genlock_{clock_};
  size_t members_ = 0;
  int wakes_ = 0;
};

TEST_F(Locked, AllAreOrderedOnceAllHold) {
  Join({0, 3 * sync::kMillisecond});
  genlock_.Want(1, SnapshotOf(7));
  const auto round = genlock_.ToDraw(0);
  ASSERT_TRUE(round.has_value());
  EXPECT_EQ(round->volume, 1u);
  EXPECT_EQ(genlock_.ToDraw(1)->volume, 1u);
  genlock_.Held(0, 1);
  EXPECT_FALSE(genlock_.ToDraw(0).has_value());
  EXPECT_EQ(genlock_.NextCommand(0).what, What::kNothing) << "the other does not hold it yet";
  genlock_.Held(1, 1);
  const std::vector<Genlock::Command> orders = Orders();
  // Each order is for a sweep of its own, which begins with the other's.
  EXPECT_EQ(orders[0].at % kPeriod, 0);
  EXPECT_EQ(orders[1].at - orders[0].at, 3 * sync::kMillisecond);
  // Two sweeps ahead, and a quarter for the time that the order takes to arrive.
  EXPECT_EQ(orders[0].ahead, 2u);
  EXPECT_EQ(orders[0].at, 102 * kPeriod);
  for (size_t m = 0; m < 2; ++m) genlock_.Ordered(m, 1, orders[m].at, true);
  EXPECT_EQ(genlock_.Step(), sync::kNever) << "nothing more is due";
  clock_.AdvanceTo(200 * kPeriod);
  genlock_.Step();
  EXPECT_EQ(genlock_.figures().postponed, 0u);
  EXPECT_EQ(genlock_.shown(), 0u);
  for (size_t m = 0; m < 2; ++m) genlock_.Shown(m, 1, orders[m].at);
  EXPECT_EQ(genlock_.shown(), 1u);
  EXPECT_EQ(genlock_.figures().volumes, 1u);
  EXPECT_EQ(genlock_.figures().slips, 0u);
  EXPECT_FALSE(genlock_.ToDraw(0).has_value()) << "no further volume is wanted";
}

TEST_F(Locked, AnOrderThatOneHasNotTakenInTimeIsPutOffForAll) {
  Join({0, 2 * sync::kMillisecond});
  const uint64_t volume = Hold(1);
  const std::vector<Genlock::Command> first = Orders();
  genlock_.Ordered(0, volume, first[0].at, true);
  const sync::TimeNs deadline = genlock_.Step();
  // Between the last moment at which a device accepts it and the first at which one shows it.
  EXPECT_GT(deadline, first[1].at - kPeriod);
  EXPECT_LT(deadline, first[0].at);
  clock_.AdvanceTo(deadline - 1);
  genlock_.Step();
  EXPECT_EQ(genlock_.NextCommand(0).what, What::kNothing);
  clock_.AdvanceTo(deadline);
  genlock_.Step();
  EXPECT_EQ(genlock_.figures().postponed, 1u);
  const std::vector<Genlock::Command> second = Orders();
  for (size_t m = 0; m < 2; ++m) {
    EXPECT_GE(second[m].at, first[m].at + kPeriod);
    EXPECT_EQ((second[m].at - first[m].at) % kPeriod, 0);
    // A device that has the new order gets it before the sweep of the old one, and accepts it.
    EXPECT_GT(second[m].at - static_cast<sync::TimeNs>(second[m].ahead - 1) * kPeriod,
              clock_.Now());
  }
  // The late answer is to the first order: it is ignored.
  genlock_.Ordered(1, volume, first[1].at, true);
  genlock_.Ordered(0, volume, second[0].at, true);
  EXPECT_NE(genlock_.Step(), sync::kNever);
  genlock_.Ordered(1, volume, second[1].at, true);
  EXPECT_EQ(genlock_.Step(), sync::kNever);
}

TEST_F(Locked, ADeviceThatDoesNotTakeAnOrderIsNotWaitedFor) {
  Join({0, 0});
  const uint64_t volume = Hold(1);
  const std::vector<Genlock::Command> first = Orders();
  genlock_.Ordered(0, volume, first[0].at, true);
  genlock_.Ordered(1, volume, first[1].at, false);
  EXPECT_EQ(genlock_.figures().postponed, 1u);
  EXPECT_GT(Orders()[0].at, first[0].at);
}

TEST_F(Locked, WhatOneCannotHaveAllDropAndDrawAgain) {
  Join({0, 0, 0});
  genlock_.Want(0, SnapshotOf(5));
  genlock_.Held(0, 1);
  genlock_.Failed(1, 1, "its engine failed");
  EXPECT_EQ(genlock_.NextCommand(1).what, What::kNothing) << "it has nothing to drop";
  for (const size_t m : {0u, 2u}) {
    const Genlock::Command drop = genlock_.NextCommand(m);
    EXPECT_EQ(drop.what, What::kDrop);
    EXPECT_EQ(drop.volume, 1u);
    EXPECT_EQ(drop.why, "its engine failed");
    EXPECT_FALSE(genlock_.ToDraw(m).has_value());
    genlock_.Failed(m, 1, "dropped");
  }
  EXPECT_EQ(genlock_.figures().dropped, 1u);
  EXPECT_EQ(genlock_.figures().volumes, 0u);
  // After a pause, even if no further request was made.
  EXPECT_FALSE(genlock_.ToDraw(0).has_value());
  const sync::TimeNs again = genlock_.Step();
  ASSERT_GT(again, clock_.Now());
  ASSERT_LE(again, clock_.Now() + sync::kSecond);
  clock_.AdvanceTo(again);
  genlock_.Step();
  for (size_t m = 0; m < 3; ++m) {
    ASSERT_TRUE(genlock_.ToDraw(m).has_value());
    EXPECT_EQ(genlock_.ToDraw(m)->volume, 2u);
    EXPECT_EQ(genlock_.ToDraw(m)->snapshot->number, 5u);
  }
}

TEST_F(Locked, WhoShowsNothingHoldsNobodyUp) {
  Join({0, 0});
  genlock_.SetPresent(1, false);
  genlock_.Want(0, SnapshotOf(1));
  EXPECT_FALSE(genlock_.ToDraw(1).has_value());
  genlock_.Held(0, 1);
  EXPECT_EQ(genlock_.NextCommand(0).what, What::kShow);
  // It returns: with the next round, even if the first has not been shown yet.
  genlock_.SetPresent(1, true);
  genlock_.SetSweeps(1, 100 * kPeriod, kPeriod);
  EXPECT_FALSE(genlock_.ToDraw(1).has_value());
  genlock_.Want(1, SnapshotOf(1));
  genlock_.Shown(0, 1, 103 * kPeriod);
  ASSERT_TRUE(genlock_.ToDraw(1).has_value());
  EXPECT_EQ(genlock_.ToDraw(1)->volume, 2u);
  // It leaves in the middle of a round: the other's continues.
  genlock_.Held(0, 2);
  EXPECT_EQ(genlock_.NextCommand(0).what, What::kNothing);
  genlock_.SetPresent(1, false);
  EXPECT_EQ(genlock_.NextCommand(0).what, What::kShow);
}

TEST_F(Locked, SweepsFarApartAreOrderedAWholeOneEarlier) {
  Join({0, 4 * sync::kMillisecond, 6 * sync::kMillisecond});
  Hold(1);
  const std::vector<Genlock::Command> orders = Orders();
  EXPECT_EQ(orders[0].ahead, 3u);
  EXPECT_EQ(orders[1].at - orders[0].at, 4 * sync::kMillisecond);
  EXPECT_EQ(orders[2].at - orders[0].at, -4 * sync::kMillisecond);
}

TEST_F(Locked, OrdersWaitUntilSweepsAreKnown) {
  Join({0, 0});
  genlock_.SetSweeps(1, 0, 0);
  Hold(1);
  EXPECT_EQ(genlock_.NextCommand(0).what, What::kNothing);
  genlock_.SetSweeps(1, 100 * kPeriod, kPeriod);
  EXPECT_EQ(Orders().size(), 2u);
}

TEST_F(Locked, WhatIsShownApartIsCounted) {
  Join({0, 0});
  uint64_t volume = Hold(1);
  std::vector<Genlock::Command> orders = Orders();
  for (size_t m = 0; m < 2; ++m) genlock_.Ordered(m, volume, orders[m].at, true);
  genlock_.Shown(0, volume, orders[0].at);
  genlock_.Shown(1, volume, orders[1].at + kPeriod);
  EXPECT_EQ(genlock_.figures().slips, 1u);
  EXPECT_EQ(genlock_.figures().volumes, 0u);
  // Not accepted by one of them at all.
  volume = Hold(2);
  orders = Orders();
  for (size_t m = 0; m < 2; ++m) genlock_.Ordered(m, volume, orders[m].at, true);
  genlock_.Shown(0, volume, orders[0].at);
  genlock_.Failed(1, volume, "dark");
  EXPECT_EQ(genlock_.figures().slips, 2u);
}

TEST_F(Locked, AMemberThatTakesNoOrderLosesTheVolumeForAll) {
  Join({0, 0});
  const uint64_t volume = Hold(1);
  int orders = 0;
  for (; orders < 1000; ++orders) {
    const Genlock::Command command = genlock_.NextCommand(0);
    if (command.what != What::kShow) break;
    genlock_.Ordered(0, volume, command.at, true);
    clock_.AdvanceTo(genlock_.Step());
    genlock_.Step();
  }
  EXPECT_EQ(orders, 32);
  EXPECT_EQ(genlock_.NextCommand(1).what, What::kDrop);
}

}  // namespace
}  // namespace voxeld::daemon
