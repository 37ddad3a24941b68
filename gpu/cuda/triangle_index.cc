#include "gpu/cuda/triangle_index.h"

#include <algorithm>
#include <utility>

#include "gpu/cuda/line_kernels.h"
#include "gpu/cuda/triangle_kernels.h"

namespace voxeld::gpu::cuda {
namespace {

// Up to this size the most that a batch may need is allocated, without waiting for the exact count.
constexpr uint64_t kUncountedBytes = uint64_t{32} << 20;

uint32_t* Colors(const auto& batch) {
  return batch.mixed ? batch.colors.template as<uint32_t>() : nullptr;
}

}  // namespace

TriangleBatchList TriangleIndex::view() const {
  TriangleBatchList list;
  for (const auto& [number, batch] : batches()) {
    TriangleBatchView& view = list.batches[list.count++];
    view = {batch.items.as<CompactTriangle>(), Colors(batch), batch.begin.as<uint32_t>(),
            batch.spans.as<uint32_t>(),        batch.layer,   batch.count};
    if (view.begin == nullptr) view.places = batch.regions.as<uint32_t>();
  }
  return list;
}

uint64_t TriangleIndex::MostRegions() const {
  constexpr int32_t kMost = CompactTriangle::kMostExtent / kUnitsPerVoxel + 3;
  constexpr int32_t kVoxels[3] = {kMost, kMost, kMost};
  return std::min(RegionsOfExtent(kVoxels), grid().count());
}

absl::Status TriangleIndex::Make(const TableEntry* table, const ItemList& list,
                                 const Batch& batch) {
  return device().Run("MakeTriangles", [&] {
    return MakeTriangles(table, list, batch.count, batch.items.as<CompactTriangle>(), Colors(batch),
                         device().stream());
  });
}

absl::Status TriangleIndex::Copy(const ItemList& list, uint64_t first, uint32_t count,
                                 const Batch& from, const Batch& to) {
  return device().Run("CopyTriangles", [&] {
    return CopyTriangles(list, first, count, from.items.as<CompactTriangle>(), Colors(from),
                         to.items.as<CompactTriangle>(), Colors(to), device().stream());
  });
}

absl::Status TriangleIndex::SortInto(Batch& batch, const RegionGrid& within, uint8_t* region_dirty,
                                     bool counted) {
  const size_t regions = grid().count();
  const CompactTriangle* const triangles = batch.items.as<CompactTriangle>();
  for (Block* block : {&batch.begin, &batch.spans}) *block = Block();  // from an earlier try
  batch.list_bytes = (regions + 1) * sizeof(uint32_t);
  batch.sort_bytes = batch.list_bytes + regions * sizeof(uint32_t);
  const absl::StatusOr<Block> counts = lists().Acquire(regions * sizeof(uint32_t));
  if (!counts.ok()) return counts.status();
  absl::StatusOr<Block> begin = lists().Acquire((regions + 1) * sizeof(uint32_t));
  if (!begin.ok()) return begin.status();
  batch.begin = *std::move(begin);
  absl::Status status = device().Zero(counts->as<void>(), regions * sizeof(uint32_t));
  if (!status.ok()) return status;
  TriangleSort sort{within,      counts->as<uint32_t>(), batch.begin.as<uint32_t>(), nullptr, 0,
                    region_dirty};
  status = device().Run("CountTriangles", [&] {
    return CountTriangles(sort, triangles, batch.count, device().stream());
  });
  if (!status.ok()) return status;
  uint64_t places = MostPlaces(batch);
  if (counted) {
    const absl::StatusOr<uint32_t> there = device().Read(sort.begin + regions);
    if (!there.ok()) return there.status();
    places = *there;
  }
  batch.list_bytes += places * sizeof(uint32_t);
  batch.sort_bytes += places * sizeof(uint32_t);
  absl::StatusOr<Block> block = lists().Acquire(std::max<size_t>(1, places) * sizeof(uint32_t));
  if (!block.ok()) return block.status();
  batch.spans = *std::move(block);
  sort.places = batch.spans.as<uint32_t>();
  sort.capacity = static_cast<uint32_t>(places);
  return device().Run("FillTriangles", [&] {
    return FillTriangles(sort, triangles, batch.count, device().stream());
  });
}

uint64_t TriangleIndex::MostPlaces(const Batch& batch) const {
  return batch.count * std::min<uint64_t>(batch.regions_each, MostRegions());
}

absl::Status TriangleIndex::SortAll(Batch& batch, uint8_t* region_dirty) {
  return SortInto(batch, grid(), region_dirty,
                  MostPlaces(batch) * sizeof(uint32_t) > kUncountedBytes);
}

absl::Status TriangleIndex::SortExactly(Batch& batch, Block&, const RegionGrid& within,
                                        uint8_t* region_dirty) {
  return SortInto(batch, within, region_dirty, true);
}

absl::Status TriangleIndex::FindRegions(const Batch& batch, uint64_t* regions) {
  return device().Run("FindTriangleRegions", [&] {
    return FindTriangleRegions(batch.items.as<CompactTriangle>(), batch.count, grid(), regions,
                               device().stream());
  });
}

absl::Status TriangleIndex::MarkAll(const Batch& batch, uint8_t* region_dirty) {
  return device().Run("MarkFilled", [&] {
    return batch.deferred ? MarkRegions(batch.regions.as<uint64_t>(), grid().block_count(),
                                        region_dirty, device().stream())
                          : MarkFilled(batch.begin.as<uint32_t>(), grid().count(), region_dirty,
                                       device().stream());
  });
}

absl::Status TriangleIndex::Touch(const ItemList& list, uint32_t count, const Batch& batch,
                                  uint8_t* region_dirty) {
  CompactTriangle* const triangles = batch.items.as<CompactTriangle>();
  return device().Run(region_dirty != nullptr ? "MarkTriangles" : "KillTriangles", [&] {
    return region_dirty != nullptr
               ? MarkTriangles(list, count, triangles, grid(), region_dirty, device().stream())
               : KillTriangles(list, count, triangles, device().stream());
  });
}

}  // namespace voxeld::gpu::cuda
