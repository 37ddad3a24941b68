// What finds implicit shapes' voxels on the device (kernels_implicit.cu). Each function queues its kernel in
// `stream`, for shapes in the table, 65,535 at most, and answers whether that could be done.
#pragma once

#include <cuda_runtime_api.h>

#include "gpu/cuda/covered_types.h"
#include "gpu/cuda/types.h"

namespace voxeld::gpu::cuda {

// Sets `reach`.
cudaError_t FindTiles(const TableEntry* table, const CoveredViews& views, cudaStream_t stream);
// Sets what `axis` points to. Every view has rows, here and below.
cudaError_t FindAlong(const TableEntry* table, const CoveredViews& views, cudaStream_t stream);
// Sets `rows`, from what the two before have set, of tiles that may have anything: what P says to be
// covered. Programs are interpreted.
cudaError_t FindCovered(const TableEntry* table, const CoveredViews& views, cudaStream_t stream);
// The same by a kernel that was compiled for a program that all of them have (compiled_formulas.h).
cudaError_t FindCoveredBy(cudaKernel_t kernel, const CoveredViews& views, cudaStream_t stream);
// Takes from `rows` what Φ and rings leave out.
cudaError_t BoundCovered(const TableEntry* table, const CoveredViews& views, cudaStream_t stream);

}  // namespace voxeld::gpu::cuda
