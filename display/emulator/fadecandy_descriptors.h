// The USB descriptors of an emulated Fadecandy (docs/protocols/fadecandy.md §1, §7).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace voxeld::display::emulator {

// Returns the descriptor for GET_DESCRIPTOR's wValue: type in the high byte, index in the low one.
std::optional<std::vector<std::byte>> FadecandyDescriptor(uint16_t value,
                                                          const std::string& serial);

// Returns the descriptor for the vendor request's wIndex.
std::optional<std::vector<std::byte>> FadecandyMsDescriptor(uint16_t index);

}  // namespace voxeld::display::emulator
