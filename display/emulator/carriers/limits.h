// How much one connection may let wait: far more than any host does, so that a broken one does not take all memory.
#pragma once

#include <cstddef>

namespace voxeld::display::emulator {

inline constexpr size_t kMostPending = 8192;               // transfers
inline constexpr size_t kMostPendingBytes = 256ull << 20;  // that they carry or ask for
inline constexpr size_t kMostWaiting = 64ull << 20;  // bytes that the other side has not taken

}  // namespace voxeld::display::emulator
