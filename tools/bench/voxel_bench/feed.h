// The same bytes for a while, to the daemon or to the bare sink.
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

// What was taken in a round: from the first byte until the daemon has applied the last commit, or the sink
// has counted the last byte.
struct Fed {
  uint64_t frames = 0, bytes = 0;
  sync::TimeNs took_ns = 0;
};

using Frames = std::vector<std::vector<Message>>;

// When what is written goes to the transport.
enum class Flush : uint8_t {
  kEachFrame,  // with the commit, or once gRPC's buffers are full: all but the last say that more follows
  kEachMessage,  // at once, as gRPC writes when it is not told otherwise
};

class Feed {
 public:
  virtual ~Feed() = default;
  // Whole frames, each with its commit, in turns.
  virtual absl::StatusOr<Fed> Round(sync::TimeNs duration) = 0;
};

// One session for all rounds, so that after the first frame everything is replaced.
absl::StatusOr<std::unique_ptr<Feed>> FeedDaemon(Loop& loop, const Target& target, Frames frames,
                                                 Flush flush);
// One call a round.
std::unique_ptr<Feed> FeedSink(Loop& loop, const std::string& target, Frames frames, Flush flush);

}  // namespace voxeld::bench
