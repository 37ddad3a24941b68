// What the daemon promises of a client that means harm, and whether it was kept.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/e2e/hostile/attacks.h"

namespace voxeld::e2e {

inline constexpr uint64_t kMostBytes = 64u << 10;
inline constexpr double kMostSeconds = 5;
inline constexpr double kMostGrowthKib = 1024;  // a peer
inline constexpr double kMostSlowdown = 1.2;    // of others' 99th percentile
inline constexpr double kMostRecoverySeconds = 1;

// What one attack by some peers came to.
struct AttackFigures {
  uint64_t connections = 0;  // that were made
  uint64_t cut = 0;
  uint64_t under_way = 0;  // at the end of the measurement
  uint64_t most_bytes = 0;
  double most_seconds = 0;  // of any connection, also of those that were not cut
  double growth_kib = 0;    // of the daemon's memory, a peer
  double p99_alone_ms = 0, p99_attacked_ms = 0;  // of another client's calls
};

// Adds one connection. `last`: the measurement ended with it, cut or not.
void Add(const AttackResult& result, bool last, AttackFigures& figures);
// Adds what another peer's connections came to.
void Add(const AttackFigures& peer, AttackFigures& figures);

struct Verdict {
  std::string what;
  double measured = 0, target = 0;
  bool reached = false;
};

// Of a client without trust: cut, in bytes, seconds, memory and others' time. Of one with trust only
// that it was cut, as it may send.
std::vector<Verdict> Judge(bool trusted, const AttackFigures& figures);

}  // namespace voxeld::e2e
