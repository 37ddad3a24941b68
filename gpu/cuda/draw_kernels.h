// The drawing of dirty regions (draw-inl.h). Each function queues its kernels in `stream` and
// answers whether that could be done.
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <cstdint>

#include "gpu/cuda/draw_types.h"

namespace voxeld::gpu::cuda {

// Lists the dirty regions by group, and they are clean. `counters->dirty` and `taken` must be 0.
cudaError_t ListDirty(const VolumeView& volume, const RegionGrid& regions, const DrawGroups& groups,
                      cudaStream_t stream);

// Of the regions in view.list, those in the blocks that `within` draws into `list`. picked->count
// must be 0.
cudaError_t PickRegions(const DrawView& view, const RegionGrid& within, uint32_t* list,
                        PickedRegions* picked, cudaStream_t stream);

// Draw the regions listed. Where there are thin lines, points and small triangles alone, with lists
// all, in one visible layer that is seen as it is (OVER, opacity 255); where there are these alone;
// whatever there is.
cudaError_t DrawOneLayer(const DrawView& view, DrawTo to, uint32_t multiprocessors,
                         cudaStream_t stream);
cudaError_t DrawLines(const DrawView& view, DrawTo to, uint32_t multiprocessors,
                      cudaStream_t stream);
cudaError_t DrawAll(const DrawView& view, DrawTo to, uint32_t multiprocessors, cudaStream_t stream);

// Shared memory that drawing takes of a block of threads, at most.
size_t DrawShared();

// Voxels of the tiles' colours, x fastest, 0x00RRGGBB.
cudaError_t ReadBox(const VolumeView& volume, const int32_t lo[3], const int32_t size[3],
                    uint32_t* out, cudaStream_t stream);

}  // namespace voxeld::gpu::cuda
