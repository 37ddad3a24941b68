// Draws regions that have only thin lines, points and small triangles.
#include "gpu/cuda/draw-inl.h"
#include "gpu/cuda/draw_kernels.h"

namespace voxeld::gpu::cuda {

cudaError_t DrawOneLayer(const DrawView& view, DrawTo to, uint32_t multiprocessors,
                         cudaStream_t stream) {
  return DrawRegionsOf<DrawWhat::kOneLayer>(view, to, multiprocessors, stream);
}

cudaError_t DrawLines(const DrawView& view, DrawTo to, uint32_t multiprocessors,
                      cudaStream_t stream) {
  return DrawRegionsOf<DrawWhat::kLines>(view, to, multiprocessors, stream);
}

}  // namespace voxeld::gpu::cuda
