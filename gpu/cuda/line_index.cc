#include "gpu/cuda/line_index.h"

#include <algorithm>
#include <utility>

#include "gpu/cuda/line_kernels.h"

namespace voxeld::gpu::cuda {
namespace {

// Up to here what a batch may need at most is taken, and nobody waits for the count of what it does.
constexpr uint64_t kUncountedBytes = uint64_t{64} << 20;
constexpr uint32_t kLeastChunk = 256;  // lines
constexpr uint32_t kChunks = 1056;     // eight blocks of threads for each of a large device's
constexpr uint64_t kMostPlaces = 0xFFFFFFFFu;

absl::StatusOr<Block> Zeroed(Device& device, size_t bytes) {
  absl::StatusOr<Block> block = device.pool().Acquire(bytes);
  if (!block.ok()) return block;
  if (absl::Status status = device.Zero(block->as<void>(), bytes); !status.ok()) return status;
  return block;
}

// Boxes that a line touches at most, of a volume of so many along the axes.
uint64_t MostBoxes(const int32_t count[3], int shift) {
  uint64_t most = 1;
  for (int a = 0; a < 3; ++a) most += (static_cast<uint64_t>(count[a]) << shift) - 1;
  return most;
}

}  // namespace

bool LineIndex::Suits(const TileGrid& grid) {
  const RegionGrid regions = RegionGrid::Of(grid);
  uint64_t blocks = 1;
  for (int a = 0; a < 3; ++a) blocks *= static_cast<uint64_t>(regions.blocks[a]);
  return blocks * sizeof(uint32_t) <= kMostSortLinesShared;
}

void LineIndex::Reset(const TileGrid& grid) {
  batches_.clear();
  places_.clear();
  grid_ = RegionGrid::Of(grid);
}

absl::flat_hash_set<uint32_t> LineIndex::Layers() const {
  absl::flat_hash_set<uint32_t> layers;
  for (const auto& [number, batch] : batches_) layers.insert(batch.layer);
  return layers;
}

LineBatchList LineIndex::view() const {
  LineBatchList list;
  for (const auto& [number, batch] : batches_) {
    list.batches[list.count++] = {batch.lines.as<ThinLine>(),
                                  batch.mixed ? batch.ends.as<uint32_t>() : nullptr,
                                  batch.count,
                                  batch.layer,
                                  batch.rows.as<uint32_t>(),
                                  batch.spans.as<LineSpan>()};
  }
  return list;
}

// ------------------------------------------------------------------------------------------ sorting

absl::Status LineIndex::Sort(Batch& batch) {
  const uint32_t blocks = grid_.block_count(), regions = grid_.count();
  LineSort sort;
  sort.grid = grid_;
  sort.chunk = std::max(kLeastChunk, (batch.count + kChunks - 1) / kChunks);
  const uint32_t line_chunks = (batch.count + sort.chunk - 1) / sort.chunk;
  struct Wanted {
    uint32_t** at;
    uint64_t count;
    bool zero;
    Block block;
  };
  const uint64_t most_pieces =
      std::min(kMostPlaces, uint64_t{batch.count} * MostBoxes(grid_.blocks, 0));
  const uint64_t most_spans =
      std::min(kMostPlaces, uint64_t{batch.count} * MostBoxes(grid_.blocks, kBlockBits));
  Wanted wanted[] = {
      {&sort.block_counts, blocks, true, {}},
      {&sort.block_begin, uint64_t{blocks} + 1, false, {}},
      {&sort.chunk_begin, uint64_t{blocks} + 1, false, {}},
      {&sort.line_offsets, uint64_t{line_chunks} * blocks, false, {}},
      {&sort.region_counts, uint64_t{regions} + 1, true, {}},
  };
  for (Wanted& want : wanted) {
    const size_t bytes = want.count * sizeof(uint32_t);
    absl::StatusOr<Block> block =
        want.zero ? Zeroed(device_, bytes) : device_.pool().Acquire(bytes);
    if (!block.ok()) return block.status();
    want.block = *std::move(block);
    *want.at = want.block.as<uint32_t>();
  }
  const ThinLine* const lines = batch.lines.as<ThinLine>();
  const uint32_t* const ends = batch.mixed ? batch.ends.as<uint32_t>() : nullptr;
  absl::Status status = device_.Run(
      "CountPieces", [&] { return CountPieces(sort, lines, batch.count, device_.stream()); });
  if (!status.ok()) return status;
  const bool uncounted = most_spans * sizeof(LineSpan) <= kUncountedBytes;
  sort.piece_capacity = static_cast<uint32_t>(most_pieces);
  if (!uncounted) {
    const absl::StatusOr<uint32_t> pieces = device_.Read(sort.block_begin + blocks);
    if (!pieces.ok()) return pieces.status();
    sort.piece_capacity = *pieces;
  }
  absl::StatusOr<Block> pieces =
      device_.pool().Acquire(std::max<size_t>(1, sort.piece_capacity) * sizeof(LinePiece));
  if (!pieces.ok()) return pieces.status();
  sort.pieces = pieces->as<LinePiece>();
  const size_t piece_chunks = sort.piece_capacity / kPieceChunk + blocks;
  absl::StatusOr<Block> piece_offsets =
      device_.pool().Acquire(piece_chunks * kRegionsInBlock * sizeof(uint32_t));
  if (!piece_offsets.ok()) return piece_offsets.status();
  sort.piece_offsets = piece_offsets->as<uint32_t>();
  status = device_.Run("FillPieces",
                       [&] { return FillPieces(sort, lines, batch.count, device_.stream()); });
  if (!status.ok()) return status;
  const uint32_t multiprocessors =
      static_cast<uint32_t>(device_.api().device().multiProcessorCount);
  const uint32_t launch =
      static_cast<uint32_t>(std::min<uint64_t>(piece_chunks, uint64_t{multiprocessors} * 16));
  status =
      device_.Run("CountSpans", [&] { return CountSpans(sort, lines, launch, device_.stream()); });
  if (!status.ok()) return status;
  absl::StatusOr<Block> rows = device_.pool().Acquire((size_t{regions} + 1) * sizeof(uint32_t));
  if (!rows.ok()) return rows.status();
  size_t temp_bytes = 0;
  const auto sum = [&](void* temp) {
    return device_.Run("SumRows", [&] {
      return SumRows(temp, temp_bytes, sort, rows->as<uint32_t>(), device_.stream());
    });
  };
  if (status = sum(nullptr); !status.ok()) return status;
  const absl::StatusOr<Block> temp = device_.pool().Acquire(temp_bytes);
  if (!temp.ok()) return temp.status();
  if (status = sum(temp->as<void>()); !status.ok()) return status;
  sort.span_capacity = static_cast<uint32_t>(most_spans);
  if (!uncounted) {
    const absl::StatusOr<uint32_t> spans = device_.Read(rows->as<uint32_t>() + regions);
    if (!spans.ok()) return spans.status();
    sort.span_capacity = *spans;
  }
  absl::StatusOr<Block> spans =
      device_.pool().Acquire(std::max<size_t>(1, sort.span_capacity) * sizeof(LineSpan));
  if (!spans.ok()) return spans.status();
  status = device_.Run("FillSpans", [&] {
    return FillSpans(sort, lines, ends, rows->as<uint32_t>(), spans->as<LineSpan>(), launch,
                     device_.stream());
  });
  if (!status.ok()) return status;
  batch.rows = *std::move(rows);
  batch.spans = *std::move(spans);
  return absl::OkStatus();
}

// ------------------------------------------------------------------------------------------ changes

absl::Status LineIndex::Add(const TableEntry* table, const LineArrivals& arrivals,
                            uint8_t* region_dirty) {
  const uint64_t count = arrivals.first.back();
  if (count == 0) return absl::OkStatus();
  Batch batch;
  batch.layer = arrivals.layer;
  batch.count = batch.live = static_cast<uint32_t>(count);
  batch.mixed = arrivals.mixed;
  absl::StatusOr<Block> lines = device_.pool().Acquire(count * sizeof(ThinLine));
  if (!lines.ok()) return lines.status();
  batch.lines = *std::move(lines);
  if (batch.mixed) {
    absl::StatusOr<Block> ends = device_.pool().Acquire(count * sizeof(uint32_t));
    if (!ends.ok()) return ends.status();
    batch.ends = *std::move(ends);
  }
  absl::Status status = device_.Run("MakeLines", [&] {
    return MakeLines(table, arrivals.list, batch.count, batch.lines.as<ThinLine>(),
                     batch.mixed ? batch.ends.as<uint32_t>() : nullptr, device_.stream());
  });
  if (!status.ok()) return status;
  if (status = Sort(batch); !status.ok()) return status;
  if (arrivals.visible) {
    status = device_.Run("MarkRows", [&] {
      return MarkRows(batch.rows.as<uint32_t>(), grid_.count(), region_dirty, device_.stream());
    });
    if (!status.ok()) return status;
  }
  const uint64_t number = next_number_++;
  for (size_t i = 0; i < arrivals.slots.size(); ++i) {
    places_[arrivals.slots[i]] = {number, batch.members.size()};
    batch.members.push_back({arrivals.slots[i], static_cast<uint32_t>(arrivals.first[i]),
                             static_cast<uint32_t>(arrivals.first[i + 1] - arrivals.first[i]),
                             true});
  }
  batches_.emplace(number, std::move(batch));
  return absl::OkStatus();
}

absl::flat_hash_map<uint64_t, LineIndex::Lines> LineIndex::Find(
    std::span<const uint32_t> slots) const {
  absl::flat_hash_map<uint64_t, Lines> found;
  for (const uint32_t slot : slots) {
    const auto it = places_.find(slot);
    if (it == places_.end()) continue;
    const Member& member = batches_.at(it->second.batch).members[it->second.member];
    Lines& lines = found[it->second.batch];
    lines.count += member.count;
    if (member.count > 0) lines.members.push_back(member);
  }
  return found;
}

absl::Status LineIndex::Touch(const Batch& batch, Lines& lines, uint8_t* region_dirty) {
  if (lines.members.empty()) return absl::OkStatus();
  std::sort(lines.members.begin(), lines.members.end(),
            [](const Member& a, const Member& b) { return a.first < b.first; });
  std::vector<uint32_t> from;
  std::vector<uint64_t> first;
  uint64_t total = 0;
  uint32_t end = 0;
  for (const Member& member : lines.members) {
    if (from.empty() || member.first != end) {
      from.push_back(member.first);
      first.push_back(total);
    }
    end = member.first + member.count;
    total += member.count;
  }
  first.push_back(total);
  const absl::StatusOr<Block> starts = device_.Upload(from.data(), from.size());
  if (!starts.ok()) return starts.status();
  const absl::StatusOr<Block> sums = device_.Upload(first.data(), first.size());
  if (!sums.ok()) return sums.status();
  const ItemList list{starts->as<uint32_t>(), sums->as<uint64_t>(),
                      static_cast<uint32_t>(from.size())};
  const uint32_t count = static_cast<uint32_t>(total);
  return device_.Run(region_dirty != nullptr ? "MarkLines" : "KillLines", [&] {
    return region_dirty != nullptr
               ? MarkLines(list, count, batch.lines.as<ThinLine>(), grid_, region_dirty,
                           device_.stream())
               : KillLines(list, count, batch.lines.as<ThinLine>(), device_.stream());
  });
}

absl::Status LineIndex::Mark(std::span<const uint32_t> slots, uint8_t* region_dirty) {
  for (auto& [number, lines] : Find(slots)) {
    const Batch& batch = batches_.at(number);
    absl::Status status =
        lines.count < batch.live ? Touch(batch, lines, region_dirty) : device_.Run("MarkRows", [&] {
          return MarkRows(batch.rows.as<uint32_t>(), grid_.count(), region_dirty, device_.stream());
        });
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

absl::Status LineIndex::Drop(std::span<const uint32_t> slots) {
  auto found = Find(slots);
  for (auto& [number, lines] : found) {
    const Batch& batch = batches_.at(number);
    if (lines.count == batch.live) continue;
    if (absl::Status status = Touch(batch, lines, nullptr); !status.ok()) return status;
  }
  for (const auto& [number, lines] : found) {
    Batch& batch = batches_.at(number);
    batch.live -= static_cast<uint32_t>(lines.count);
  }
  for (const uint32_t slot : slots) {
    const auto it = places_.find(slot);
    if (it == places_.end()) continue;
    batches_.at(it->second.batch).members[it->second.member].live = false;
    places_.erase(it);
  }
  absl::erase_if(batches_, [](const auto& entry) { return entry.second.live == 0; });
  return absl::OkStatus();
}

// ------------------------------------------------------------------------------------------ merging

absl::Status LineIndex::MergeFrom(const std::vector<uint64_t>& numbers) {
  Batch merged;
  merged.layer = batches_.at(numbers.front()).layer;
  struct Range {
    const Batch* batch;
    std::vector<uint32_t> from;
    std::vector<uint64_t> first;  // in the merged one; the end last
  };
  std::vector<Range> ranges;
  for (const uint64_t number : numbers) {
    const Batch& batch = batches_.at(number);
    merged.mixed |= batch.mixed;
    Range range{&batch, {}, {merged.count}};
    uint32_t end = 0;  // of the last range, in the old batch
    for (const Member& member : batch.members) {
      if (!member.live || member.count == 0) continue;
      merged.members.push_back({member.slot, merged.count, member.count, true});
      if (range.from.empty() || member.first != end) {
        if (!range.from.empty()) range.first.push_back(merged.count);
        range.from.push_back(member.first);
      }
      end = member.first + member.count;
      merged.count += member.count;
    }
    range.first.push_back(merged.count);
    ranges.push_back(std::move(range));
  }
  merged.live = merged.count;
  absl::StatusOr<Block> lines =
      device_.pool().Acquire(std::max<size_t>(1, merged.count) * sizeof(ThinLine));
  if (!lines.ok()) return lines.status();
  merged.lines = *std::move(lines);
  if (merged.mixed) {
    absl::StatusOr<Block> ends =
        device_.pool().Acquire(std::max<size_t>(1, merged.count) * sizeof(uint32_t));
    if (!ends.ok()) return ends.status();
    merged.ends = *std::move(ends);
  }
  for (const Range& range : ranges) {
    const uint64_t total = range.first.back() - range.first.front();
    if (total == 0) continue;
    const absl::StatusOr<Block> from = device_.Upload(range.from.data(), range.from.size());
    if (!from.ok()) return from.status();
    const absl::StatusOr<Block> first = device_.Upload(range.first.data(), range.first.size());
    if (!first.ok()) return first.status();
    const ItemList list{from->as<uint32_t>(), first->as<uint64_t>(),
                        static_cast<uint32_t>(range.from.size())};
    absl::Status status = device_.Run("CopyLines", [&] {
      return CopyLines(list, range.first.front(), static_cast<uint32_t>(total),
                       range.batch->lines.as<ThinLine>(),
                       range.batch->mixed ? range.batch->ends.as<uint32_t>() : nullptr,
                       merged.lines.as<ThinLine>(),
                       merged.mixed ? merged.ends.as<uint32_t>() : nullptr, device_.stream());
    });
    if (!status.ok()) return status;
  }
  if (absl::Status status = Sort(merged); !status.ok()) return status;
  const uint64_t number = next_number_++;
  for (size_t m = 0; m < merged.members.size(); ++m) {
    places_[merged.members[m].slot] = {number, m};
  }
  // Drawables without lines stay in no batch.
  for (const uint64_t old : numbers) {
    for (const Member& member : batches_.at(old).members) {
      if (member.live && member.count == 0) places_.erase(member.slot);
    }
    batches_.erase(old);
  }
  batches_.emplace(number, std::move(merged));
  return absl::OkStatus();
}

absl::Status LineIndex::Merge() {
  for (;;) {
    std::vector<std::pair<uint32_t, uint64_t>> order;  // lines, batch
    for (const auto& [number, batch] : batches_) order.push_back({batch.count, number});
    std::sort(order.begin(), order.end());
    std::vector<uint64_t> chosen;
    const bool crowded = order.size() > kMaxLineBatches;
    for (size_t i = 0; i < order.size() && chosen.empty(); ++i) {
      const Batch& batch = batches_.at(order[i].second);
      if (batch.live < batch.count / 2) chosen = {order[i].second};
      for (size_t j = i + 1; j < order.size() && chosen.empty(); ++j) {
        const Batch& other = batches_.at(order[j].second);
        if (other.layer != batch.layer) continue;
        if (crowded || other.count / 2 <= batch.count) {
          chosen = {order[i].second, order[j].second};
        }
      }
    }
    if (chosen.empty()) return absl::OkStatus();
    const absl::Status status = MergeFrom(chosen);
    if (absl::IsResourceExhausted(status) && order.size() <= kMaxLineBatches) {
      return absl::OkStatus();  // later, then
    }
    if (!status.ok()) return status;
  }
}

}  // namespace voxeld::gpu::cuda
