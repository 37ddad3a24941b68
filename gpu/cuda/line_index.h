// Thin lines by the regions that they touch.
//
// Lists of spans, and what making them takes, come out of a pool with a limit. A batch for whose lists
// there is no room, or whose lists would leave too little for others' making, is deferred: of it are
// kept the lines, and which regions they touch. Before it is drawn, it is sorted as far as some blocks
// of regions go that are drawn then; or it is drawn without lists (unsorted-inl.h).
#pragma once

#include <cstdint>
#include <functional>

#include "gpu/cuda/region_index.h"

namespace voxeld::gpu::cuda {

// A batch's `begin`, `base`, `offsets`, `regions` and `spans` are SpanLists' arrays; `colors` are the
// words at lines' ends.
class LineIndex final : public RegionIndex {
 public:
  // `lists`: for the lists, and their making; `most_kept`: what lists of batches that are not
  // deferred may have of it; `few_lines`: Tuning's. Outlives the index.
  LineIndex(Device& device, Pool& lists, uint64_t most_kept, uint32_t few_lines)
      : RegionIndex(device, "lines", LineArrays::kBytes, sizeof(uint32_t)),
        lists_(lists),
        most_kept_(most_kept),
        few_lines_(few_lines) {}

  // Whether a volume of that grid can have one, on such a device.
  static bool Suits(const Api& api, const TileGrid& grid);

  LineBatchList view() const;  // after Merge

  // Sorts what was deferred and has room now that other lists have gone.
  absl::Status SortDeferred();
  // The lines of deferred batches of layers for which seen(slot) is true.
  using Seen = std::function<bool(uint32_t)>;
  uint64_t CountDeferred(const Seen& seen) const;
  // Gives such batches lists, until EndPass, of what lies in the blocks that `within` draws. False,
  // and none has, if there is no room for all of them; but if `some`, those have that have room.
  absl::StatusOr<bool> SortWithin(const RegionGrid& within, const Seen& seen, bool some);
  void EndPass();

 private:
  uint64_t MostRegions() const override;
  absl::Status Make(const TableEntry* table, const ItemList& list, const Batch& batch) override;
  absl::Status Copy(const ItemList& list, uint64_t first, uint32_t count, const Batch& from,
                    const Batch& to) override;
  absl::Status Sort(Batch& batch, uint8_t* region_dirty) override;
  absl::Status MarkAll(const Batch& batch, uint8_t* region_dirty) override;
  absl::Status Touch(const ItemList& list, uint32_t count, const Batch& batch,
                     uint8_t* region_dirty) override;

  absl::Status SortInto(Batch& batch, Block& regions, LineSort& sort, bool counted,
                        uint32_t* needed);
  bool AreFew(const Batch& batch) const;
  absl::Status SortFew(Batch& batch, uint64_t most_spans, uint8_t* region_dirty);
  absl::Status SortAll(Batch& batch, uint8_t* region_dirty);
  absl::Status SortExactly(Batch& batch, Block& regions, LineSort& sort);
  absl::Status Defer(Batch& batch, uint8_t* region_dirty);

  Pool& lists_;
  const uint64_t most_kept_;
  const uint32_t few_lines_;
  uint64_t used_ = 0;  // of lists_, when SortDeferred last looked
  // Of a line, on the average, as large batches had them; with some to spare.
  double pieces_a_line_ = 4, spans_a_line_ = 12, spans_a_piece_ = 4;
};

}  // namespace voxeld::gpu::cuda
