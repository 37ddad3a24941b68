// What passes between a target and what it attacks, counted where it happens: a transfer that was answered, a message that was taken.
// For programs that run targets for long (tests/fuzz/exchanges); elsewhere nobody reads it. One thread.
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
  // What a driver or a device is told outside a session.
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
  kFailed,    // the transfer ends otherwise
  kTookLess,  // of what it was sent, or so it says
  kBytes,     // some are others
  kNumber,    // where numbers are
  kGarbage,
  kShort,
  kFlipped,   // bits
  kSequence,  // another number of an event
  kDelayed,
  kReplayed,  // an answer of before
  kDamaged,   // what it was sent, on the way: a wrong CRC
  kEnd
};
inline constexpr std::array<const char*, static_cast<size_t>(ExchangeOutcome::kEnd)> kOutcomeNames =
    {"accepted", "refused", "failed",   "took_less", "bytes",    "number", "garbage",
     "short",    "flipped", "sequence", "delayed",   "replayed", "damaged"};

struct Exchanges {
  uint64_t total = 0;
  std::array<std::array<uint64_t, kOutcomeNames.size()>, kExchangeNames.size()> by = {};
  // Of drivers: what the lies came to.
  uint64_t attaches = 0, transfers_failed = 0, slices_resent = 0, volumes_shown = 0,
           volumes_lost = 0;
  uint64_t overcome = 0;  // sessions of which the end was right, once all told the truth
};

inline Exchanges unread_exchanges;
// Where to count; never null.
inline Exchanges* exchanges = &unread_exchanges;

inline void CountExchange(ExchangeKind kind, ExchangeOutcome outcome) {
  ++exchanges->total;
  ++exchanges->by[static_cast<size_t>(kind)][static_cast<size_t>(outcome)];
}
inline void CountExchange(ExchangeKind kind, bool accepted) {
  CountExchange(kind, accepted ? ExchangeOutcome::kAccepted : ExchangeOutcome::kRefused);
}

}  // namespace voxeld::fuzz
