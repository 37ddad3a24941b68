// Malicious clients on plain sockets, over loopback only.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

namespace voxeld::e2e {

enum class Attack : uint8_t {
  // Attacks by an unauthorised client, from its first byte on.
  kHugeHeader,         // one header field of 100 MB, in frames of 16 KiB
  kVarintPadding,      // a length whose digits never end
  kContinuationFlood,  // headers that never end: an unlimited number of small fields
  kRapidReset,         // calls that are cancelled as soon as they have started
  kLargeFirstCall,     // an ApplyUpdate of 1 MiB before anything else
  kSlowLoris,          // the preface, a byte at a time
  kSlowCall,           // a call's headers, a byte at a time
  kSlowMessage,        // a call's first message, a byte at a time
  kHalfOpen,           // nothing at all
  // Attacks by an unauthorised client that first asks for the daemon's health, which needs no
  // authorisation, or calls with garbage.
  kCheckedHugeHeader,
  kCheckedContinuation,
  kCheckedReset,
  kCheckedMadeReset,
  kGarbageContinuation,  // WatchScene with three bytes that are not a message
  // Attacks by a client that was answered by one of the daemon's own services.
  kTrustedHugeHeader,
  kTrustedContinuation,
  kTrustedReset,
  kTrustedUnsentReset,  // calls whose message has not been sent yet
  // Calls that the server itself is caused to reset: by a wrongly framed message, by a window
  // increment of zero, by bytes after the end.
  kTrustedMadeReset,
  kTrustedMadeResetByWindow,
  kTrustedMadeResetByEnd,
};
std::vector<Attack> AllAttacks();
const char* AttackName(Attack attack);
// Returns whether the attack needs an authorised client: the daemon's promises only apply to those
// without authorisation.
bool NeedsTrust(Attack attack);

struct AttackResult {
  bool connected = false;
  bool cut = false;              // disconnected by the daemon, in time
  uint64_t bytes_delivered = 0;  // bytes that the daemon's kernel acknowledged
  double seconds = 0;            // from connecting to the end
  bool prepared = false;         // the calls before the attack itself were answered
};

// Connects to `target` (127.0.0.1:PORT) from the loopback address `source` and attacks until it is
// disconnected or `end` has come.
AttackResult RunAttack(Attack attack, const std::string& target, const std::string& source,
                       std::chrono::steady_clock::time_point end);

// Starts a connection to `target` that sends nothing, without waiting for it. Returns its
// descriptor; −1 if that failed.
int BeginToConnect(const std::string& target, const std::string& source = "127.0.0.1");

}  // namespace voxeld::e2e
