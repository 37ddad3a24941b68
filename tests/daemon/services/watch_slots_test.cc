#include "daemon/services/watch_slots.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <utility>
#include <vector>

namespace voxeld::daemon::services {
namespace {

using ::testing::HasSubstr;
using Slot = WatchSlots::Slot;

TEST(WatchSlots, AreAsManyAsAllowed) {
  WatchSlots slots("volumes", "max_volume_watches", 2);
  absl::StatusOr<Slot> first = slots.Take("user 1"), second = slots.Take("user 2");
  ASSERT_TRUE(first.ok());
  ASSERT_TRUE(second.ok());
  const absl::Status refused = slots.Take("user 3").status();
  EXPECT_TRUE(absl::IsResourceExhausted(refused));
  EXPECT_THAT(refused.message(), HasSubstr("2 watches of volumes are open, which is "
                                           "max_volume_watches"));
  first->Release();
  first->Release();  // releasing twice is the same as once
  EXPECT_TRUE(slots.Take("user 3").ok());
}

TEST(WatchSlots, NobodyHasMoreThanThreeQuarters) {
  WatchSlots slots("volumes", "max_volume_watches", 8);
  std::vector<Slot> taken;
  for (int i = 0; i < 6; ++i) taken.push_back(*slots.Take("user 1"));
  const absl::Status refused = slots.Take("user 1").status();
  EXPECT_TRUE(absl::IsResourceExhausted(refused));
  EXPECT_THAT(refused.message(), HasSubstr("user 1 has 6 watches of volumes open"));
  EXPECT_TRUE(slots.Take("user 2").ok()) << "others get none";
  taken.pop_back();
  EXPECT_TRUE(slots.Take("user 1").ok());
}

TEST(WatchSlots, AMovedSlotIsOne) {
  WatchSlots slots("volumes", "max_volume_watches", 1);
  Slot outer;
  {
    Slot inner = *slots.Take("user 1");
    outer = std::move(inner);
  }
  EXPECT_FALSE(slots.Take("user 2").ok());
  outer = Slot();
  EXPECT_TRUE(slots.Take("user 2").ok());
}

}  // namespace
}  // namespace voxeld::daemon::services
