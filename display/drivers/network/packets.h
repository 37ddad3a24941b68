// Writes and reads packets of pixels.
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

// The constant settings of a stream.
struct StreamOptions {
  Protocol protocol = Protocol::kDdp;
  int32_t first_universe = 1;  // universe of slice 0; Art-Net counts from 0. OPC: the channel
  uint8_t priority = 100;      // E1.31: 0 to 200
  // E1.31: the universe named by sync packets; Art-Net: any value but 0 enables them. 0:
  // controllers show pixels as they come.
  int32_t sync_universe = 0;
  std::string source_name = "voxeld";  // E1.31: 63 bytes at most
  std::array<uint8_t, 16> cid{};       // E1.31: identifies this sender, always the same
};

// Returns the most pixels of a slice that fit into one packet.
int32_t MostPixels(Protocol protocol);
// Returns the most slices that a stream can have.
int32_t MostSlices(const StreamOptions& options);

// Makes a display's packets; keeps sequence numbers.
class PacketWriter {
 public:
  // Slices have `pixels` pixels each.
  PacketWriter(StreamOptions options, int32_t pixels);

  // Returns the packet of a slice. rgb: pixels · 3 bytes. `last`: the last one of this volume.
  std::vector<std::byte> Pixels(int32_t slice, std::span<const uint8_t> rgb, bool last);
  // Returns the packet that makes controllers show the received pixels; empty if the protocol has
  // none.
  std::vector<std::byte> Sync();
  // E1.31: advances the sequence numbers by half their range. A receiver ignores the 20 numbers up
  // to the last one that it had from this source (ANSI E1.31 §6.7.2), even from a former run of the
  // daemon: if a slice image is sent before and after the call, one of the two is accepted. Returns
  // false if the protocol's receivers do not remember numbers.
  bool Leap();
  // Returns the packet that announces the end of this stream for a slice; empty if the protocol has
  // none.
  std::vector<std::byte> End(int32_t slice, std::span<const uint8_t> rgb);

 private:
  std::vector<std::byte> Ddp(int32_t slice, std::span<const uint8_t> rgb, bool last);
  std::vector<std::byte> E131(int32_t slice, std::span<const uint8_t> rgb, uint8_t flags);
  std::vector<std::byte> ArtNet(int32_t slice, std::span<const uint8_t> rgb);
  std::vector<std::byte> Opc(int32_t slice, std::span<const uint8_t> rgb) const;

  const StreamOptions options_;
  const int32_t pixels_;
  uint8_t ddp_sequence_ = 0;                 // 1 to 15
  std::vector<uint8_t> universe_sequences_;  // per slice
  uint8_t sync_sequence_ = 0;
};

// The content of a packet.
struct ReadPacket {
  enum class Kind : uint8_t { kPixels, kSync, kEnd };
  Kind kind = Kind::kPixels;
  int32_t slice = 0;
  bool last = false;                    // DDP's push
  uint8_t sequence = 0;                 // 0: none
  std::span<const std::byte> rgb = {};  // within the packet
};

// Parses a packet. Returns nothing if it violates the protocol, or is not for a slice of that
// stream. `slices` of `pixels` each.
std::optional<ReadPacket> Read(const StreamOptions& options, int32_t slices, int32_t pixels,
                               std::span<const std::byte> packet);

}  // namespace voxeld::display::network
