// Regions with anything in them, drawn straight into pictures.
#include "gpu/cuda/draw-inl.h"

namespace voxeld::gpu::cuda {

template cudaError_t DrawRegionsTo<DrawWhat::kAll, DrawTo::kPictures>(const DrawView&, uint32_t,
                                                                      cudaStream_t);

}  // namespace voxeld::gpu::cuda
