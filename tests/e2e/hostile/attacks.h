// Clients that mean harm, on plain sockets, over loopback only.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

namespace voxeld::e2e {

enum class Attack : uint8_t {
  kHugeHeader,          // one header field of 15 MB, in frames of 16 KiB
  kVarintPadding,       // a length whose digits never end
  kContinuationFlood,   // headers that never end: small fields without number
  kRapidReset,          // calls that are cancelled as soon as they have begun
  kTrustedRapidReset,   // the same, once a call has been answered
  kTrustedUnsentReset,  // the same, with calls whose message was not sent yet
  kLargeFirstCall,      // an ApplyUpdate of 1 MiB before anything else
  kSlowLoris,           // the preface, a byte at a time
  kHalfOpen,            // nothing at all
};
std::vector<Attack> AllAttacks();
const char* AttackName(Attack attack);

struct AttackResult {
  bool connected = false;
  bool cut = false;              // by the daemon, in time
  uint64_t bytes_delivered = 0;  // that the daemon's kernel acknowledged
  double seconds = 0;            // from connecting to the end
  bool trusted = false;          // a call was answered before the attack
};

// Connects to `target` (127.0.0.1:PORT) and attacks until it is cut or `end` has come.
AttackResult RunAttack(Attack attack, const std::string& target,
                       std::chrono::steady_clock::time_point end);

// A connection to `target` that sends nothing; −1 if there is none. Does not wait for it.
int BeginToConnect(const std::string& target);

}  // namespace voxeld::e2e
