// CRC-32C (Castagnoli), reflected, initial value and final XOR all ones, as in RFC 3720 and voxlink
// (docs/protocols/voxlink.md §5.6). The check value of "123456789" is 0xE3069283.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace voxeld::display {

// Returns the CRC of `bytes` after bytes whose CRC was `crc` (0 for none). Uses the processor's
// instruction if it has one.
uint32_t Crc32c(std::span<const std::byte> bytes, uint32_t crc = 0);

// The same by table, on any machine.
uint32_t Crc32cPortable(std::span<const std::byte> bytes, uint32_t crc = 0);

}  // namespace voxeld::display
