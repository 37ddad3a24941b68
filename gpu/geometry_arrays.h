// A geometry's arrays as their owner stores them: in bulk memory, where engines read them in place,
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

// A handle: copies refer to the same arrays. Only its creator writes to the arrays, before anyone
// else holds a handle.
class GeometryArrays {
 public:
  // Smaller arrays are not worth a block of bulk memory.
  static constexpr uint64_t kLeastBulk = 1024;

  GeometryArrays() = default;  // for a geometry without vertices

  // Allocates the arrays that `record` states, with undefined contents. If `pool` is null they are
  // in ordinary memory. Errors: ResourceExhausted if memory runs out.
  static absl::StatusOr<GeometryArrays> Allocate(const GeometryRecord& record, BulkPool* pool);
  // Copies arrays, whose lengths must be those that `record` states. Terminates the process if the
  // system is out of memory, so use it for small arrays.
  static GeometryArrays Of(const GeometryRecord& record, std::span<const float> positions,
                           std::span<const uint32_t> indices = {},
                           std::span<const uint32_t> colors = {});

  std::span<const float> positions() const { return positions_; }
  std::span<const uint32_t> indices() const { return indices_; }
  std::span<const uint32_t> colors() const { return colors_; }
  std::span<float> writable_positions() { return positions_; }
  std::span<uint32_t> writable_indices() { return indices_; }
  std::span<uint32_t> writable_colors() { return colors_; }

  const BulkBlock& block() const { return block_; }  // empty if the arrays are in ordinary memory

 private:
  BulkBlock block_;
  std::shared_ptr<std::byte> memory_;  // used without a block
  std::span<float> positions_;
  std::span<uint32_t> indices_, colors_;
};

}  // namespace voxeld::gpu
