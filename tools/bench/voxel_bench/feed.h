// Sends the same bytes for some time, to the daemon or to the bare sink.
//
// Bound to its loop's thread.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/bench/voxel_bench/session.h"
#include "tools/bench/voxel_bench/wire.h"

namespace voxeld::bench {

// The amount that was received in a round: from the first byte until the daemon has applied the
// last commit, or the sink has counted the last byte.
struct Fed {
  uint64_t frames = 0, bytes = 0;
  sync::TimeNs took_ns = 0;
};

using Frames = std::vector<std::vector<Message>>;

// When written messages are passed to the transport.
enum class Flush : uint8_t {
  // With the commit, or when gRPC's buffers are full: all but the last say that more follows.
  kEachFrame,
  kEachMessage,  // immediately, which is gRPC's default
};

class Feed {
 public:
  virtual ~Feed() = default;
  // Sends whole frames, each with its commit, cyclically.
  virtual absl::StatusOr<Fed> Round(sync::TimeNs duration) = 0;
};

// Uses one session for all rounds, so every frame after the first replaces everything.
absl::StatusOr<std::unique_ptr<Feed>> FeedDaemon(Loop& loop, const Target& target, Frames frames,
                                                 Flush flush);
// Makes one call per round.
std::unique_ptr<Feed> FeedSink(Loop& loop, const std::string& target, Frames frames, Flush flush);

}  // namespace voxeld::bench
