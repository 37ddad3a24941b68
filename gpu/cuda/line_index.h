// Thin lines by the regions that they touch: a few batches, each of one layer.
//
// A change adds a batch; batches of like size are merged, and lines that have gone are dropped on the
// way: so an index of n lines costs O(log n) a line.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "absl/container/flat_hash_set.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "gpu/cuda/device.h"
#include "gpu/cuda/line_types.h"

namespace voxeld::gpu::cuda {

// Drawables of one layer that come into the index together.
struct LineArrivals {
  uint32_t layer = 0;  // its slot
  bool visible = true;
  bool mixed = false;  // some line may have two colours
  ItemList list;       // on the device
  std::span<const uint32_t> slots;
  std::span<const uint64_t> first;  // as in the list
};

// Thread-bound; its calls queue work in the device's stream.
class LineIndex {
 public:
  explicit LineIndex(Device& device) : device_(device) {}

  // Forgets all, for a volume of that grid, of which the tiles are drawn that `owned` has (a TileOwner
  // each): of lines elsewhere nothing is kept but themselves.
  void Reset(const TileGrid& grid, std::span<const uint8_t> owned);
  // Whether a volume of that grid can have one, on such a device.
  static bool Suits(const Api& api, const TileGrid& grid);
  // The slots of layers that have lines here; no more than kMaxLineLayers may.
  absl::flat_hash_set<uint32_t> Layers() const;
  uint64_t live() const;  // lines
  // Lines that may come in one Add.
  uint64_t most_lines() const { return most_lines_; }

  // Adds them; marks regions if they are to be seen. ResourceExhausted, and nothing is added, if
  // memory does not suffice.
  absl::Status Add(const TableEntry* table, const LineArrivals& arrivals, uint8_t* region_dirty);

  // Marks the regions of drawables.
  absl::Status Mark(std::span<const uint32_t> slots, uint8_t* region_dirty);
  // Drops them. An error leaves all as it was.
  absl::Status Drop(std::span<const uint32_t> slots);

  // Merges batches of like size. Want of memory is no error, unless there are too many for view().
  absl::Status Merge();

  LineBatchList view() const;

 private:
  struct Member {
    uint32_t slot, first, count;  // lines, one at least
    bool live;
  };
  struct Batch {
    uint32_t layer = 0;
    uint32_t count = 0, live = 0;  // lines
    Block lines, ends;
    Block chunk_begin, base, offsets, regions, spans;  // SpanLists
    std::vector<Member> members;
    bool mixed = false;
  };
  struct Place {
    uint64_t batch;  // its number
    size_t member;
  };
  // Lines of a batch.
  struct Lines {
    uint64_t count = 0;
    std::vector<Member> members;
  };

  absl::flat_hash_map<uint64_t, Lines> Find(std::span<const uint32_t> slots) const;
  // Marks, or kills, some lines of a batch.
  absl::Status Touch(const Batch& batch, Lines& lines, uint8_t* region_dirty);
  absl::Status Sort(Batch& batch);
  absl::Status SortInto(Batch& batch, LineSort& sort, bool counted, uint32_t* needed);
  absl::Status MergeFrom(const std::vector<uint64_t>& numbers);

  Device& device_;
  RegionGrid grid_;
  // Of a line, on the average, as large batches had them; with some to spare.
  double pieces_a_line_ = 4, spans_a_line_ = 12;
  uint64_t next_number_ = 1, most_lines_ = 0;
  bool merge_ = false;  // something has changed since merging was last done or given up
  absl::flat_hash_map<uint64_t, Batch> batches_;  // by number
  absl::flat_hash_map<uint32_t, Place> places_;   // by slot of the table
};

}  // namespace voxeld::gpu::cuda
