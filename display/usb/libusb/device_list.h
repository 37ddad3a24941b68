// Lists the system's USB devices through udev, and reports those that come and go. It opens no
// device.
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
  UsbIdentity identity;  // its path is the position: "1-2.4"
  std::vector<UsbInterface> interfaces;
};

// Returns the entries of `devices` that match. Errors: NotFound, listing the devices, if none does.
absl::StatusOr<std::vector<UsbDeviceEntry>> Matching(const UsbMatch& match,
                                                     std::vector<UsbDeviceEntry> devices);

// Bound to no thread, but used by one at a time.
class DeviceList {
 public:
  static absl::StatusOr<std::unique_ptr<DeviceList>> Make();
  ~DeviceList();
  DeviceList(const DeviceList&) = delete;
  DeviceList& operator=(const DeviceList&) = delete;

  // Returns all devices, ascending by position.
  absl::StatusOr<std::vector<UsbDeviceEntry>> Devices();

 private:
  explicit DeviceList(udev* context) : udev_(context) {}
  udev* const udev_;
};

// Reports arrivals and departures of devices; used by one thread.
class DeviceWatch {
 public:
  static absl::StatusOr<std::unique_ptr<DeviceWatch>> Make();
  ~DeviceWatch();
  DeviceWatch(const DeviceWatch&) = delete;
  DeviceWatch& operator=(const DeviceWatch&) = delete;

  int fd() const;  // readable when there is an event
  // Consumes all events; returns true if a device arrived.
  bool TakeArrivals();

 private:
  DeviceWatch(udev* context, udev_monitor* monitor) : udev_(context), monitor_(monitor) {}
  udev* const udev_;
  udev_monitor* const monitor_;
};

}  // namespace voxeld::display
