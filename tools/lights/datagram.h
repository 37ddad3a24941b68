// Packets of light that come in: of DDP, E1.31 and Art-Net, each in a datagram of its own. They are read as their
// protocols have them, from whoever; docs/lights.md says what becomes of them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "absl/status/statusor.h"
#include "display/drivers/network/protocol.h"

namespace voxeld::lights {

using display::network::Protocol;

struct Datagram {
  enum class Kind : uint8_t {
    kLights,  // values, from `first_byte` of what it names on
    kShow,    // what has come is to be shown
    kEnd,     // its sender will send no more of this universe
    kAsk,     // Art-Net: who is there?
    kOther,   // nothing of these
  };
  Kind kind = Kind::kOther;
  int32_t universe = 0;             // E1.31, Art-Net. Of kShow of E1.31: the synchronisation's
  size_t first_byte = 0;            // DDP
  bool push = false;                // DDP: show what has come with this one. Else others may follow
  std::optional<uint8_t> sequence;  // where the sender counts
  uint8_t priority = 100;           // E1.31: 0 to 200
  // E1.31: not 0: to be shown when a packet for this universe says so.
  uint16_t sync_universe = 0;
  std::array<uint8_t, 16> source{};  // E1.31: its CID
  std::span<const uint8_t> values;   // a byte each; views the packet
};

// Bytes of a packet at most; more are no packet of any of these.
inline constexpr size_t kMostDatagram = 9216;

// InvalidArgument says what is wrong: the offset, what is there, and what would be right.
absl::StatusOr<Datagram> ReadDatagram(Protocol protocol, std::span<const uint8_t> packet);

// Art-Net's answer to kAsk: that there is a node which takes 512 channels of each of `universes` from `first` on (four
// are named, which is all that one answer can). `ip`, `port`: its own.
std::array<uint8_t, 239> ArtPollReply(std::array<uint8_t, 4> ip, uint16_t port, int32_t first,
                                      int32_t universes);

}  // namespace voxeld::lights
