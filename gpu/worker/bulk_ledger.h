// What a worker reads of its owner's bulk memory, held on its behalf: a block must not be used again
// before the geometry in it is dropped over there.
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
  // What a delta changes, in order. It holds the blocks.
  struct Change {
    struct Step {
      uint64_t geometry = 0;
      std::shared_ptr<const void> block;  // null: dropped
      bool by_cpu = false;                // the geometry is drawn by the CPU, whatever the engine
    };
    bool reset = false;  // first
    std::vector<Step> steps;
  };

  // InvalidArgument if the delta refers to a block that did not come along. Records are not checked:
  // what is malformed the worker refuses.
  static absl::StatusOr<Change> ChangeOf(std::span<const std::byte> delta,
                                         std::span<const BulkBlock> referred);

  // The worker has applied the delta. `copies`: its engine has copied what it draws itself.
  void Apply(Change change, bool copies);

  size_t size() const { return held_.size(); }

 private:
  absl::flat_hash_map<uint64_t, std::shared_ptr<const void>> held_;  // by geometry
};

}  // namespace voxeld::gpu
