// The drawing of dirty regions (draw-inl.h). Each function queues its kernels in `stream` and
// returns whether that succeeded.
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <cstdint>

#include "gpu/cuda/draw_types.h"

namespace voxeld::gpu::cuda {

// Lists the dirty regions by group and marks them clean. `counters->dirty` and `taken` must be 0.
cudaError_t ListDirty(const VolumeView& volume, const RegionGrid& regions, const DrawGroups& groups,
                      cudaStream_t stream);

// Picks the regions in view.list that are in the blocks which `within` draws, into `list`.
// picked->count must be 0.
cudaError_t PickRegions(const DrawView& view, const RegionGrid& within, uint32_t* list,
                        PickedRegions* picked, cudaStream_t stream);

// Draw the listed regions. DrawOneLayer: only thin lines, points and small triangles, all with
// lists, in one visible layer that is shown without blending (OVER, opacity 255). DrawLines: only
// these kinds. DrawAll: anything.
cudaError_t DrawOneLayer(const DrawView& view, DrawTo to, uint32_t multiprocessors,
                         cudaStream_t stream);
cudaError_t DrawLines(const DrawView& view, DrawTo to, uint32_t multiprocessors,
                      cudaStream_t stream);
cudaError_t DrawAll(const DrawView& view, DrawTo to, uint32_t multiprocessors, cudaStream_t stream);

// Returns the greatest shared memory that drawing takes for a block of threads.
size_t DrawShared();

// Copies voxels of the tiles' colours, x fastest, 0x00RRGGBB.
cudaError_t ReadBox(const VolumeView& volume, const int32_t lo[3], const int32_t size[3],
                    uint32_t* out, cudaStream_t stream);

}  // namespace voxeld::gpu::cuda
