// Points without thickness on the device: made, and sorted by region, chunk by chunk in shared
// memory.
//
// Each function queues its kernels in `stream` and returns whether that succeeded.
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <cstdint>

#include "gpu/cuda/point_types.h"

namespace voxeld::gpu::cuda {

// Makes points[i] from item i of the list, of points; without a word if `grid` draws nothing there.
cudaError_t MakePoints(const TableEntry* table, const ItemList& list, uint32_t items,
                       const RegionGrid& grid, PlacedPoint* points, cudaStream_t stream);

// Copies `count` points: if item first + i of the list is the j-th of its d-th row, sets to[first +
// i] = from[slot(d) + j].
cudaError_t CopyPoints(const ItemList& list, uint64_t first, uint32_t count,
                       const PlacedPoint* from, PlacedPoint* to, cudaStream_t stream);

// Returns the shared memory that sorting takes for a block of threads; less than 8 KB are used in
// addition.
size_t SortPointsShared(uint32_t regions, uint32_t each);
// Adds to *found the number of points in regions that `within` draws.
cudaError_t CountPoints(const PlacedPoint* points, uint32_t count, const RegionGrid& within,
                        uint32_t* found, cudaStream_t stream);
cudaError_t SortPoints(const PointSort& sort, const PlacedPoint* points, uint32_t count,
                       uint32_t multiprocessors, cudaStream_t stream);

// For at most kMostFewPoints points: makes them, as by MakePoints, after putting the entries into
// the table, and sorts them to the places in `sort` (`each` is 1).
inline constexpr uint32_t kMostFewPoints = kPointThreads;
struct FewPoints {
  PointSort sort;
  PlacedPoint* points = nullptr;
  uint32_t count = 0, entry_count = 0;
  TableEntry* table = nullptr;
  ItemList list;
  FewEntries entries;
};
static_assert(sizeof(FewPoints) <= 4096, "arguments have 4 KB");
cudaError_t SortFewPoints(const FewPoints& few, cudaStream_t stream);

// Adds to `regions`, by block, those in which any of `count` points lies.
cudaError_t FindPointRegions(const PlacedPoint* points, uint32_t count, uint64_t* regions,
                             cudaStream_t stream);
// For points in rows, `count` in all, where the first point of the d-th row is slot(d): marks the
// regions in which they lie.
cudaError_t MarkPoints(const ItemList& list, uint32_t count, const PlacedPoint* points,
                       uint8_t* dirty, cudaStream_t stream);
// For points in rows: removes their words, and marks their chunks, of `chunk` points, as touched;
// `touched` is null without lists.
cudaError_t KillPoints(const ItemList& list, uint32_t count, PlacedPoint* points, uint32_t chunk,
                       uint32_t* touched, cudaStream_t stream);

}  // namespace voxeld::gpu::cuda
