// Small triangles on the device: made, and sorted by the regions that they touch.
//
// Each function queues its kernels in `stream` and answers whether that could be done.
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

#include "gpu/cuda/triangle_types.h"

namespace voxeld::gpu::cuda {

// extents[3]: by axis, how far two corners of a triangle are apart at most, as the bits of a float;
// they begin as 0. Corners are what `indices` names; null: the positions as they stand.
cudaError_t FindExtents(const float* positions, const uint32_t* indices, uint32_t triangles,
                        uint32_t* extents, cudaStream_t stream);

// triangles[i], and its three colours: item i of the list, of triangles. `colors`: may be null.
cudaError_t MakeTriangles(const TableEntry* table, const ItemList& list, uint32_t items,
                          CompactTriangle* triangles, uint32_t* colors, cudaStream_t stream);

// to[first + i] = from[slot(d) + …] for i up to `count`, item first + i of the list being the …-th of
// its d-th row. `colors_to` may be null; where `colors_from` is, none of the triangles is mixed.
cudaError_t CopyTriangles(const ItemList& list, uint64_t first, uint32_t count,
                          const CompactTriangle* from, const uint32_t* colors_from,
                          CompactTriangle* to, uint32_t* colors_to, cudaStream_t stream);

// After it `begin` is there.
cudaError_t CountTriangles(const TriangleSort& sort, const CompactTriangle* triangles,
                           uint32_t count, cudaStream_t stream);
cudaError_t FillTriangles(const TriangleSort& sort, const CompactTriangle* triangles,
                          uint32_t count, cudaStream_t stream);

// Adds to `regions`, by block as SpanLists has them, those that any of `count` triangles touches.
cudaError_t FindTriangleRegions(const CompactTriangle* triangles, uint32_t count,
                                const RegionGrid& grid, uint64_t* regions, cudaStream_t stream);
// Marks the regions that have any.
cudaError_t MarkFilled(const uint32_t* begin, uint32_t regions, uint8_t* dirty,
                       cudaStream_t stream);
// Of triangles in rows, `count` in all; the first of the d-th is slot(d). Marks the regions that
// they touch.
cudaError_t MarkTriangles(const ItemList& list, uint32_t count, const CompactTriangle* triangles,
                          const RegionGrid& grid, uint8_t* dirty, cudaStream_t stream);
// Of such, too: they draw nothing from now on.
cudaError_t KillTriangles(const ItemList& list, uint32_t count, CompactTriangle* triangles,
                          cudaStream_t stream);

}  // namespace voxeld::gpu::cuda
