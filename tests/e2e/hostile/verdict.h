// The daemon's promises about malicious clients, and whether they were kept.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/e2e/hostile/attacks.h"

namespace voxeld::e2e {

inline constexpr uint64_t kMostBytes = 64u << 10;
inline constexpr double kMostSeconds = 5;
inline constexpr double kMostGrowthKib = 1024;  // for each peer
inline constexpr double kMostSlowdown = 1.2;    // for the 99th percentile of other clients
inline constexpr double kMostRecoverySeconds = 1;

// The results of one attack by several peers.
struct AttackFigures {
  uint64_t connections = 0;  // that were made
  uint64_t cut = 0;
  uint64_t under_way = 0;  // at the end of the measurement
  uint64_t most_bytes = 0;
  double most_seconds = 0;  // of any connection, including those that were not disconnected
  double growth_kib = 0;    // growth of the daemon's memory for each peer
  double p99_alone_ms = 0, p99_attacked_ms = 0;  // for another client's calls
};

// Adds one connection. `last`: the measurement ended with it, disconnected or not.
void Add(const AttackResult& result, bool last, AttackFigures& figures);
// Adds the results of another peer's connections.
void Add(const AttackFigures& peer, AttackFigures& figures);

struct Verdict {
  std::string what;
  double measured = 0, target = 0;
  bool reached = false;
};

// Judges an unauthorised client by its disconnection, bytes, seconds, memory and the time of
// others; an authorised one, which may send, only by its disconnection.
std::vector<Verdict> Judge(bool trusted, const AttackFigures& figures);

}  // namespace voxeld::e2e
