// Bytes with a few errors.
#pragma once

#include <algorithm>
#include <cstddef>
#include <random>
#include <vector>

namespace voxeld::display::emulator {

// Makes 1 to 4 changes: replaces a byte or four of them, often by border cases, or removes, doubles
// or garbles a piece.
inline std::vector<std::byte> Mutated(std::vector<std::byte> bytes, std::mt19937& random) {
  constexpr unsigned kBorders[] = {0x00, 0x01, 0x7F, 0x80, 0xFF};
  for (uint32_t left = 1 + random() % 4; left > 0 && !bytes.empty(); --left) {
    const size_t at = random() % bytes.size();
    const size_t size = std::min<size_t>(1 + random() % 16, bytes.size() - at);
    const auto begin = bytes.begin() + static_cast<std::ptrdiff_t>(at);
    const auto end = begin + static_cast<std::ptrdiff_t>(size);
    switch (random() % 6) {
      case 0:
        bytes[at] = static_cast<std::byte>(random());
        break;
      case 1:
        bytes[at] = static_cast<std::byte>(kBorders[random() % 5]);
        break;
      case 2:
        std::fill(begin, begin + static_cast<std::ptrdiff_t>(std::min<size_t>(4, size)),
                  static_cast<std::byte>(kBorders[random() % 5]));
        break;
      case 3:
        bytes.erase(begin, end);
        break;
      case 4: {
        const std::vector<std::byte> piece(begin, end);
        bytes.insert(begin, piece.begin(), piece.end());
        break;
      }
      default:
        std::generate(begin, end, [&] { return static_cast<std::byte>(random()); });
        break;
    }
  }
  return bytes;
}

}  // namespace voxeld::display::emulator
