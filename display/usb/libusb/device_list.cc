#include "display/usb/libusb/device_list.h"

#include <libudev.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <system_error>
#include <tuple>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"

namespace voxeld::display {
namespace {

constexpr size_t kMostDescriptorBytes = size_t{64} << 10;

struct Unref {
  void operator()(udev* p) const { udev_unref(p); }
  void operator()(udev_enumerate* p) const { udev_enumerate_unref(p); }
  void operator()(udev_device* p) const { udev_device_unref(p); }
  void operator()(udev_monitor* p) const { udev_monitor_unref(p); }
};
template <typename T>
using Udev = std::unique_ptr<T, Unref>;

std::string Text(udev_device* device, const char* attribute) {
  const char* text = udev_device_get_sysattr_value(device, attribute);
  return text == nullptr ? "" : text;
}

uint16_t Number(udev_device* device, const char* attribute) {
  uint32_t number = 0;
  return absl::SimpleHexAtoi(Text(device, attribute), &number) ? static_cast<uint16_t>(number) : 0;
}

std::vector<std::byte> Descriptors(const std::string& folder) {
  std::ifstream file(folder + "/descriptors", std::ios::binary);
  std::vector<std::byte> bytes;
  for (char c; bytes.size() < kMostDescriptorBytes && file.get(c);) {
    bytes.push_back(static_cast<std::byte>(c));
  }
  return bytes;
}

absl::Status Errno(const char* what) {
  return absl::UnavailableError(absl::StrCat(what, ": ", std::generic_category().message(errno)));
}

}  // namespace

namespace {

bool Matches(const UsbMatch& match, const UsbDeviceEntry& device) {
  const UsbIdentity& identity = device.identity;
  return match.vendor_id.value_or(identity.vendor_id) == identity.vendor_id &&
         match.product_id.value_or(identity.product_id) == identity.product_id &&
         (match.serial.empty() || match.serial == identity.serial) &&
         (match.path.empty() || match.path == identity.path) &&
         ChooseInterface(device.interfaces, match.interface).has_value();
}

}  // namespace

absl::StatusOr<std::vector<UsbDeviceEntry>> Matching(const UsbMatch& match,
                                                     std::vector<UsbDeviceEntry> devices) {
  std::erase_if(devices, [&](const UsbDeviceEntry& device) { return !Matches(match, device); });
  if (devices.empty()) {
    return absl::NotFoundError(absl::StrCat("no USB device ", match.ToString(), " is attached"));
  }
  if (!match.member.has_value()) return devices;
  const size_t index = match.member->index, count = match.member->count;
  if (devices.size() < count) {
    return absl::NotFoundError(absl::StrCat("of ", count, " USB devices ", match.ToString(), ", ",
                                            devices.size(), " are attached"));
  }
  const auto order = [](const UsbDeviceEntry& device) {
    return std::tie(device.identity.serial, device.identity.path);
  };
  std::sort(devices.begin(), devices.end(),
            [&](const UsbDeviceEntry& a, const UsbDeviceEntry& b) { return order(a) < order(b); });
  return std::vector<UsbDeviceEntry>{devices[index]};
}

absl::StatusOr<std::unique_ptr<DeviceList>> DeviceList::Make() {
  udev* const context = udev_new();
  if (context == nullptr) return Errno("udev");
  return std::unique_ptr<DeviceList>(new DeviceList(context));
}

DeviceList::~DeviceList() { udev_unref(udev_); }

absl::StatusOr<std::vector<UsbDeviceEntry>> DeviceList::Devices() {
  const Udev<udev_enumerate> enumerate(udev_enumerate_new(udev_));
  if (enumerate == nullptr || udev_enumerate_add_match_subsystem(enumerate.get(), "usb") < 0 ||
      udev_enumerate_add_match_property(enumerate.get(), "DEVTYPE", "usb_device") < 0 ||
      udev_enumerate_scan_devices(enumerate.get()) < 0) {
    return Errno("the system's USB devices cannot be listed");
  }
  std::vector<UsbDeviceEntry> devices;
  udev_list_entry* entry = nullptr;
  udev_list_entry_foreach(entry, udev_enumerate_get_list_entry(enumerate.get())) {
    const char* folder = udev_list_entry_get_name(entry);
    const Udev<udev_device> device(udev_device_new_from_syspath(udev_, folder));
    if (device == nullptr) continue;  // gone meanwhile
    const char* node = udev_device_get_devnode(device.get());
    if (node == nullptr) continue;
    UsbDeviceEntry found;
    found.node = node;
    found.identity = {.vendor_id = Number(device.get(), "idVendor"),
                      .product_id = Number(device.get(), "idProduct"),
                      .bcd_device = Number(device.get(), "bcdDevice"),
                      .serial = Text(device.get(), "serial"),
                      .path = udev_device_get_sysname(device.get())};
    found.interfaces = FindInterfaces(Descriptors(folder));
    devices.push_back(std::move(found));
  }
  std::sort(devices.begin(), devices.end(),
            [](const auto& a, const auto& b) { return a.identity.path < b.identity.path; });
  return devices;
}

absl::StatusOr<std::unique_ptr<DeviceWatch>> DeviceWatch::Make() {
  Udev<udev> context(udev_new());
  if (context == nullptr) return Errno("udev");
  Udev<udev_monitor> monitor(udev_monitor_new_from_netlink(context.get(), "udev"));
  if (monitor == nullptr ||
      udev_monitor_filter_add_match_subsystem_devtype(monitor.get(), "usb", "usb_device") < 0 ||
      udev_monitor_enable_receiving(monitor.get()) < 0) {
    return Errno("no news of USB devices from udev");
  }
  return std::unique_ptr<DeviceWatch>(new DeviceWatch(context.release(), monitor.release()));
}

DeviceWatch::~DeviceWatch() {
  udev_monitor_unref(monitor_);
  udev_unref(udev_);
}

int DeviceWatch::fd() const { return udev_monitor_get_fd(monitor_); }

bool DeviceWatch::TakeArrivals() {
  bool came = false;
  while (const Udev<udev_device> device{udev_monitor_receive_device(monitor_)}) {
    const char* action = udev_device_get_action(device.get());
    came = came || (action != nullptr && std::string_view(action) == "add");
  }
  return came;
}

}  // namespace voxeld::display
