// Points without thickness by the regions that they lie in: sorted in chunks, in their original
// order, so that a chunk's points in a region are a row. Deferred batches keep `regions`, a bit for
// each region.
#pragma once

#include <cstdint>

#include "gpu/cuda/point_kernels.h"
#include "gpu/cuda/region_index.h"

namespace voxeld::gpu::cuda {

// A batch's `base`, `offsets`, `regions` and `spans` are the arrays of PointBatchView, where
// `spans` are its records; `begin` says which chunks are touched, and `within` which regions the
// lists cover.
class PointIndex final : public RegionIndex {
 public:
  // `points_each`, `few_points`: see Tuning.
  PointIndex(Device& device, ListBudget& lists, uint32_t points_each, uint32_t few_points)
      : RegionIndex(device, lists, "points", sizeof(PlacedPoint), 0),
        points_each_(points_each),
        few_points_(few_points) {}

  // Returns whether a volume of that grid can have this index on such a device.
  static bool Suits(const Api& api, const TileGrid& grid);

  PointBatchList view() const;  // valid after Merge

 private:
  uint64_t MostRegions() const override { return 1; }
  absl::Status Make(const TableEntry* table, const ItemList& list, const Batch& batch) override;
  absl::StatusOr<bool> MakeFew(TableEntry* table, const Arrivals& arrivals, Batch& batch,
                               uint8_t* region_dirty) override;
  absl::Status Copy(const ItemList& list, uint64_t first, uint32_t count, const Batch& from,
                    const Batch& to) override;
  absl::Status SortAll(Batch& batch, uint8_t* region_dirty) override;
  absl::Status SortExactly(Batch& batch, Block& regions, const RegionGrid& within,
                           uint8_t* region_dirty) override;
  absl::Status FindRegions(const Batch& batch, uint64_t* regions) override;
  absl::Status MarkAll(const Batch& batch, uint8_t* region_dirty) override;
  absl::Status Touch(const ItemList& list, uint32_t count, const Batch& batch,
                     uint8_t* region_dirty) override;

  // Returns how many points each thread has in a chunk: as many as fit in shared memory.
  uint32_t Each() const;
  uint32_t ChunksOf(const Batch& batch) const;
  // Allocates the lists' memory, for `records` records.
  absl::StatusOr<PointSort> TakeLists(Batch& batch, const RegionGrid& within, uint32_t records);
  absl::Status QueueSort(const PointSort& sort, const Batch& batch);

  const uint32_t points_each_, few_points_;
};

}  // namespace voxeld::gpu::cuda
