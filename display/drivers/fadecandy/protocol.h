// The Fadecandy's USB protocol as numbers. Each names its section of docs/protocols/fadecandy.md,
// which explains it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace voxeld::display::fadecandy {

// §1 USB
inline constexpr uint16_t kVendorId = 0x1D50;
inline constexpr uint16_t kProductId = 0x607A;
inline constexpr uint16_t kBcdDevice = 0x0108;
inline constexpr uint8_t kBulkOut = 0x01;

// §2 Packets
inline constexpr size_t kPacketBytes = 64;
inline constexpr uint8_t kFinal = 1u << 5;
inline constexpr uint8_t kIndexMask = 0x1F;
enum class PacketType : uint8_t { kVideo = 0, kLut = 1, kConfig = 2, kNothing = 3 };
constexpr PacketType TypeOf(std::byte control) {
  return static_cast<PacketType>(std::to_integer<uint8_t>(control) >> 6);
}
constexpr size_t IndexOf(std::byte control) {
  return std::to_integer<size_t>(control) & kIndexMask;
}
constexpr bool IsFinal(std::byte control) {
  return (std::to_integer<uint8_t>(control) & kFinal) != 0;
}

// §3 Video
inline constexpr size_t kStrips = 8;
inline constexpr size_t kStripPixels = 64;
inline constexpr size_t kPixels = kStrips * kStripPixels;
inline constexpr size_t kFrameBytes = kPixels * 3;  // of R, G, B
inline constexpr size_t kPixelsPerPacket = 21;
inline constexpr size_t kFramePackets = 25;
inline constexpr size_t kLastPacket = kFramePackets - 1;  // the one with FINAL
static_assert((kPixels + kPixelsPerPacket - 1) / kPixelsPerPacket == kFramePackets);

// §4 Colour table
inline constexpr size_t kLutEntries = 257;  // a channel
inline constexpr size_t kLutPerPacket = 31;
inline constexpr size_t kLutPackets = 25;
using Lut = std::array<uint16_t, 3 * kLutEntries>;  // all red, all green, all blue
static_assert((3 * kLutEntries + kLutPerPacket - 1) / kLutPerPacket == kLutPackets);

// §5 Configuration
enum ConfigFlag : uint8_t {
  kNoDither = 1u << 0,
  kNoInterpolation = 1u << 1,
  kManualLed = 1u << 2,
  kLedOn = 1u << 3,
};

// §7 Requests
inline constexpr uint8_t kRequestIn = 0xC0;
inline constexpr uint8_t kGetCounter = 0x01;
inline constexpr uint16_t kRefreshCounter = 0;  // wIndex
inline constexpr uint16_t kFrameCounter = 1;
inline constexpr uint8_t kMsVendorCode = 0x7E;
inline constexpr uint16_t kMsCompatibleId = 4;  // wIndex
inline constexpr uint16_t kMsProperties = 5;

}  // namespace voxeld::display::fadecandy
