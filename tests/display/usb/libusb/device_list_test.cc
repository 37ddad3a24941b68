#include "display/usb/libusb/device_list.h"

#include <string>
#include <vector>

#include "gtest/gtest.h"

namespace voxeld::display {
namespace {

constexpr std::array<uint8_t, 3> kVendorClass{0xFF, 0x56, 1};

UsbDeviceEntry Device(const std::string& serial, const std::string& path, uint16_t product = 1) {
  UsbDeviceEntry entry;
  entry.node = "/dev/bus/usb/" + path;
  entry.identity.vendor_id = 0x1209;
  entry.identity.product_id = product;
  entry.identity.serial = serial;
  entry.identity.path = path;
  entry.interfaces = {{.number = 0, .alternate = 0, .triple = kVendorClass}};
  return entry;
}

std::string PathsOf(const UsbMatch& match, std::vector<UsbDeviceEntry> devices) {
  const auto found = Matching(match, std::move(devices));
  if (!found.ok()) {
    EXPECT_TRUE(absl::IsNotFound(found.status()));
    return std::string(found.status().message());
  }
  std::string paths;
  for (const UsbDeviceEntry& entry : *found) paths += entry.identity.path + " ";
  return paths;
}

TEST(Matching, ByEverythingThatIsGiven) {
  std::vector<UsbDeviceEntry> devices = {Device("A", "1-1"), Device("B", "1-2"),
                                         Device("B", "1-3", 2)};
  devices[0].interfaces.clear();
  EXPECT_EQ(PathsOf({}, devices), "1-2 1-3 ");  // a device without interfaces is left out
  EXPECT_EQ(PathsOf({.serial = "B"}, devices), "1-2 1-3 ");
  EXPECT_EQ(PathsOf({.product_id = 2}, devices), "1-3 ");
  EXPECT_EQ(PathsOf({.path = "1-2"}, devices), "1-2 ");
  EXPECT_EQ(PathsOf({.interface = kVendorClass}, devices), "1-2 1-3 ");
  EXPECT_EQ(PathsOf({.vendor_id = 0x1209, .serial = "C"}, devices),
            "no USB device 1209:* with serial \"C\" is attached");
  EXPECT_EQ(PathsOf({.interface = {{3, 1, 1}}}, devices),
            "no USB device of any kind with an interface of class 03:01:01 is attached");
}

TEST(Matching, OneOfSeveralAlikeBySerialThenPlace) {
  const std::vector<UsbDeviceEntry> devices = {Device("Z", "1-1"), Device("A", "1-3"),
                                               Device("A", "1-2")};
  const auto number = [&](size_t index) {
    return PathsOf({.member = {{.index = index, .count = 3, .group = "g"}}}, devices);
  };
  EXPECT_EQ(number(0), "1-2 ");
  EXPECT_EQ(number(1), "1-3 ");
  EXPECT_EQ(number(2), "1-1 ");
  // They can only be distinguished once all have been found.
  EXPECT_EQ(
      PathsOf({.vendor_id = 0x1209, .member = {{.index = 0, .count = 4, .group = "g"}}}, devices),
      "of 4 USB devices 1209:*, 3 are attached");
}

}  // namespace
}  // namespace voxeld::display
