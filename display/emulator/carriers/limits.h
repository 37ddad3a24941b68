// Limits of what one connection may have waiting: far more than any host needs, so that a broken
// host cannot exhaust memory.
#pragma once

#include <cstddef>

namespace voxeld::display::emulator {

inline constexpr size_t kMostPending = 8192;               // transfers
inline constexpr size_t kMostPendingBytes = 256ull << 20;  // carried or requested by them
inline constexpr size_t kMostWaiting = 64ull << 20;        // bytes that the peer has not accepted

}  // namespace voxeld::display::emulator
