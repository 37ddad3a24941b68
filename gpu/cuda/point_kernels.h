// Points without thickness on the device: made, and sorted by region, chunk by chunk in shared
// memory.
//
// Each function queues its kernels in `stream` and answers whether that could be done.
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <cstdint>

#include "gpu/cuda/point_types.h"

namespace voxeld::gpu::cuda {

// points[i]: item i of the list, of points; without a word where `grid` draws nothing.
cudaError_t MakePoints(const TableEntry* table, const ItemList& list, uint32_t items,
                       const RegionGrid& grid, PlacedPoint* points, cudaStream_t stream);

// to[first + i] = from[slot(d) + …] for i up to `count`, item first + i of the list being the …-th
// of its d-th row.
cudaError_t CopyPoints(const ItemList& list, uint64_t first, uint32_t count,
                       const PlacedPoint* from, PlacedPoint* to, cudaStream_t stream);

// Shared memory that sorting takes of a block of threads; less than 8 KB lie beside it.
size_t SortPointsShared(uint32_t regions, uint32_t each);
// Adds to *found how many of the points lie where `within` draws.
cudaError_t CountPoints(const PlacedPoint* points, uint32_t count, const RegionGrid& within,
                        uint32_t* found, cudaStream_t stream);
cudaError_t SortPoints(const PointSort& sort, const PlacedPoint* points, uint32_t count,
                       uint32_t multiprocessors, cudaStream_t stream);

// Of kMostFewPoints at most: made as MakePoints does, after the entries have been put into the
// table, and sorted, of which `sort` says where that goes (`each` 1).
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

// Adds to `regions`, by block, those that any of `count` points lies in.
cudaError_t FindPointRegions(const PlacedPoint* points, uint32_t count, uint64_t* regions,
                             cudaStream_t stream);
// Of points in rows, `count` in all; the first of the d-th is slot(d). Marks the regions that they
// lie in.
cudaError_t MarkPoints(const ItemList& list, uint32_t count, const PlacedPoint* points,
                       uint8_t* dirty, cudaStream_t stream);
// Of such, too: they have no word from now on, and their chunks, of `chunk` points, are touched;
// that is null if there are no lists.
cudaError_t KillPoints(const ItemList& list, uint32_t count, PlacedPoint* points, uint32_t chunk,
                       uint32_t* touched, cudaStream_t stream);

}  // namespace voxeld::gpu::cuda
