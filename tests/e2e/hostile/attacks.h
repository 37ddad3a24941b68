// Clients that mean harm, on plain sockets, over loopback only.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

namespace voxeld::e2e {

enum class Attack : uint8_t {
  // Of a stranger, from its first byte on.
  kHugeHeader,         // one header field of 100 MB, in frames of 16 KiB
  kVarintPadding,      // a length whose digits never end
  kContinuationFlood,  // headers that never end: small fields without number
  kRapidReset,         // calls that are cancelled as soon as they have begun
  kLargeFirstCall,     // an ApplyUpdate of 1 MiB before anything else
  kSlowLoris,          // the preface, a byte at a time
  kSlowCall,           // a call's headers, a byte at a time
  kSlowMessage,        // a call's first message, a byte at a time
  kHalfOpen,           // nothing at all
  // Of a stranger who first asks for the daemon's health, as anybody may, or calls with garbage.
  kCheckedHugeHeader,
  kCheckedContinuation,
  kCheckedReset,
  kCheckedMadeReset,
  kGarbageContinuation,  // WatchScene with three bytes that are no message
  // Of a client that was answered by one of the daemon's own services.
  kTrustedHugeHeader,
  kTrustedContinuation,
  kTrustedReset,
  kTrustedUnsentReset,  // of calls whose message was not sent yet
  // Calls that the server itself is made to reset: by a message that is framed wrongly, by a window that
  // grows by nothing, by bytes after the end.
  kTrustedMadeReset,
  kTrustedMadeResetByWindow,
  kTrustedMadeResetByEnd,
};
std::vector<Attack> AllAttacks();
const char* AttackName(Attack attack);
// What the daemon promises holds of those without trust alone.
bool NeedsTrust(Attack attack);

struct AttackResult {
  bool connected = false;
  bool cut = false;              // by the daemon, in time
  uint64_t bytes_delivered = 0;  // that the daemon's kernel acknowledged
  double seconds = 0;            // from connecting to the end
  bool prepared = false;         // what comes before the attack itself was answered
};

// Connects to `target` (127.0.0.1:PORT) from the loopback address `source` and attacks until it is cut
// or `end` has come.
AttackResult RunAttack(Attack attack, const std::string& target, const std::string& source,
                       std::chrono::steady_clock::time_point end);

// A connection to `target` that sends nothing; −1 if there is none. Does not wait for it.
int BeginToConnect(const std::string& target, const std::string& source = "127.0.0.1");

}  // namespace voxeld::e2e
