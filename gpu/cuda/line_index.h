// Thin lines by the regions that they touch. For deferred batches without lists: unsorted-inl.h.
#pragma once

#include <cstdint>

#include "gpu/cuda/line_kernels.h"
#include "gpu/cuda/region_index.h"

namespace voxeld::gpu::cuda {

// A batch's `begin`, `base`, `offsets`, `regions` and `spans` are the arrays of SpanLists; `colors`
// are the words at the lines' ends.
class LineIndex final : public RegionIndex {
 public:
  // `few_lines`: see Tuning.
  LineIndex(Device& device, ListBudget& lists, uint32_t few_lines)
      : RegionIndex(device, lists, "lines", LineArrays::kBytes, sizeof(uint32_t)),
        few_lines_(few_lines) {}

  // Returns whether a volume of that grid can have this index on such a device.
  static bool Suits(const Api& api, const TileGrid& grid);

  LineBatchList view() const;  // valid after Merge

 private:
  uint64_t MostRegions() const override;
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

  absl::Status SortInto(Batch& batch, Block& regions, LineSort& sort, bool counted,
                        uint32_t* needed);
  bool AreFew(const Batch& batch) const;
  uint64_t MostSpans(const Batch& batch) const;
  // `few`: the arguments that are not the batch's.
  absl::Status SortFew(Batch& batch, FewLines& few, uint8_t* region_dirty);

  const uint32_t few_lines_;
  // Averages per line, as large batches had them, with a margin.
  double pieces_a_line_ = 4, spans_a_line_ = 12, spans_a_piece_ = 4;
};

}  // namespace voxeld::gpu::cuda
