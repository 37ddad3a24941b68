// Small triangles by the regions that they touch.
#pragma once

#include <cstdint>

#include "gpu/cuda/region_index.h"
#include "gpu/cuda/triangle_types.h"

namespace voxeld::gpu::cuda {

// A batch's `begin` and `spans` are TriangleBatchView's arrays `begin` and `places`.
class TriangleIndex final : public RegionIndex {
 public:
  explicit TriangleIndex(Device& device)
      : RegionIndex(device, "triangles", sizeof(CompactTriangle), 3 * sizeof(uint32_t)) {}

  TriangleBatchList view() const;  // after Merge

 private:
  uint64_t MostRegions() const override;
  absl::Status Make(const TableEntry* table, const ItemList& list, const Batch& batch) override;
  absl::Status Copy(const ItemList& list, uint64_t first, uint32_t count, const Batch& from,
                    const Batch& to) override;
  absl::Status Sort(Batch& batch, uint8_t* region_dirty) override;
  absl::Status MarkAll(const Batch& batch, uint8_t* region_dirty) override;
  absl::Status Touch(const ItemList& list, uint32_t count, const Batch& batch,
                     uint8_t* region_dirty) override;
};

}  // namespace voxeld::gpu::cuda
