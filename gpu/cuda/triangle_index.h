// Small triangles by the regions that they touch. Deferred batches keep `regions`, a bit for each
// region.
#pragma once

#include <cstdint>

#include "gpu/cuda/region_index.h"
#include "gpu/cuda/triangle_types.h"

namespace voxeld::gpu::cuda {

// A batch's `begin` and `spans` are the arrays `begin` and `places` of TriangleBatchView.
class TriangleIndex final : public RegionIndex {
 public:
  TriangleIndex(Device& device, ListBudget& lists)
      : RegionIndex(device, lists, "triangles", sizeof(CompactTriangle), 3 * sizeof(uint32_t)) {}

  TriangleBatchList view() const;  // valid after Merge

 private:
  uint64_t MostRegions() const override;
  absl::Status Make(const TableEntry* table, const ItemList& list, const Batch& batch) override;
  absl::Status Copy(const ItemList& list, uint64_t first, uint32_t count, const Batch& from,
                    const Batch& to) override;
  absl::Status SortAll(Batch& batch, uint8_t* region_dirty) override;
  absl::Status SortExactly(Batch& batch, Block& regions, const RegionGrid& within,
                           uint8_t* region_dirty) override;
  absl::Status FindRegions(const Batch& batch, uint64_t* regions) override;
  absl::Status MarkAll(const Batch& batch, uint8_t* region_dirty) override;
  absl::Status Touch(const ItemList& list, uint32_t count, const Batch& batch,
                     uint8_t* region_dirty) override;

  uint64_t MostPlaces(const Batch& batch) const;
  // Sorts with memory for the greatest possible number of places, or, if `counted`, which waits for
  // the device, for the exact number.
  absl::Status SortInto(Batch& batch, const RegionGrid& within, uint8_t* region_dirty,
                        bool counted);
};

}  // namespace voxeld::gpu::cuda
