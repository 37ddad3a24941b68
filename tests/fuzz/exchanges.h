// Counts what passes between a target and the code under attack, where it happens: a transfer that
// was answered, a message that was accepted. For programs that run targets for a long time
// (tests/fuzz/exchanges); elsewhere the counts are not read. Single-threaded.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace voxeld::fuzz {

enum class ExchangeKind : uint8_t {
  // Answers of a device to its driver.
  kConfiguration,
  kCapabilities,
  kStatus,
  kWrite,
  kEvent,
  kPackets,
  // Data about or from a driver or a device, outside a session.
  kCapabilityBlock,
  kDecoded,
  kModel,
  kFirmware,
  // Messages of peers.
  kStore,
  kKeptRow,
  kLocal,
  kDatagram,
  kNetwork,
  kOpc,
  kViewer,
  kWebSocket,
  kGreeting,
  kEnd
};
inline constexpr std::array<const char*, static_cast<size_t>(ExchangeKind::kEnd)> kExchangeNames = {
    "configuration", "capabilities", "status",   "write",      "event",    "packets", "blocks",
    "decoded",       "device",       "firmware", "store",      "kept_row", "local",   "datagram",
    "network",       "opc",          "viewer",   "web_socket", "greeting"};

enum class ExchangeOutcome : uint8_t {
  kAccepted,  // or the truth
  kRefused,   // with a reason
  // Lies of a device.
  kFailed,    // the transfer ends with another status
  kTookLess,  // fewer bytes than it was sent, or so it says
  kBytes,     // some bytes are changed
  kNumber,    // in places that hold numbers
  kGarbage,
  kShort,
  kFlipped,   // flipped bits
  kSequence,  // another sequence number of an event
  kDelayed,
  kReplayed,  // an earlier answer
  kDamaged,   // what it was sent is changed on the way: a wrong CRC
  kEnd
};
inline constexpr std::array<const char*, static_cast<size_t>(ExchangeOutcome::kEnd)> kOutcomeNames =
    {"accepted", "refused", "failed",   "took_less", "bytes",    "number", "garbage",
     "short",    "flipped", "sequence", "delayed",   "replayed", "damaged"};

struct Exchanges {
  uint64_t total = 0;
  std::array<std::array<uint64_t, kOutcomeNames.size()>, kExchangeNames.size()> by = {};
  // Results of the lies in drivers.
  uint64_t attaches = 0, transfers_failed = 0, slices_resent = 0, volumes_shown = 0,
           volumes_lost = 0;
  uint64_t overcome = 0;  // sessions that ended well once both sides told the truth
};

inline Exchanges unread_exchanges;
// The counters in use; never null.
inline Exchanges* exchanges = &unread_exchanges;

inline void CountExchange(ExchangeKind kind, ExchangeOutcome outcome) {
  ++exchanges->total;
  ++exchanges->by[static_cast<size_t>(kind)][static_cast<size_t>(outcome)];
}
inline void CountExchange(ExchangeKind kind, bool accepted) {
  CountExchange(kind, accepted ? ExchangeOutcome::kAccepted : ExchangeOutcome::kRefused);
}

}  // namespace voxeld::fuzz
