// What is needed of a device's descriptors, out of the bytes as the device gave them (USB 2.0, §9.6):
// hostile until read.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace voxeld::display {

struct UsbInterface {
  uint8_t number = 0;
  uint8_t alternate = 0;
  std::array<uint8_t, 3> triple{};  // class, subclass, protocol
};

// All interfaces of all configurations, as far as the bytes are sound: a device descriptor, then
// configurations, as sysfs has them. Never reads beyond them.
std::vector<UsbInterface> FindInterfaces(std::span<const std::byte> descriptors);

// The number of the first interface with that triple; without a triple 0 if there is any.
std::optional<uint8_t> ChooseInterface(const std::vector<UsbInterface>& interfaces,
                                       const std::optional<std::array<uint8_t, 3>>& triple);

}  // namespace voxeld::display
