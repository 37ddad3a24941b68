#include "gpu/cuda/line_index.h"

#include <algorithm>
#include <utility>

#include "gpu/cuda/line_kernels.h"

namespace voxeld::gpu::cuda {
namespace {

// Up to this size the most that a batch may need is allocated, without waiting for the exact count.
constexpr uint64_t kUncountedBytes = uint64_t{16} << 20;
constexpr uint64_t kMostPlaces = 0xFFFFFFFFu;
constexpr double kSpare = 1.1;

// Returns the words at the lines' ends, if they may differ from those at their beginnings.
uint32_t* Ends(const auto& batch) {
  return batch.mixed ? batch.colors.template as<uint32_t>() : nullptr;
}

LineArrays Arrays(const auto& batch) {
  return LineArrays::Of(batch.items.template as<void>(), batch.count);
}

// Returns the greatest number of boxes that a line touches in a volume with `count` boxes along the
// axes.
uint64_t MostBoxes(const int32_t count[3], int shift) {
  uint64_t most = 1;
  for (int a = 0; a < 3; ++a) most += (static_cast<uint64_t>(count[a]) << shift) - 1;
  return most;
}

}  // namespace

bool LineIndex::Suits(const Api& api, const TileGrid& grid) {
  return SortLinesShared(RegionGrid::Of(grid)) <= api.device().sharedMemPerBlockOptin;
}

uint64_t LineIndex::MostRegions() const { return MostBoxes(grid().blocks, kBlockBits); }

LineBatchList LineIndex::view() const {
  LineBatchList list;  // Merge ensures that they fit
  for (const auto& [number, batch] : batches()) {
    LineBatchView& view = list.batches[list.count++];
    view.lines = Arrays(batch).lines;
    view.tracks = Arrays(batch).tracks;
    view.ends = Ends(batch);
    view.layer = batch.layer;
    view.count = batch.count;
    view.lists = {batch.begin.as<uint32_t>(), batch.base.as<uint32_t>(),
                  batch.offsets.as<uint16_t>(), batch.regions.as<uint64_t>(),
                  batch.spans.as<LineSpan>()};
  }
  return list;
}

// ------------------------------------------------------------------------------------------ sorting

// Sorts with memory for as many pieces and spans as `sort` says. needed[2]: how many there were;
// only set if `counted`, which waits for the device. Errors: ResourceExhausted if the lists' pool
// has too little memory.
absl::Status LineIndex::SortInto(Batch& batch, Block& regions, LineSort& sort, bool counted,
                                 uint32_t* needed) {
  const size_t blocks = grid().block_count();
  const size_t line_chunks = (size_t{batch.count} + kLineChunk - 1) / kLineChunk;
  const size_t chunks = sort.piece_capacity / kPieceChunk + blocks;
  // Memory for the sorting alone.
  Block block_begin, line_offsets, pieces;
  struct Wanted {
    Block* block;
    size_t bytes;
    bool kept;
  };
  const Wanted wanted[] = {
      {&block_begin, (blocks + 1) * sizeof(uint32_t), false},
      {&line_offsets, line_chunks * blocks * sizeof(uint32_t), false},
      {&pieces, sort.piece_capacity * sizeof(LinePiece), false},
      {&batch.begin, (blocks + 1) * sizeof(uint32_t), true},
      {&batch.base, chunks * sizeof(uint32_t), true},
      {&batch.offsets, chunks * (kRegionsInBlock + 1) * sizeof(uint16_t), true},
      {&batch.spans, sort.span_capacity * sizeof(LineSpan), true},
  };
  batch.list_bytes = batch.sort_bytes = 0;
  for (const Wanted& want : wanted) {
    *want.block = Block();  // from an earlier try
    batch.sort_bytes += want.bytes;
    if (want.kept) batch.list_bytes += want.bytes;
  }
  // The counters follow it in one block, so that a single block is set to 0. It is small for any
  // lines and is allocated outside the budget.
  regions = Block();
  absl::StatusOr<Block> zeros =
      device().Zeros(blocks * (sizeof(uint64_t) + sizeof(uint32_t)) + sizeof(uint32_t));
  if (!zeros.ok()) return zeros.status();
  regions = *std::move(zeros);
  for (const Wanted& want : wanted) {
    absl::StatusOr<Block> block = lists().Acquire(std::max<size_t>(1, want.bytes));
    if (!block.ok()) return block.status();
    *want.block = *std::move(block);
  }
  sort.block_begin = block_begin.as<uint32_t>();
  sort.line_offsets = line_offsets.as<uint32_t>();
  sort.pieces = pieces.as<LinePiece>();
  sort.chunk_begin = batch.begin.as<uint32_t>();
  sort.base = batch.base.as<uint32_t>();
  sort.offsets = batch.offsets.as<uint16_t>();
  sort.regions = regions.as<uint64_t>();
  sort.block_counts = reinterpret_cast<uint32_t*>(sort.regions + blocks);
  sort.span_count = sort.block_counts + blocks;
  sort.spans = batch.spans.as<LineSpan>();
  const ThinLine* const lines = Arrays(batch).lines;
  const uint32_t* const ends = Ends(batch);
  const size_t most_blocks = static_cast<size_t>(device().api().device().multiProcessorCount) * 4;
  const uint32_t launch = static_cast<uint32_t>(std::min(chunks, most_blocks));
  absl::Status status = device().Run(
      "CountPieces", [&] { return CountPieces(sort, lines, batch.count, device().stream()); });
  if (!status.ok()) return status;
  status = device().Run("FillPieces",
                        [&] { return FillPieces(sort, lines, batch.count, device().stream()); });
  if (!status.ok()) return status;
  status = device().Run("SortSpans",
                        [&] { return SortSpans(sort, lines, ends, launch, device().stream()); });
  if (!status.ok() || !counted) return status;
  status = device().ToHost(&needed[0], sort.block_begin + blocks, sizeof(uint32_t));
  if (status.ok()) status = device().ToHost(&needed[1], sort.span_count, sizeof(uint32_t));
  return status.ok() ? device().Wait() : status;
}

bool LineIndex::AreFew(const Batch& batch) const {
  constexpr size_t kScan = 4096;
  return batch.count <= std::min(few_lines_, kMostFewLines) &&
         SortFewLinesShared(grid()) + kScan <= device().api().device().sharedMemPerBlockOptin;
}

uint64_t LineIndex::MostSpans(const Batch& batch) const {
  return uint64_t{batch.count} * MostBoxes(grid().blocks, kBlockBits);
}

absl::Status LineIndex::SortFew(Batch& batch, FewLines& few, uint8_t* region_dirty) {
  const size_t blocks = grid().block_count();
  const uint64_t most_spans = MostSpans(batch);
  const std::pair<Block*, size_t> wanted[] = {
      {&batch.begin, (blocks + 1) * sizeof(uint32_t)},
      {&batch.base, blocks * sizeof(uint32_t)},
      {&batch.offsets, blocks * (kRegionsInBlock + 1) * sizeof(uint16_t)},
      {&batch.spans, most_spans * sizeof(LineSpan)}};
  batch.list_bytes = 0;
  for (const auto& [block, bytes] : wanted) {
    absl::StatusOr<Block> taken = lists().Acquire(bytes);
    if (!taken.ok()) return taken.status();
    *block = *std::move(taken);
    batch.list_bytes += bytes;
  }
  batch.sort_bytes = batch.list_bytes;
  absl::StatusOr<Block> regions = device().pool().Acquire(blocks * sizeof(uint64_t));
  if (!regions.ok()) return regions.status();
  batch.regions = *std::move(regions);
  few.sort.grid = grid();
  few.sort.span_capacity = static_cast<uint32_t>(most_spans);
  few.sort.chunk_begin = batch.begin.as<uint32_t>();
  few.sort.base = batch.base.as<uint32_t>();
  few.sort.offsets = batch.offsets.as<uint16_t>();
  few.sort.regions = batch.regions.as<uint64_t>();
  few.sort.spans = batch.spans.as<LineSpan>();
  few.sort.dirty = region_dirty;
  few.lines = Arrays(batch);
  few.ends = Ends(batch);
  few.count = batch.count;
  return device().Run("SortFewLines", [&] { return SortFewLines(few, device().stream()); });
}

absl::StatusOr<bool> LineIndex::MakeFew(TableEntry* table, const Arrivals& arrivals, Batch& batch,
                                        uint8_t* region_dirty) {
  if (!AreFew(batch)) return false;
  FewLines few;
  few.table = table;
  few.list = arrivals.list;
  if (arrivals.entries != nullptr) {
    few.entries = *arrivals.entries;
    few.entry_count = static_cast<uint32_t>(arrivals.slots.size());
  }
  const absl::Status status = SortFew(batch, few, region_dirty);
  if (absl::IsResourceExhausted(status)) return false;
  if (!status.ok()) return status;
  return true;
}

absl::Status LineIndex::SortAll(Batch& batch, uint8_t* region_dirty) {
  const uint64_t most_pieces = uint64_t{batch.count} * MostBoxes(grid().blocks, 0);
  const uint64_t most_spans = MostSpans(batch);
  LineSort sort;
  sort.grid = grid();
  sort.dirty = region_dirty;
  uint32_t needed[2] = {};
  if (AreFew(batch)) {
    FewLines few;
    return SortFew(batch, few, region_dirty);
  }
  if (most_spans * sizeof(LineSpan) <= kUncountedBytes) {
    sort.piece_capacity = static_cast<uint32_t>(most_pieces);
    sort.span_capacity = static_cast<uint32_t>(most_spans);
    return SortInto(batch, batch.regions, sort, false, needed);
  }
  const auto guess = [&](double a_line, uint64_t most) {
    return static_cast<uint32_t>(
        std::min({kMostPlaces, most, static_cast<uint64_t>(a_line * batch.count)}));
  };
  sort.piece_capacity = guess(pieces_a_line_, most_pieces);
  sort.span_capacity = guess(spans_a_line_, most_spans);
  for (;;) {
    if (absl::Status status = SortInto(batch, batch.regions, sort, true, needed); !status.ok()) {
      return status;
    }
    pieces_a_line_ = std::max(1.0, kSpare * needed[0] / batch.count);
    if (needed[0] > sort.piece_capacity) {
      // The spans of that many pieces are not known yet.
      sort.piece_capacity = needed[0];
      continue;
    }
    spans_a_line_ = std::max(1.0, kSpare * needed[1] / batch.count);
    if (needed[0] > 0) spans_a_piece_ = std::max(1.0, kSpare * needed[1] / needed[0]);
    if (needed[1] <= sort.span_capacity) return absl::OkStatus();
    sort.span_capacity = needed[1];
  }
}

// Counts the pieces first.
absl::Status LineIndex::SortExactly(Batch& batch, Block& regions, const RegionGrid& within,
                                    uint8_t* region_dirty) {
  LineSort sort;
  sort.grid = within;
  sort.dirty = region_dirty;
  uint32_t needed[2] = {};
  absl::Status status = SortInto(batch, regions, sort, true, needed);
  if (!status.ok() || needed[0] == 0) return status;
  sort.piece_capacity = needed[0];
  sort.span_capacity = static_cast<uint32_t>(
      std::min<double>(kMostPlaces, spans_a_piece_ * static_cast<double>(needed[0])));
  status = SortInto(batch, regions, sort, true, needed);
  if (absl::IsResourceExhausted(status)) {
    sort.span_capacity = 0;
    status = SortInto(batch, regions, sort, true, needed);
  }
  if (!status.ok() || needed[1] <= sort.span_capacity) return status;
  sort.span_capacity = needed[1];
  return SortInto(batch, regions, sort, true, needed);
}

// ------------------------------------------------------------------------------------------ items

absl::Status LineIndex::Make(const TableEntry* table, const ItemList& list, const Batch& batch) {
  return device().Run("MakeLines", [&] {
    return MakeLines(table, list, batch.count, Arrays(batch), Ends(batch), device().stream());
  });
}

absl::Status LineIndex::Copy(const ItemList& list, uint64_t first, uint32_t count,
                             const Batch& from, const Batch& to) {
  return device().Run("CopyLines", [&] {
    return CopyLines(list, first, count, Arrays(from), Ends(from), Arrays(to), Ends(to),
                     device().stream());
  });
}

absl::Status LineIndex::FindRegions(const Batch& batch, uint64_t* regions) {
  return device().Run("FindRegions", [&] {
    return cuda::FindRegions(Arrays(batch).lines, batch.count, grid(), regions, device().stream());
  });
}

absl::Status LineIndex::MarkAll(const Batch& batch, uint8_t* region_dirty) {
  return device().Run("MarkRegions", [&] {
    return MarkRegions(batch.regions.as<uint64_t>(), grid().block_count(), region_dirty,
                       device().stream());
  });
}

absl::Status LineIndex::Touch(const ItemList& list, uint32_t count, const Batch& batch,
                              uint8_t* region_dirty) {
  const LineArrays lines = Arrays(batch);
  return device().Run(region_dirty != nullptr ? "MarkLines" : "KillLines", [&] {
    return region_dirty != nullptr
               ? MarkLines(list, count, lines.lines, grid(), region_dirty, device().stream())
               : KillLines(list, count, lines, device().stream());
  });
}

}  // namespace voxeld::gpu::cuda
