// Records which of its owner's bulk memory a worker reads, and holds it on the worker's behalf: a
// block must not be reused before the worker has dropped the geometry in it.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "absl/status/statusor.h"
#include "gpu/delta.h"

namespace voxeld::gpu {

// Thread-bound.
class BulkLedger {
 public:
  // The changes of a delta, in order. It holds the blocks.
  struct Change {
    struct Step {
      uint64_t geometry = 0;
      std::shared_ptr<const void> block;  // null: dropped
      bool by_cpu = false;                // the geometry is drawn by the CPU, whatever the engine
    };
    bool reset = false;  // comes first
    std::vector<Step> steps;
  };

  // Errors: InvalidArgument if the delta refers to a block that did not come with it. Does not
  // check records: the worker rejects malformed ones.
  static absl::StatusOr<Change> ChangeOf(std::span<const std::byte> delta,
                                         std::span<const BulkBlock> referred);

  // Called when the worker has applied the delta. `copies`: its engine has copied the data that it
  // draws itself.
  void Apply(Change change, bool copies);

  size_t size() const { return held_.size(); }

 private:
  absl::flat_hash_map<uint64_t, std::shared_ptr<const void>> held_;  // by geometry
};

}  // namespace voxeld::gpu
