// The kernels that find the voxels of implicit shapes (kernels_implicit.cu). Each function queues
// its kernel in `stream`, for at most 65,535 shapes in the table, and returns whether that
// succeeded.
#pragma once

#include <cuda_runtime_api.h>

#include "gpu/cuda/covered_types.h"
#include "gpu/cuda/types.h"

namespace voxeld::gpu::cuda {

// Sets `reach`.
cudaError_t FindTiles(const TableEntry* table, const CoveredViews& views, cudaStream_t stream);
// Sets the arrays of `axis`. Here and below, every view has rows.
cudaError_t FindAlong(const TableEntry* table, const CoveredViews& views, cudaStream_t stream);
// Sets `rows` of tiles that may have anything, from the results of the two functions above: the
// voxels that P selects. Programs are interpreted.
cudaError_t FindCovered(const TableEntry* table, const CoveredViews& views, cudaStream_t stream);
// The same, with a kernel that was compiled for the program that all of them share
// (compiled_formulas.h).
cudaError_t FindCoveredBy(cudaKernel_t kernel, const CoveredViews& views, cudaStream_t stream);
// Removes from `rows` the voxels that Φ and rings exclude.
cudaError_t BoundCovered(const TableEntry* table, const CoveredViews& views, cudaStream_t stream);

}  // namespace voxeld::gpu::cuda
