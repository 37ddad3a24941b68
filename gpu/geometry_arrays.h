// A geometry's arrays as their owner keeps them: in bulk memory, where engines read them in place,
// or, if they are small, in ordinary memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "absl/status/statusor.h"
#include "gpu/bulk/bulk_block.h"
#include "gpu/bulk/bulk_pool.h"
#include "gpu/delta.h"

namespace voxeld::gpu {

// A handle: copies are of the same arrays. Written by who made it, before anyone else holds it.
class GeometryArrays {
 public:
  // What takes less is not worth a block.
  static constexpr uint64_t kLeastBulk = 1024;

  GeometryArrays() = default;  // of a geometry without vertices

  // Room for what `record` states, what is in it undefined. `pool` null: ordinary memory.
  // ResourceExhausted if there is none.
  static absl::StatusOr<GeometryArrays> Allocate(const GeometryRecord& record, BulkPool* pool);
  // Copies, whose lengths are those that `record` states. Ends the process where the system has no
  // memory: for small ones.
  static GeometryArrays Of(const GeometryRecord& record, std::span<const float> positions,
                           std::span<const uint32_t> indices = {},
                           std::span<const uint32_t> colors = {});

  std::span<const float> positions() const { return positions_; }
  std::span<const uint32_t> indices() const { return indices_; }
  std::span<const uint32_t> colors() const { return colors_; }
  std::span<float> writable_positions() { return positions_; }
  std::span<uint32_t> writable_indices() { return indices_; }
  std::span<uint32_t> writable_colors() { return colors_; }

  const BulkBlock& block() const { return block_; }  // none: in ordinary memory

 private:
  BulkBlock block_;
  std::shared_ptr<std::byte> memory_;  // if there is no block
  std::span<float> positions_;
  std::span<uint32_t> indices_, colors_;
};

}  // namespace voxeld::gpu
