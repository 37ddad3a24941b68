#include "display/usb/libusb/usbfs_budget.h"

#include "gtest/gtest.h"

namespace voxeld::display {
namespace {

TEST(UsbfsBudget, IsNeverExceededAndTellsOfRoomOnce) {
  int told = 0;
  UsbfsBudget budget(100, [&] { ++told; });
  EXPECT_TRUE(budget.Take(60));
  EXPECT_TRUE(budget.Take(40));
  EXPECT_FALSE(budget.Take(1));
  EXPECT_TRUE(budget.Take(0));
  budget.Release(40);
  EXPECT_EQ(told, 1);
  budget.Release(10);  // no request was refused since
  EXPECT_EQ(told, 1);
  EXPECT_FALSE(budget.Take(51));
  EXPECT_TRUE(budget.Take(50));
  EXPECT_FALSE(budget.Take(size_t{0} - 10));  // no overflow
}

TEST(UsbfsBudget, WhatIsLentLeavesHalfForTransfersOfAllDevices) {
  UsbfsBudget budget(60, [] {});
  int lent = 0;
  for (int device = 0; device < 3; ++device) {
    for (int slab = 0; slab < 24 && budget.TakeLent(1); ++slab) ++lent;
  }
  EXPECT_EQ(lent, 30);
  EXPECT_TRUE(budget.Take(30));
  EXPECT_FALSE(budget.Take(1));
  budget.ReleaseLent(1);
  EXPECT_TRUE(budget.Take(1));
  EXPECT_FALSE(budget.TakeLent(1));
}

TEST(UsbfsBudget, TheSystemsLimitIsSane) {
  EXPECT_GE(ReadUsbfsLimit(), size_t{1} << 20);
  EXPECT_NE(UsbfsLimitHint().find("usbfs_memory_mb"), std::string::npos);
}

}  // namespace
}  // namespace voxeld::display
