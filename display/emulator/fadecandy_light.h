// Computes the light of a Fadecandy from packets, refresh by refresh, in the board's own integers
// (docs/protocols/fadecandy.md §3 to §8). It does not depend on USB.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "display/drivers/fadecandy/protocol.h"

namespace voxeld::display::emulator {

// §8 One channel, step by step.

// Interpolates between two key frames: 0 to 65535. `coefficient` is 0 to 0x10000.
constexpr uint32_t FadecandyFade(uint8_t prev, uint8_t next, uint32_t coefficient) {
  return (uint32_t{prev} * 257 * (0x10000 - coefficient) + uint32_t{next} * 257 * coefficient) >>
         16;
}

// `table`: a channel's entries, each halved. `value` is at most 65535.
constexpr uint32_t FadecandyLookUp(std::span<const uint16_t, fadecandy::kLutEntries> table,
                                   uint32_t value) {
  const uint32_t above = value & 0xFF;
  return (table[value >> 8] * (0x100 - above) + table[(value >> 8) + 1] * above) >> 7;
}

// Returns the byte for the strip; the rounding error is carried over in `residual`.
constexpr uint8_t FadecandyDither(uint32_t value, int16_t& residual) {
  const int32_t wanted = static_cast<int32_t>(value) + residual;
  const int32_t out = std::clamp(wanted + 0x80, 0, 0xFFFF) >> 8;
  residual = static_cast<int16_t>(wanted - out * 257);
  return static_cast<uint8_t>(out);
}

class FadecandyLight {
 public:
  // Takes a packet's 64 bytes. Returns false, and does nothing, for video while a finished frame
  // waits.
  bool Take(std::span<const std::byte, fadecandy::kPacketBytes> packet);

  // Lights the current frame, and then puts the waiting frame and table to use. `now_ms` is the
  // board's own time and never decreases.
  void Refresh(int64_t now_ms);

  // Returns R, G, B of the 512 pixels, as lit by the last refresh.
  std::span<const uint8_t, fadecandy::kFrameBytes> Output() const { return output_; }
  // Returns G, R, B of a strip's 64 pixels, as they are sent.
  std::array<uint8_t, fadecandy::kStripPixels * 3> Strip(size_t strip) const;

  uint8_t flags() const { return flags_; }
  bool frame_waits() const { return frame_waits_; }
  uint32_t refreshes() const { return refreshes_; }
  uint32_t frames() const { return frames_; }  // received and put to use
  // State of the board's own LED after the last refresh.
  bool led() const { return led_; }

 private:
  struct Frame {
    std::array<uint8_t, fadecandy::kFrameBytes> rgb{};
    int64_t final_ms = 0;
  };

  uint32_t Coefficient(int64_t now_ms) const;
  void StoreVideo(std::span<const std::byte, fadecandy::kPacketBytes> packet);
  void StoreLut(std::span<const std::byte, fadecandy::kPacketBytes> packet);

  std::array<Frame, 3> held_;
  size_t prev_ = 0, next_ = 1, new_ = 2;  // indices into held_
  bool frame_waits_ = false;
  fadecandy::Lut new_lut_{};
  std::array<uint16_t, 3 * fadecandy::kLutEntries> lut_{};  // in use: halved
  bool lut_waits_ = false;
  uint8_t flags_ = 0;
  std::array<int16_t, fadecandy::kFrameBytes> residual_{};
  std::array<uint8_t, fadecandy::kFrameBytes> output_{};
  uint32_t refreshes_ = 0, frames_ = 0;
  bool traffic_ = false;  // since the last refresh
  bool led_ = false;
};

}  // namespace voxeld::display::emulator
