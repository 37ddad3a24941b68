#include "gpu/cuda/point_index.h"

#include <algorithm>
#include <utility>

#include "gpu/cuda/line_kernels.h"

namespace voxeld::gpu::cuda {
namespace {

// The shared memory that is used in addition to the requested size.
constexpr size_t kSums = 8192;

bool Fits(const Api& api, const RegionGrid& regions, uint32_t each) {
  return SortPointsShared(regions.count(), each) + kSums <= api.device().sharedMemPerBlockOptin &&
         regions.count() <= 1u << (32 - PlacedPoint::kRegionShift);
}

PlacedPoint* Points(const auto& batch) { return batch.items.template as<PlacedPoint>(); }

}  // namespace

bool PointIndex::Suits(const Api& api, const TileGrid& grid) {
  return Fits(api, RegionGrid::Of(grid), 1);
}

uint32_t PointIndex::Each() const {
  for (const uint32_t each : {kMostPointsEach, 4u}) {
    if (each <= points_each_ && Fits(device().api(), grid(), each)) return each;
  }
  return 1;
}

uint32_t PointIndex::ChunksOf(const Batch& batch) const {
  const uint64_t chunk = uint64_t{kPointThreads} * Each();
  return static_cast<uint32_t>((batch.count + chunk - 1) / chunk);
}

PointBatchList PointIndex::view() const {
  PointBatchList list;  // Merge ensures that they fit
  for (const auto& [number, batch] : batches()) {
    list.batches[list.count++] = {Points(batch),
                                  batch.spans.as<PlacedPoint>(),
                                  batch.base.as<uint32_t>(),
                                  batch.offsets.as<uint16_t>(),
                                  batch.regions.as<uint64_t>(),
                                  batch.within,
                                  batch.layer,
                                  batch.count,
                                  ChunksOf(batch)};
  }
  return list;
}

// ----------------------------------------------------------------------------------------- sorting

absl::StatusOr<PointSort> PointIndex::TakeLists(Batch& batch, const RegionGrid& within,
                                                uint32_t records) {
  const size_t chunks = ChunksOf(batch);
  batch.within = within;
  for (int a = 0; a < 3; ++a) {  // an empty range must not give a negative number
    batch.within.drawn_hi[a] = std::max(within.drawn_lo[a], within.drawn_hi[a]);
  }
  const std::pair<Block*, size_t> wanted[] = {
      {&batch.begin, chunks * sizeof(uint32_t)},
      {&batch.base, chunks * sizeof(uint32_t)},
      {&batch.offsets, chunks * PointStride(batch.within.drawn_count()) * sizeof(uint16_t)},
      {&batch.spans, std::max<size_t>(1, records) * sizeof(PlacedPoint)}};
  batch.list_bytes = 0;
  for (const auto& [block, bytes] : wanted) {
    *block = Block();  // from an earlier try
    batch.list_bytes += bytes;
  }
  batch.sort_bytes = batch.list_bytes;
  for (const auto& [block, bytes] : wanted) {
    absl::StatusOr<Block> taken = lists().Acquire(bytes);
    if (!taken.ok()) return taken.status();
    *block = *std::move(taken);
  }
  PointSort sort;
  sort.within = batch.within;
  sort.each = Each();
  sort.capacity = records;
  sort.base = batch.base.as<uint32_t>();
  sort.offsets = batch.offsets.as<uint16_t>();
  sort.records = batch.spans.as<PlacedPoint>();
  sort.touched = batch.begin.as<uint32_t>();
  return sort;
}

absl::Status PointIndex::QueueSort(const PointSort& sort, const Batch& batch) {
  return device().Run("SortPoints", [&] {
    return SortPoints(sort, Points(batch), batch.count,
                      static_cast<uint32_t>(device().api().device().multiProcessorCount),
                      device().stream());
  });
}

absl::StatusOr<bool> PointIndex::MakeFew(TableEntry* table, const Arrivals& arrivals, Batch& batch,
                                         uint8_t* region_dirty) {
  if (batch.count > std::min(few_points_, kMostFewPoints)) return false;
  FewPoints few;
  absl::StatusOr<PointSort> sort = TakeLists(batch, grid(), batch.count);
  if (absl::IsResourceExhausted(sort.status())) return false;
  if (!sort.ok()) return sort.status();
  absl::StatusOr<Block> regions = device().Zeros(grid().block_count() * sizeof(uint64_t));
  if (!regions.ok()) return regions.status();
  batch.regions = *std::move(regions);
  few.sort = *sort;
  few.sort.each = 1;
  few.sort.regions = batch.regions.as<uint64_t>();
  few.sort.dirty = region_dirty;
  few.points = Points(batch);
  few.count = batch.count;
  few.table = table;
  few.list = arrivals.list;
  if (arrivals.entries != nullptr) {
    few.entries = *arrivals.entries;
    few.entry_count = static_cast<uint32_t>(arrivals.slots.size());
  }
  absl::Status status =
      device().Run("SortFewPoints", [&] { return SortFewPoints(few, device().stream()); });
  if (!status.ok()) return status;
  return true;
}

absl::Status PointIndex::SortAll(Batch& batch, uint8_t* region_dirty) {
  absl::StatusOr<PointSort> sort = TakeLists(batch, grid(), batch.count);
  if (!sort.ok()) return sort.status();
  absl::StatusOr<Block> regions = device().Zeros(grid().block_count() * sizeof(uint64_t));
  if (!regions.ok()) return regions.status();
  batch.regions = *std::move(regions);
  sort->regions = batch.regions.as<uint64_t>();
  sort->dirty = region_dirty;
  return QueueSort(*sort, batch);
}

// Counts them first.
absl::Status PointIndex::SortExactly(Batch& batch, Block& regions, const RegionGrid& within,
                                     uint8_t* region_dirty) {
  const size_t blocks = grid().block_count();
  // The counters follow it in one block.
  absl::StatusOr<Block> zeros = device().Zeros(blocks * sizeof(uint64_t) + 2 * sizeof(uint32_t));
  if (!zeros.ok()) return zeros.status();
  uint32_t* const counted = reinterpret_cast<uint32_t*>(zeros->as<uint64_t>() + blocks);
  absl::Status status = device().Run("CountPoints", [&] {
    return CountPoints(Points(batch), batch.count, within, counted, device().stream());
  });
  if (!status.ok()) return status;
  const absl::StatusOr<uint32_t> records = device().Read(counted);
  if (!records.ok()) return records.status();
  absl::StatusOr<PointSort> sort = TakeLists(batch, within, *records);
  if (!sort.ok()) return sort.status();
  regions = *std::move(zeros);
  sort->regions = regions.as<uint64_t>();
  sort->taken = counted + 1;
  sort->dirty = region_dirty;
  return QueueSort(*sort, batch);
}

// ------------------------------------------------------------------------------------------ items

absl::Status PointIndex::Make(const TableEntry* table, const ItemList& list, const Batch& batch) {
  return device().Run("MakePoints", [&] {
    return MakePoints(table, list, batch.count, grid(), Points(batch), device().stream());
  });
}

absl::Status PointIndex::Copy(const ItemList& list, uint64_t first, uint32_t count,
                              const Batch& from, const Batch& to) {
  return device().Run("CopyPoints", [&] {
    return CopyPoints(list, first, count, Points(from), Points(to), device().stream());
  });
}

absl::Status PointIndex::FindRegions(const Batch& batch, uint64_t* regions) {
  return device().Run("FindPointRegions", [&] {
    return FindPointRegions(Points(batch), batch.count, regions, device().stream());
  });
}

absl::Status PointIndex::MarkAll(const Batch& batch, uint8_t* region_dirty) {
  return device().Run("MarkRegions", [&] {
    return MarkRegions(batch.regions.as<uint64_t>(), grid().block_count(), region_dirty,
                       device().stream());
  });
}

// Records do not name their items: removed points are taken out by sorting their chunks again.
absl::Status PointIndex::Touch(const ItemList& list, uint32_t count, const Batch& batch,
                               uint8_t* region_dirty) {
  if (region_dirty != nullptr) {
    return device().Run("MarkPoints", [&] {
      return MarkPoints(list, count, Points(batch), region_dirty, device().stream());
    });
  }
  PointSort sort;
  sort.within = batch.within;
  sort.each = Each();
  sort.capacity = batch.count;
  sort.base = batch.base.as<uint32_t>();
  sort.offsets = batch.offsets.as<uint16_t>();
  sort.regions = batch.regions.as<uint64_t>();
  sort.records = batch.spans.as<PlacedPoint>();
  sort.touched = batch.begin.as<uint32_t>();
  sort.again = true;
  absl::Status status = device().Run("KillPoints", [&] {
    return KillPoints(list, count, Points(batch), kPointThreads * sort.each, sort.touched,
                      device().stream());
  });
  return status.ok() && sort.records != nullptr ? QueueSort(sort, batch) : status;
}

}  // namespace voxeld::gpu::cuda
