// Small triangles on the device: made, and sorted by the regions that they touch.
//
// Each function queues its kernels in `stream` and returns whether that succeeded.
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

#include "gpu/cuda/triangle_types.h"

namespace voxeld::gpu::cuda {

// Computes extents[3]: by axis, the greatest distance between two corners of a triangle, as the
// bits of a float; the initial values must be 0. `indices` names the corners; null: the positions
// in order.
cudaError_t FindExtents(const float* positions, const uint32_t* indices, uint32_t triangles,
                        uint32_t* extents, cudaStream_t stream);

// Makes triangles[i], and its three colours, from item i of the list, of triangles. `colors` may be
// null.
cudaError_t MakeTriangles(const TableEntry* table, const ItemList& list, uint32_t items,
                          CompactTriangle* triangles, uint32_t* colors, cudaStream_t stream);

// Copies `count` triangles: if item first + i of the list is the j-th of its d-th row, sets
// to[first + i] = from[slot(d) + j]. `colors_to` may be null; if `colors_from` is null, none of the
// triangles is mixed.
cudaError_t CopyTriangles(const ItemList& list, uint64_t first, uint32_t count,
                          const CompactTriangle* from, const uint32_t* colors_from,
                          CompactTriangle* to, uint32_t* colors_to, cudaStream_t stream);

// Sets `begin`.
cudaError_t CountTriangles(const TriangleSort& sort, const CompactTriangle* triangles,
                           uint32_t count, cudaStream_t stream);
cudaError_t FillTriangles(const TriangleSort& sort, const CompactTriangle* triangles,
                          uint32_t count, cudaStream_t stream);

// Adds to `regions`, by block as in SpanLists, those that any of `count` triangles touches.
cudaError_t FindTriangleRegions(const CompactTriangle* triangles, uint32_t count,
                                const RegionGrid& grid, uint64_t* regions, cudaStream_t stream);
// Marks the regions that have any.
cudaError_t MarkFilled(const uint32_t* begin, uint32_t regions, uint8_t* dirty,
                       cudaStream_t stream);
// For triangles in rows, `count` in all, where the first triangle of the d-th row is slot(d): marks
// the regions that they touch.
cudaError_t MarkTriangles(const ItemList& list, uint32_t count, const CompactTriangle* triangles,
                          const RegionGrid& grid, uint8_t* dirty, cudaStream_t stream);
// For triangles in rows: makes them draw nothing from now on.
cudaError_t KillTriangles(const ItemList& list, uint32_t count, CompactTriangle* triangles,
                          cudaStream_t stream);

}  // namespace voxeld::gpu::cuda
