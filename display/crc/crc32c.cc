#include "display/crc/crc32c.h"

#include <array>
#include <cstring>

#if defined(__x86_64__)
#include <nmmintrin.h>
#endif

namespace voxeld::display {
namespace {

constexpr uint32_t kPolynomial = 0x82F63B78;  // 0x1EDC6F41 reflected

constexpr std::array<uint32_t, 256> MakeTable() {
  std::array<uint32_t, 256> table{};
  for (uint32_t i = 0; i < 256; ++i) {
    uint32_t crc = i;
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1) != 0 ? kPolynomial : 0);
    table[i] = crc;
  }
  return table;
}

constexpr std::array<uint32_t, 256> kTable = MakeTable();

#if defined(__x86_64__)
// The processor starts a step each cycle and finishes it after three, so three runs go in parallel.
constexpr size_t kRun = 1024;

// A linear map of states, by their bits.
using Matrix = std::array<uint32_t, 32>;

constexpr uint32_t Times(const Matrix& m, uint32_t state) {
  uint32_t sum = 0;
  for (size_t bit = 0; bit < 32; ++bit) sum ^= ((state >> bit) & 1) != 0 ? m[bit] : 0;
  return sum;
}

// Returns the effect of kRun zero bytes on a state, by its bytes.
constexpr std::array<std::array<uint32_t, 256>, 4> MakeSkip() {
  Matrix skip{};
  for (size_t bit = 0; bit < 32; ++bit) {
    const uint32_t state = uint32_t{1} << bit;
    skip[bit] = (state >> 8) ^ kTable[state & 0xFF];
  }
  for (size_t bytes = 1; bytes < kRun; bytes *= 2) {
    Matrix twice{};
    for (size_t bit = 0; bit < 32; ++bit) twice[bit] = Times(skip, skip[bit]);
    skip = twice;
  }
  std::array<std::array<uint32_t, 256>, 4> table{};
  for (uint32_t byte = 0; byte < 4; ++byte) {
    for (uint32_t value = 0; value < 256; ++value) {
      table[byte][value] = Times(skip, value << (8 * byte));
    }
  }
  return table;
}

constexpr std::array<std::array<uint32_t, 256>, 4> kSkip = MakeSkip();

uint64_t Skip(uint64_t state) {
  return kSkip[0][state & 0xFF] ^ kSkip[1][(state >> 8) & 0xFF] ^ kSkip[2][(state >> 16) & 0xFF] ^
         kSkip[3][(state >> 24) & 0xFF];
}

uint64_t Word(const std::byte* at) {
  uint64_t word;
  std::memcpy(&word, at, 8);
  return word;
}

__attribute__((target("sse4.2"))) uint32_t Crc32cSse42(std::span<const std::byte> bytes,
                                                       uint32_t crc) {
  uint64_t state = ~crc;
  const std::byte* at = bytes.data();
  size_t left = bytes.size();
  for (; left >= 3 * kRun; at += 3 * kRun, left -= 3 * kRun) {
    uint64_t second = 0, third = 0;
    for (size_t i = 0; i < kRun; i += 8) {
      state = _mm_crc32_u64(state, Word(at + i));
      second = _mm_crc32_u64(second, Word(at + kRun + i));
      third = _mm_crc32_u64(third, Word(at + 2 * kRun + i));
    }
    state = Skip(Skip(state) ^ second) ^ third;
  }
  for (; left >= 8; at += 8, left -= 8) {
    state = _mm_crc32_u64(state, Word(at));
  }
  uint32_t last = static_cast<uint32_t>(state);
  for (; left > 0; ++at, --left) last = _mm_crc32_u8(last, std::to_integer<uint8_t>(*at));
  return ~last;
}
#endif

}  // namespace

uint32_t Crc32cPortable(std::span<const std::byte> bytes, uint32_t crc) {
  crc = ~crc;
  for (const std::byte b : bytes) {
    crc = (crc >> 8) ^ kTable[(crc ^ std::to_integer<uint32_t>(b)) & 0xFF];
  }
  return ~crc;
}

uint32_t Crc32c(std::span<const std::byte> bytes, uint32_t crc) {
#if defined(__x86_64__)
  static const bool has_sse42 = __builtin_cpu_supports("sse4.2") != 0;
  if (has_sse42) return Crc32cSse42(bytes, crc);
#endif
  return Crc32cPortable(bytes, crc);
}

}  // namespace voxeld::display
