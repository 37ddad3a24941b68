#include "display/emulator/fadecandy_light.h"

#include <algorithm>
#include <utility>

namespace voxeld::display::emulator {

using fadecandy::kFrameBytes;
using fadecandy::kLutEntries;
using fadecandy::kLutPerPacket;
using fadecandy::kPacketBytes;

bool FadecandyLight::Take(std::span<const std::byte, kPacketBytes> packet) {
  const bool final = fadecandy::IsFinal(packet[0]);
  switch (fadecandy::TypeOf(packet[0])) {
    case fadecandy::PacketType::kVideo:
      if (frame_waits_) return false;
      StoreVideo(packet);
      frame_waits_ = final;
      break;
    case fadecandy::PacketType::kLut:
      StoreLut(packet);
      lut_waits_ |= final;
      break;
    case fadecandy::PacketType::kConfig:
      flags_ = std::to_integer<uint8_t>(packet[1]);
      break;
    case fadecandy::PacketType::kNothing:
      break;
  }
  traffic_ = true;
  return true;
}

void FadecandyLight::StoreVideo(std::span<const std::byte, kPacketBytes> packet) {
  constexpr size_t kBytes = fadecandy::kPixelsPerPacket * 3;
  const size_t begin = fadecandy::IndexOf(packet[0]) * kBytes;
  for (size_t i = begin; i < std::min(begin + kBytes, kFrameBytes); ++i) {
    held_[new_].rgb[i] = std::to_integer<uint8_t>(packet[1 + i - begin]);
  }
}

void FadecandyLight::StoreLut(std::span<const std::byte, kPacketBytes> packet) {
  const size_t begin = fadecandy::IndexOf(packet[0]) * kLutPerPacket;
  for (size_t i = begin; i < std::min(begin + kLutPerPacket, new_lut_.size()); ++i) {
    const size_t at = 2 + 2 * (i - begin);
    new_lut_[i] = static_cast<uint16_t>(std::to_integer<unsigned>(packet[at]) |
                                        std::to_integer<unsigned>(packet[at + 1]) << 8);
  }
}

uint32_t FadecandyLight::Coefficient(int64_t now_ms) const {
  const int64_t whole = held_[next_].final_ms - held_[prev_].final_ms;
  if ((flags_ & fadecandy::kNoInterpolation) != 0 || whole <= 0) return 0x10000;
  const int64_t passed = std::min(now_ms - held_[next_].final_ms, whole);
  return static_cast<uint32_t>((passed << 16) / whole);
}

void FadecandyLight::Refresh(int64_t now_ms) {
  const uint32_t coefficient = Coefficient(now_ms);
  const bool dithers = (flags_ & fadecandy::kNoDither) == 0;
  for (size_t channel = 0; channel < 3; ++channel) {
    const auto table = std::span(lut_).subspan(channel * kLutEntries).template first<kLutEntries>();
    for (size_t i = channel; i < kFrameBytes; i += 3) {
      if (!dithers) residual_[i] = 0;
      output_[i] = FadecandyDither(
          FadecandyLookUp(table,
                          FadecandyFade(held_[prev_].rgb[i], held_[next_].rgb[i], coefficient)),
          residual_[i]);
    }
  }
  ++refreshes_;
  const bool manual = (flags_ & fadecandy::kManualLed) != 0;
  led_ = manual ? (flags_ & fadecandy::kLedOn) != 0 : traffic_;
  traffic_ = false;
  if (std::exchange(frame_waits_, false)) {
    held_[new_].final_ms = now_ms;
    const size_t filled_next = prev_;
    prev_ = next_;
    next_ = new_;
    new_ = filled_next;
    ++frames_;
  }
  if (std::exchange(lut_waits_, false)) {
    for (size_t i = 0; i < lut_.size(); ++i) lut_[i] = new_lut_[i] >> 1;
  }
}

std::array<uint8_t, fadecandy::kStripPixels * 3> FadecandyLight::Strip(size_t strip) const {
  std::array<uint8_t, fadecandy::kStripPixels * 3> out;
  for (size_t i = 0; i < fadecandy::kStripPixels; ++i) {
    const uint8_t* const rgb = output_.data() + (strip * fadecandy::kStripPixels + i) * 3;
    out[3 * i] = rgb[1];
    out[3 * i + 1] = rgb[0];
    out[3 * i + 2] = rgb[2];
  }
  return out;
}

}  // namespace voxeld::display::emulator
