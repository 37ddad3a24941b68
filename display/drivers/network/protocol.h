// Constants of the protocols by which LED controllers receive pixels over a network.
// docs/protocols/network.md describes how they are used here.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace voxeld::display::network {

enum class Protocol : uint8_t { kDdp, kE131, kArtNet, kOpc };

// Distributed Display Protocol (3waylabs): UDP.
namespace ddp {
inline constexpr uint16_t kPort = 4048;
inline constexpr size_t kHeader = 10;
inline constexpr uint8_t kVersion1 = 0x40, kPush = 0x01;
inline constexpr uint8_t kRgb8 = 0x0B;        // RGB, 8 bits per element
inline constexpr uint8_t kDefaultOutput = 1;  // destination
inline constexpr int32_t kPixels = 480;       // in a packet: 1,440 bytes
}  // namespace ddp

// ANSI E1.31-2018, streaming ACN: UDP. Offsets are those of table 4-1.
namespace e131 {
inline constexpr uint16_t kPort = 5568;
inline constexpr std::array<uint8_t, 16> kPreamble = {0,   0x10, 0,   0,   'A', 'S', 'C', '-',
                                                      'E', '1',  '.', '1', '7', 0,   0,   0};
inline constexpr size_t kRootLength = 16, kRootVector = 18, kCid = 22, kFramingLength = 38,
                        kFramingVector = 40, kSourceName = 44, kPriority = 108, kSync = 109,
                        kSequence = 111, kOptions = 112, kUniverse = 113, kDmpLength = 115,
                        kDmpVector = 117, kDmpType = 118, kDmpIncrement = 121, kDmpCount = 123,
                        kStartCode = 125, kData = 126;
inline constexpr size_t kSourceNameBytes = 64;
inline constexpr uint32_t kRootData = 4, kRootExtended = 8, kFramingData = 2, kFramingSync = 1;
inline constexpr uint8_t kDmpSet = 2, kDmpAddressType = 0xA1;
inline constexpr size_t kSyncSequence = 44, kSyncAddress = 45, kSyncBytes = 49;  // §6.3
inline constexpr uint8_t kStreamTerminated = 0x40;
inline constexpr int32_t kMostUniverse = 63999;
}  // namespace e131

// Art-Net 4: UDP.
namespace artnet {
inline constexpr uint16_t kPort = 6454;
inline constexpr std::array<uint8_t, 8> kId = {'A', 'r', 't', '-', 'N', 'e', 't', 0};
inline constexpr uint16_t kOpDmx = 0x5000, kOpSync = 0x5200, kRevision = 14;
inline constexpr size_t kHeader = 18, kSyncBytes = 14;
inline constexpr int32_t kMostUniverse = 32767;  // 15 bits
}  // namespace artnet

// Open Pixel Control: TCP.
namespace opc {
inline constexpr uint16_t kPort = 7890;
inline constexpr size_t kHeader = 4;
inline constexpr uint8_t kSetPixels = 0;
inline constexpr int32_t kPixels = 16384;  // in one message here; 21,845 are possible
}  // namespace opc

// Whole pixels in a DMX universe of 512 slots.
inline constexpr int32_t kUniversePixels = 170;

// After this long without a packet, everything is sent to the controller again.
inline constexpr int64_t kRefreshNs = 800'000'000;

}  // namespace voxeld::display::network
