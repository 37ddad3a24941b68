// The feed whose content goes through the local socket.
//
// Bound to its loop's thread.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/bench/voxel_bench/feed.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::bench {

enum class MemoryUse : uint8_t {
  kFresh,  // each frame's content is put into new memory, which is sealed, handed over and released
  kAgain,  // it is handed over once, and every frame names it
};

// A batch whose payloads have been put one after the other into `memory`, and named in their place.
struct Named {
  v1::StreamRequest request;
  std::string memory;
};
// `batch`: of segments. `memory_id`: of the memory that is to hold them.
Named InMemory(v1::StreamRequest batch, uint64_t memory_id);

// Unimplemented if the daemon offers no local socket. `batches`: the content of the frames, in
// turns.
absl::StatusOr<std::unique_ptr<Feed>> FeedMemory(Loop& loop, const std::string& target,
                                                 const std::vector<v1::StreamRequest>& batches,
                                                 MemoryUse use);

}  // namespace voxeld::bench
