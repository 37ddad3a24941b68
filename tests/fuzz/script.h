// A fuzzer's input as a script: bytes that say what is to be done, one step after another, and texts among them. Every sequence of
// bytes is a script, and a byte more or less somewhere leaves what stands before and behind as it was, so that a fuzzer's changes
// keep their meaning. tests/fuzz/make_seeds.py writes the same.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace voxeld::fuzz {

// Of a script no more steps are taken than this, so that no input takes long; programs that go on for long make it more.
inline int steps_times = 1;
inline int MostSteps(int usual) { return usual * steps_times; }

class Script {
 public:
  Script(const uint8_t* data, size_t size) : rest_(data, size) {}

  bool done() const { return rest_.empty(); }

  // 0 at the end.
  uint8_t Byte() {
    if (rest_.empty()) return 0;
    const uint8_t byte = rest_.front();
    rest_ = rest_.subspan(1);
    return byte;
  }
  bool Flag() { return (Byte() & 1) != 0; }
  // Of so many bytes, the lowest first.
  uint64_t Number(int bytes) {
    uint64_t value = 0;
    for (int i = 0; i < bytes; ++i) value |= uint64_t{Byte()} << 8 * i;
    return value;
  }
  // Below `end` (1 to 65536).
  uint32_t Below(uint32_t end) { return static_cast<uint32_t>(Number(end <= 256 ? 1 : 2) % end); }

  // Up to a backslash and a byte that is none, or to the end. Two backslashes are one of the text's.
  std::string Text() {
    std::string text;
    while (!rest_.empty()) {
      const uint8_t byte = Byte();
      if (byte == '\\' && Byte() != '\\') break;
      text.push_back(static_cast<char>(byte));
    }
    return text;
  }

  // All that is left.
  std::span<const uint8_t> Rest() {
    const std::span<const uint8_t> rest = rest_;
    rest_ = {};
    return rest;
  }

 private:
  std::span<const uint8_t> rest_;
};

}  // namespace voxeld::fuzz
