#include "gpu/cuda/line_index.h"

#include <algorithm>
#include <utility>

#include "gpu/cuda/line_kernels.h"

namespace voxeld::gpu::cuda {
namespace {

// Up to here what a batch may need at most is taken, and nobody waits for the count of what it does.
constexpr uint64_t kUncountedBytes = uint64_t{16} << 20;
constexpr uint64_t kMostPlaces = 0xFFFFFFFFu;

// Boxes that a line touches at most, of a volume of so many along the axes.
uint64_t MostBoxes(const int32_t count[3], int shift) {
  uint64_t most = 1;
  for (int a = 0; a < 3; ++a) most += (static_cast<uint64_t>(count[a]) << shift) - 1;
  return most;
}

}  // namespace

bool LineIndex::Suits(const Api& api, const TileGrid& grid) {
  return SortLinesShared(RegionGrid::Of(grid)) <= api.device().sharedMemPerBlockOptin;
}

void LineIndex::Reset(const TileGrid& grid, std::span<const uint8_t> owned) {
  batches_.clear();
  places_.clear();
  grid_ = RegionGrid::Of(grid);
  int32_t lo[3] = {INT32_MAX, INT32_MAX, INT32_MAX}, hi[3] = {};
  for (uint32_t tile = 0; tile < grid.count(); ++tile) {
    if (owned[tile] == kNotOwned) continue;
    int32_t at[3];
    grid.Coordinates(tile, at);
    for (int a = 0; a < 3; ++a) {
      const int32_t block = at[a] * kTileSize >> (RegionBits(a) + kBlockBits);
      lo[a] = std::min(lo[a], block);
      hi[a] = std::max(hi[a], block + 1);
    }
  }
  std::copy(lo, lo + 3, grid_.drawn_lo);
  std::copy(hi, hi + 3, grid_.drawn_hi);
  merge_ = false;
  // So that whatever they are, their spans can be counted in 32 bits.
  most_lines_ = kMostPlaces / MostBoxes(grid_.blocks, kBlockBits);
}

absl::flat_hash_set<uint32_t> LineIndex::Layers() const {
  absl::flat_hash_set<uint32_t> layers;
  for (const auto& [number, batch] : batches_) layers.insert(batch.layer);
  return layers;
}

uint64_t LineIndex::live() const {
  uint64_t lines = 0;
  for (const auto& [number, batch] : batches_) lines += batch.live;
  return lines;
}

LineBatchList LineIndex::view() const {
  LineBatchList list;  // Merge sees to it that they fit
  for (const auto& [number, batch] : batches_) {
    LineBatchView& view = list.batches[list.count++];
    view.lines = batch.lines.as<ThinLine>();
    view.ends = batch.mixed ? batch.ends.as<uint32_t>() : nullptr;
    view.layer = batch.layer;
    view.lists = {batch.chunk_begin.as<uint32_t>(), batch.base.as<uint32_t>(),
                  batch.offsets.as<uint16_t>(), batch.regions.as<uint64_t>(),
                  batch.spans.as<LineSpan>()};
  }
  return list;
}

// ------------------------------------------------------------------------------------------ sorting

// With room for as many pieces and spans as `sort` says. needed[2]: how many there were; only if
// `counted`, which waits for it.
absl::Status LineIndex::SortInto(Batch& batch, LineSort& sort, bool counted, uint32_t* needed) {
  const size_t blocks = grid_.block_count();
  const size_t line_chunks = (size_t{batch.count} + kLineChunk - 1) / kLineChunk;
  const size_t chunks = sort.piece_capacity / kPieceChunk + blocks;
  sort.grid = grid_;
  // What the sorting alone needs.
  Block block_counts, block_begin, line_offsets, pieces, span_count;
  struct Wanted {
    Block* block;
    size_t bytes;
    bool zero;
  };
  for (const Wanted& want : {
           Wanted{&block_counts, blocks * sizeof(uint32_t), true},
           Wanted{&block_begin, (blocks + 1) * sizeof(uint32_t), false},
           Wanted{&line_offsets, line_chunks * blocks * sizeof(uint32_t), false},
           Wanted{&pieces, sort.piece_capacity * sizeof(LinePiece), false},
           Wanted{&span_count, sizeof(uint32_t), true},
           Wanted{&batch.chunk_begin, (blocks + 1) * sizeof(uint32_t), false},
           Wanted{&batch.base, chunks * sizeof(uint32_t), false},
           Wanted{&batch.offsets, chunks * (kRegionsInBlock + 1) * sizeof(uint16_t), false},
           Wanted{&batch.regions, blocks * sizeof(uint64_t), true},
           Wanted{&batch.spans, sort.span_capacity * sizeof(LineSpan), false},
       }) {
    *want.block = Block();  // of a try before
    absl::StatusOr<Block> block = want.zero
                                      ? device_.Zeros(want.bytes)
                                      : device_.pool().Acquire(std::max<size_t>(1, want.bytes));
    if (!block.ok()) return block.status();
    *want.block = *std::move(block);
  }
  sort.block_counts = block_counts.as<uint32_t>();
  sort.block_begin = block_begin.as<uint32_t>();
  sort.line_offsets = line_offsets.as<uint32_t>();
  sort.pieces = pieces.as<LinePiece>();
  sort.span_count = span_count.as<uint32_t>();
  sort.chunk_begin = batch.chunk_begin.as<uint32_t>();
  sort.base = batch.base.as<uint32_t>();
  sort.offsets = batch.offsets.as<uint16_t>();
  sort.regions = batch.regions.as<uint64_t>();
  sort.spans = batch.spans.as<LineSpan>();
  const ThinLine* const lines = batch.lines.as<ThinLine>();
  const uint32_t* const ends = batch.mixed ? batch.ends.as<uint32_t>() : nullptr;
  const size_t most_blocks = static_cast<size_t>(device_.api().device().multiProcessorCount) * 4;
  const uint32_t launch = static_cast<uint32_t>(std::min(chunks, most_blocks));
  absl::Status status = device_.Run(
      "CountPieces", [&] { return CountPieces(sort, lines, batch.count, device_.stream()); });
  if (!status.ok()) return status;
  status = device_.Run("FillPieces",
                       [&] { return FillPieces(sort, lines, batch.count, device_.stream()); });
  if (!status.ok()) return status;
  status = device_.Run("SortSpans",
                       [&] { return SortSpans(sort, lines, ends, launch, device_.stream()); });
  if (!status.ok() || !counted) return status;
  status = device_.ToHost(&needed[0], sort.block_begin + blocks, sizeof(uint32_t));
  if (status.ok()) status = device_.ToHost(&needed[1], sort.span_count, sizeof(uint32_t));
  return status.ok() ? device_.Wait() : status;
}

absl::Status LineIndex::Sort(Batch& batch) {
  const uint64_t most_pieces = uint64_t{batch.count} * MostBoxes(grid_.blocks, 0);
  const uint64_t most_spans = uint64_t{batch.count} * MostBoxes(grid_.blocks, kBlockBits);
  LineSort sort;
  uint32_t needed[2] = {};
  if (most_spans * sizeof(LineSpan) <= kUncountedBytes) {
    sort.piece_capacity = static_cast<uint32_t>(most_pieces);
    sort.span_capacity = static_cast<uint32_t>(most_spans);
    return SortInto(batch, sort, false, needed);
  }
  const auto guess = [&](double a_line, uint64_t most) {
    return static_cast<uint32_t>(
        std::min({kMostPlaces, most, static_cast<uint64_t>(a_line * batch.count)}));
  };
  sort.piece_capacity = guess(pieces_a_line_, most_pieces);
  sort.span_capacity = guess(spans_a_line_, most_spans);
  for (;;) {
    if (absl::Status status = SortInto(batch, sort, true, needed); !status.ok()) return status;
    constexpr double kSpare = 1.1;
    pieces_a_line_ = std::max(1.0, kSpare * needed[0] / batch.count);
    if (needed[0] > sort.piece_capacity) {
      // So many spans are not known yet.
      sort.piece_capacity = needed[0];
      continue;
    }
    spans_a_line_ = std::max(1.0, kSpare * needed[1] / batch.count);
    if (needed[1] <= sort.span_capacity) return absl::OkStatus();
    sort.span_capacity = needed[1];
  }
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
    status = device_.Run("MarkRegions", [&] {
      return MarkRegions(batch.regions.as<uint64_t>(), grid_.block_count(), region_dirty,
                         device_.stream());
    });
    if (!status.ok()) return status;
  }
  const uint64_t number = next_number_++;
  for (size_t i = 0; i < arrivals.slots.size(); ++i) {
    if (arrivals.first[i] == arrivals.first[i + 1]) continue;  // it has no lines
    places_[arrivals.slots[i]] = {number, batch.members.size()};
    batch.members.push_back({arrivals.slots[i], static_cast<uint32_t>(arrivals.first[i]),
                             static_cast<uint32_t>(arrivals.first[i + 1] - arrivals.first[i]),
                             true});
  }
  batches_.emplace(number, std::move(batch));
  merge_ = true;
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
    lines.members.push_back(member);
  }
  return found;
}

absl::Status LineIndex::Touch(const Batch& batch, Lines& lines, uint8_t* region_dirty) {
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
        lines.count < batch.live
            ? Touch(batch, lines, region_dirty)
            : device_.Run("MarkRegions", [&] {
                return MarkRegions(batch.regions.as<uint64_t>(), grid_.block_count(), region_dirty,
                                   device_.stream());
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
  merge_ |= !found.empty();
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
      if (!member.live) continue;
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
  for (const uint64_t old : numbers) batches_.erase(old);
  batches_.emplace(number, std::move(merged));
  return absl::OkStatus();
}

absl::Status LineIndex::Merge() {
  while (merge_) {
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
        if (uint64_t{other.count} + batch.count > most_lines_) continue;
        if (crowded || other.count / 2 <= batch.count) {
          chosen = {order[i].second, order[j].second};
        }
      }
    }
    merge_ = !chosen.empty();
    if (!merge_) break;
    const absl::Status status = MergeFrom(chosen);
    if (absl::IsResourceExhausted(status) && order.size() <= kMaxLineBatches) {
      merge_ = false;  // until something changes
      break;
    }
    if (!status.ok()) return status;
  }
  if (batches_.size() > kMaxLineBatches) {
    return absl::ResourceExhaustedError("the scene has too many lines to be drawn at once");
  }
  return absl::OkStatus();
}

}  // namespace voxeld::gpu::cuda
