// A feed whose content goes through the local socket.
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
  kFresh,  // each frame's content is put into new memory, which is sealed, passed and released
  kAgain,  // the memory is passed once, and every frame names it
};

// A batch whose payloads were put into `memory` one after the other, and which refers to them
// there.
struct Named {
  v1::StreamRequest request;
  std::string memory;
};
// `batch` is a batch of segments; `memory_id` is the id of the memory that will hold them.
Named InMemory(v1::StreamRequest batch, uint64_t memory_id);

// `batches` is the content of the frames, sent cyclically. Errors: Unimplemented if the daemon
// offers no local socket.
absl::StatusOr<std::unique_ptr<Feed>> FeedMemory(Loop& loop, const std::string& target,
                                                 const std::vector<v1::StreamRequest>& batches,
                                                 MemoryUse use);

}  // namespace voxeld::bench
