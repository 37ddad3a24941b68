// Packets of pixels: made, and read again.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "display/drivers/network/protocol.h"

namespace voxeld::display::network {

// What of a stream does not change.
struct StreamOptions {
  Protocol protocol = Protocol::kDdp;
  int32_t first_universe = 1;  // of slice 0; Art-Net counts from 0. OPC: the channel
  uint8_t priority = 100;      // E1.31: 0 to 200
  // E1.31: the universe that sync packets name, Art-Net: any but 0 asks for them. 0: controllers show what comes when it comes.
  int32_t sync_universe = 0;
  std::string source_name = "voxeld";  // E1.31: 63 bytes at most
  std::array<uint8_t, 16> cid{};       // E1.31: of this sender, always the same
};

// Pixels of a slice that one packet can have.
int32_t MostPixels(Protocol protocol);
// Slices that a stream can have.
int32_t MostSlices(const StreamOptions& options);

// Makes a display's packets; keeps sequence numbers.
class PacketWriter {
 public:
  // Slices of `pixels` pixels each.
  PacketWriter(StreamOptions options, int32_t pixels);

  // The packet of a slice. rgb: pixels · 3 bytes. `last`: of this volume.
  std::vector<std::byte> Pixels(int32_t slice, std::span<const uint8_t> rgb, bool last);
  // What makes controllers show what they have; empty where there is no such packet.
  std::vector<std::byte> Sync();
  // E1.31: numbers go on half their range further on. A receiver passes over the 20 numbers up to the last that it had
  // from this source (ANSI E1.31 §6.7.2), be it in a daemon's life before this: of a picture sent before and after, one passes.
  // False: the protocol's receivers have no such memory.
  bool Leap();
  // What tells them that this stream ends, of a slice; empty where there is none.
  std::vector<std::byte> End(int32_t slice, std::span<const uint8_t> rgb);

 private:
  std::vector<std::byte> Ddp(int32_t slice, std::span<const uint8_t> rgb, bool last);
  std::vector<std::byte> E131(int32_t slice, std::span<const uint8_t> rgb, uint8_t flags);
  std::vector<std::byte> ArtNet(int32_t slice, std::span<const uint8_t> rgb);
  std::vector<std::byte> Opc(int32_t slice, std::span<const uint8_t> rgb) const;

  const StreamOptions options_;
  const int32_t pixels_;
  uint8_t ddp_sequence_ = 0;                 // 1 to 15
  std::vector<uint8_t> universe_sequences_;  // of each slice
  uint8_t sync_sequence_ = 0;
};

// What a packet says.
struct ReadPacket {
  enum class Kind : uint8_t { kPixels, kSync, kEnd };
  Kind kind = Kind::kPixels;
  int32_t slice = 0;
  bool last = false;                    // DDP's push
  uint8_t sequence = 0;                 // 0: none
  std::span<const std::byte> rgb = {};  // within the packet
};

// Nothing if it breaks the protocol, or is of no slice of that stream. `slices` of `pixels` each.
std::optional<ReadPacket> Read(const StreamOptions& options, int32_t slices, int32_t pixels,
                               std::span<const std::byte> packet);

}  // namespace voxeld::display::network
