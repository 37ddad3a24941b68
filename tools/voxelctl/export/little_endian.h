// Writes little-endian numbers.
#pragma once

#include <bit>
#include <cstdint>
#include <string>

namespace voxeld::voxelctl {

inline void PutU16(std::string* out, uint16_t value) {
  out->push_back(static_cast<char>(value & 0xff));
  out->push_back(static_cast<char>(value >> 8));
}

inline void PutU32(std::string* out, uint32_t value) {
  PutU16(out, static_cast<uint16_t>(value & 0xffff));
  PutU16(out, static_cast<uint16_t>(value >> 16));
}

inline void PutF32(std::string* out, float value) { PutU32(out, std::bit_cast<uint32_t>(value)); }

}  // namespace voxeld::voxelctl
