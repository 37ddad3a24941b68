// Points without thickness by the regions that they lie in: sorted in chunks, as they come, so that
// what a chunk has in a region is a row. What is deferred keeps `regions`, a bit for each.
#pragma once

#include <cstdint>

#include "gpu/cuda/point_kernels.h"
#include "gpu/cuda/region_index.h"

namespace voxeld::gpu::cuda {

// A batch's `base`, `offsets`, `regions` and `spans` are PointBatchView's arrays, `spans` its
// records; `begin` says which chunks are touched, and `within` what the lists are of.
class PointIndex final : public RegionIndex {
 public:
  // `points_each`, `few_points`: Tuning's.
  PointIndex(Device& device, ListBudget& lists, uint32_t points_each, uint32_t few_points)
      : RegionIndex(device, lists, "points", sizeof(PlacedPoint), 0),
        points_each_(points_each),
        few_points_(few_points) {}

  // Whether a volume of that grid can have one, on such a device.
  static bool Suits(const Api& api, const TileGrid& grid);

  PointBatchList view() const;  // after Merge

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

  // Points of a thread in a chunk: as many as there is shared memory for.
  uint32_t Each() const;
  uint32_t ChunksOf(const Batch& batch) const;
  // Takes the lists' memory, of so many records.
  absl::StatusOr<PointSort> TakeLists(Batch& batch, const RegionGrid& within, uint32_t records);
  absl::Status QueueSort(const PointSort& sort, const Batch& batch);

  const uint32_t points_each_, few_points_;
};

}  // namespace voxeld::gpu::cuda
