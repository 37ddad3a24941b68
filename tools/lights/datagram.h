// Received light data of DDP, E1.31 and Art-Net, one packet per datagram. Packets are parsed as
// their protocols define them, from any sender; docs/lights.md says how they are used.
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
    kLights,  // values, from `first_byte` of the named lights on
    kShow,    // show what was received
    kEnd,     // the sender will send no more of this universe
    kAsk,     // Art-Net: a poll for nodes
    kOther,   // none of these
  };
  Kind kind = Kind::kOther;
  int32_t universe = 0;  // E1.31, Art-Net. For kShow of E1.31: the synchronisation's
  // DDP: show the values received up to this packet; otherwise others may follow.
  size_t first_byte = 0;  // DDP
  bool push = false;
  std::optional<uint8_t> sequence;  // if the sender counts
  uint8_t priority = 100;           // E1.31: 0 to 200
  // E1.31: if not 0, the values are shown when a packet for this universe says so.
  uint16_t sync_universe = 0;
  std::array<uint8_t, 16> source{};  // E1.31: its CID
  std::span<const uint8_t> values;   // one byte each; a view of the packet
};

// Maximum size of a packet in bytes; a longer one belongs to none of these protocols.
inline constexpr size_t kMostDatagram = 9216;

// Parses a packet. Errors: InvalidArgument with the offset, what is there, and what was expected.
absl::StatusOr<Datagram> ReadDatagram(Protocol protocol, std::span<const uint8_t> packet);

// Returns Art-Net's answer to kAsk: a node that takes 512 channels of each of `universes` from
// `first` on (only four are named, because one answer holds no more). `ip` and `port` are the
// node's own.
std::array<uint8_t, 239> ArtPollReply(std::array<uint8_t, 4> ip, uint16_t port, int32_t first,
                                      int32_t universes);

}  // namespace voxeld::lights
