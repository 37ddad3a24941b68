#ifndef VOXELD_DISPLAY_EMULATOR_DESCRIPTOR_BYTES_H_
#define VOXELD_DISPLAY_EMULATOR_DESCRIPTOR_BYTES_H_

// Appends the parts of USB descriptors, little-endian, as the USB 2.0 specification lays them out (chapter 9.6).

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <string_view>
#include <vector>

namespace voxeld::display::emulator {

using DescriptorBytes = std::vector<std::byte>;

inline void Put8(DescriptorBytes& out, std::initializer_list<int> values) {
  for (const int value : values) out.push_back(static_cast<std::byte>(value));
}

inline void Put16(DescriptorBytes& out, int value) { Put8(out, {value & 0xFF, value >> 8}); }

inline void Put32(DescriptorBytes& out, int value) {
  Put16(out, value & 0xFFFF);
  Put16(out, value >> 16);
}

// Appends each character as a UTF-16 unit. Requires: `ascii` holds ASCII only.
inline void PutUtf16(DescriptorBytes& out, std::string_view ascii) {
  for (const char c : ascii) Put8(out, {c, 0});
}

// Returns a string descriptor (type 3). Requires: `ascii` holds ASCII only.
inline DescriptorBytes StringDescriptor(std::string_view ascii) {
  DescriptorBytes out;
  Put8(out, {static_cast<int>(2 + 2 * ascii.size()), 3});
  PutUtf16(out, ascii);
  return out;
}

}  // namespace voxeld::display::emulator

#endif  // VOXELD_DISPLAY_EMULATOR_DESCRIPTOR_BYTES_H_
