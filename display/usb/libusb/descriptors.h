// Extracts what is needed from a device's descriptors, as the device sent the bytes (USB 2.0,
// §9.6). The bytes are untrusted.
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

// Returns all interfaces of all configurations, as far as the bytes are valid: a device descriptor,
// then configurations, as in sysfs. Never reads beyond the bytes.
std::vector<UsbInterface> FindInterfaces(std::span<const std::byte> descriptors);

// Returns the number of the first interface with that triple; without a triple, 0 if any exists.
std::optional<uint8_t> ChooseInterface(const std::vector<UsbInterface>& interfaces,
                                       const std::optional<std::array<uint8_t, 3>>& triple);

}  // namespace voxeld::display
