// The USB devices that the system has, from udev, and news of those that come and go. Nothing is
// opened to look.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "display/usb/libusb/descriptors.h"
#include "display/usb/usb_bus.h"

struct udev;
struct udev_monitor;

namespace voxeld::display {

struct UsbDeviceEntry {
  std::string node;      // "/dev/bus/usb/001/004"; a new one for each plug
  UsbIdentity identity;  // its path is the place: "1-2.4"
  std::vector<UsbInterface> interfaces;
};

// Those of `devices` that `match` means. NotFound, with what there is, if none is.
absl::StatusOr<std::vector<UsbDeviceEntry>> Matching(const UsbMatch& match,
                                                     std::vector<UsbDeviceEntry> devices);

// Bound to no thread, but used by one at a time.
class DeviceList {
 public:
  static absl::StatusOr<std::unique_ptr<DeviceList>> Make();
  ~DeviceList();
  DeviceList(const DeviceList&) = delete;
  DeviceList& operator=(const DeviceList&) = delete;

  // All devices, ascending by place.
  absl::StatusOr<std::vector<UsbDeviceEntry>> Devices();

 private:
  explicit DeviceList(udev* context) : udev_(context) {}
  udev* const udev_;
};

// News of devices; one thread's.
class DeviceWatch {
 public:
  static absl::StatusOr<std::unique_ptr<DeviceWatch>> Make();
  ~DeviceWatch();
  DeviceWatch(const DeviceWatch&) = delete;
  DeviceWatch& operator=(const DeviceWatch&) = delete;

  int fd() const;  // readable when there is news
  // Takes all news there is; true if a device came.
  bool TakeArrivals();

 private:
  DeviceWatch(udev* context, udev_monitor* monitor) : udev_(context), monitor_(monitor) {}
  udev* const udev_;
  udev_monitor* const monitor_;
};

}  // namespace voxeld::display
