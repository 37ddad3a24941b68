#include "daemon/pipeline/link_watch.h"

#include <gtest/gtest.h>

namespace voxeld::daemon {
namespace {

constexpr sync::TimeNs kStart = 1000 * sync::kSecond;

TEST(LinkWatch, SaysNothingWhereAllIsWell) {
  LinkWatch watch;
  EXPECT_EQ(watch.Failed(0, kStart), 0u);
  EXPECT_EQ(watch.trouble(kStart), "");
}

TEST(LinkWatch, FailuresAreToldAtOnceThenTogether) {
  LinkWatch watch;
  EXPECT_EQ(watch.Failed(2, kStart), 2u);
  EXPECT_EQ(watch.Failed(2, kStart), 0u) << "the same";
  EXPECT_EQ(watch.Failed(3, kStart + 1), 0u) << "too soon";
  EXPECT_EQ(watch.Failed(7, kStart + LinkWatch::kQuiet - 1), 0u);
  EXPECT_EQ(watch.Failed(7, kStart + LinkWatch::kQuiet), 5u) << "those that had to wait";
  EXPECT_EQ(watch.Failed(7, kStart + LinkWatch::kQuiet + 1), 0u) << "reported";
  EXPECT_EQ(watch.Failed(8, kStart + LinkWatch::kQuiet + 1), 0u) << "too soon after the last";
  EXPECT_EQ(watch.Failed(8, kStart + 2 * LinkWatch::kQuiet), 1u);
}

TEST(LinkWatch, FailuresAreTroubleForAWhile) {
  LinkWatch watch;
  watch.Failed(2, kStart);
  watch.Failed(5, kStart + sync::kSecond);
  EXPECT_EQ(watch.trouble(kStart + 3 * sync::kSecond),
            "transfers failed 2 s ago (since the start: 5)");
  EXPECT_NE(watch.trouble(kStart + sync::kSecond + LinkWatch::kTold - 1), "");
  EXPECT_EQ(watch.trouble(kStart + sync::kSecond + LinkWatch::kTold), "");
}

TEST(LinkWatch, ALossIsTroubleOnceItIsOver) {
  LinkWatch watch;
  watch.There(kStart);
  EXPECT_EQ(watch.trouble(kStart), "") << "it was never lost";
  watch.Lost("unplugged");
  watch.Lost("it is not there");
  EXPECT_EQ(watch.trouble(kStart), "") << "it is lost still";
  const sync::TimeNs back = kStart + 5 * LinkWatch::kTold;
  watch.There(back);
  watch.There(back + sync::kSecond);
  EXPECT_EQ(watch.trouble(back + 4 * sync::kSecond),
            "the device was lost (unplugged) and came back 4 s ago; losses since the start: 1");
  watch.Failed(1, back + 4 * sync::kSecond);
  EXPECT_EQ(watch.trouble(back + 4 * sync::kSecond),
            "the device was lost (unplugged) and came back 4 s ago; losses since the start: 1; "
            "transfers failed 0 s ago (since the start: 1)");
  EXPECT_EQ(watch.trouble(back + LinkWatch::kTold),
            "transfers failed 56 s ago (since the start: 1)");
  watch.Lost("it says nothing");
  watch.There(back + 2 * LinkWatch::kTold);
  EXPECT_EQ(watch.trouble(back + 2 * LinkWatch::kTold),
            "the device was lost (it says nothing) and came back 0 s ago; losses since the start: "
            "2");
}

}  // namespace
}  // namespace voxeld::daemon
