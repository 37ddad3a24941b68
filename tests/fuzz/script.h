// A fuzzer's input as a script: bytes that select the actions, one step after another, with texts
// in between. Every sequence of bytes is a script, and a byte more or less leaves what is before
// and after it unchanged, so that a fuzzer's changes keep their meaning. tests/fuzz/make_seeds.py
// writes the same format.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace voxeld::fuzz {

// Limits the steps of a script, so that no input takes long; long-running programs increase it.
inline int steps_times = 1;
inline int MostSteps(int usual) { return usual * steps_times; }

class Script {
 public:
  Script(const uint8_t* data, size_t size) : rest_(data, size) {}

  bool done() const { return rest_.empty(); }

  // Returns the next byte; 0 at the end.
  uint8_t Byte() {
    if (rest_.empty()) return 0;
    const uint8_t byte = rest_.front();
    rest_ = rest_.subspan(1);
    return byte;
  }
  bool Flag() { return (Byte() & 1) != 0; }
  // Returns a number of `bytes` bytes, the lowest first.
  uint64_t Number(int bytes) {
    uint64_t value = 0;
    for (int i = 0; i < bytes; ++i) value |= uint64_t{Byte()} << 8 * i;
    return value;
  }
  // Returns a number below `end` (1 to 65536).
  uint32_t Below(uint32_t end) { return static_cast<uint32_t>(Number(end <= 256 ? 1 : 2) % end); }

  // Returns the text up to a backslash followed by another byte, or to the end. Two backslashes are
  // one in the text.
  std::string Text() {
    std::string text;
    while (!rest_.empty()) {
      const uint8_t byte = Byte();
      if (byte == '\\' && Byte() != '\\') break;
      text.push_back(static_cast<char>(byte));
    }
    return text;
  }

  // Returns all remaining bytes.
  std::span<const uint8_t> Rest() {
    const std::span<const uint8_t> rest = rest_;
    rest_ = {};
    return rest;
  }

 private:
  std::span<const uint8_t> rest_;
};

}  // namespace voxeld::fuzz
