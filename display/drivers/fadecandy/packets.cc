#include "display/drivers/fadecandy/packets.h"

#include <algorithm>
#include <array>
#include <cstring>

namespace voxeld::display::fadecandy {
namespace {

using Packet = std::array<std::byte, kPacketBytes>;

std::byte Control(PacketType type, size_t index, bool final) {
  return static_cast<std::byte>(static_cast<size_t>(type) << 6 | (final ? kFinal : 0u) | index);
}

}  // namespace

void AppendFrame(TransferBytes& out, std::span<const std::byte> rgb, size_t begin, size_t end) {
  for (size_t i = begin; i < end; ++i) {
    Packet packet{};
    packet[0] = Control(PacketType::kVideo, i, i == kLastPacket);
    std::memcpy(packet.data() + 1, rgb.data() + FrameOffset(i), FrameLength(i));
    out.Append(packet);
  }
}

void AppendLut(TransferBytes& out, const Lut& lut) {
  for (size_t i = 0; i < kLutPackets; ++i) {
    Packet packet{};
    packet[0] = Control(PacketType::kLut, i, i == kLutPackets - 1);
    const size_t end = std::min((i + 1) * kLutPerPacket, lut.size());
    for (size_t entry = i * kLutPerPacket; entry < end; ++entry) {
      const size_t at = 2 + 2 * (entry % kLutPerPacket);
      packet[at] = static_cast<std::byte>(lut[entry] & 0xFF);
      packet[at + 1] = static_cast<std::byte>(lut[entry] >> 8);
    }
    out.Append(packet);
  }
}

void AppendConfig(TransferBytes& out, uint8_t flags) {
  Packet packet{};
  packet[0] = Control(PacketType::kConfig, 0, false);
  packet[1] = std::byte{flags};
  out.Append(packet);
}

}  // namespace voxeld::display::fadecandy
