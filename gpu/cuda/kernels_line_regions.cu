// Finds the regions that thin lines touch, from the lines or from their lists; and removes lines.
#include "gpu/cuda/line_kernels.h"
#include "gpu/cuda/lines-inl.h"

namespace voxeld::gpu::cuda {
namespace {

// Calls f(region) for each region that a line touches.
__device__ void ForRegions(const ThinLine& at, const RegionGrid& grid, auto&& f) {
  WalkRegions(grid, LoadLine(&at),
              [&](const int32_t[3], uint32_t region, int32_t, int32_t) { f(region); });
}

__global__ void MarkRegionsKernel(const uint64_t* regions, uint32_t blocks, uint8_t* dirty) {
  const uint64_t r = Thread();
  if (r >= static_cast<uint64_t>(blocks) * kRegionsInBlock) return;
  if (regions[r / kRegionsInBlock] >> r % kRegionsInBlock & 1) dirty[r] = 1;
}

__global__ void MarkLinesKernel(ItemList list, uint32_t count, const ThinLine* lines,
                                RegionGrid grid, uint8_t* dirty) {
  const uint64_t i = Thread();
  if (i >= count) return;
  ForRegions(lines[PlaceOf(list, i)], grid, [&](uint32_t region) { dirty[region] = 1; });
}

__global__ void FindRegionsKernel(const ThinLine* lines, uint32_t count, RegionGrid grid,
                                  uint64_t* regions) {
  const uint64_t i = Thread();
  if (i >= count) return;
  ForRegions(lines[i], grid, [&](uint32_t region) { SetRegion(regions, region); });
}

__global__ void KillLinesKernel(ItemList list, uint32_t count, LineArrays of) {
  const uint64_t i = Thread();
  if (i >= count) return;
  const uint64_t at = PlaceOf(list, i);
  of.lines[at].word = of.tracks[at].word = 0;
}

}  // namespace

cudaError_t MarkRegions(const uint64_t* regions, uint32_t blocks, uint8_t* dirty,
                        cudaStream_t stream) {
  MarkRegionsKernel<<<Blocks(uint64_t{blocks} * kRegionsInBlock), kItemThreads, 0, stream>>>(
      regions, blocks, dirty);
  return cudaGetLastError();
}

cudaError_t MarkLines(const ItemList& list, uint32_t count, const ThinLine* lines,
                      const RegionGrid& grid, uint8_t* dirty, cudaStream_t stream) {
  MarkLinesKernel<<<Blocks(count), kItemThreads, 0, stream>>>(list, count, lines, grid, dirty);
  return cudaGetLastError();
}

cudaError_t FindRegions(const ThinLine* lines, uint32_t count, const RegionGrid& grid,
                        uint64_t* regions, cudaStream_t stream) {
  FindRegionsKernel<<<Blocks(count), kItemThreads, 0, stream>>>(lines, count, grid, regions);
  return cudaGetLastError();
}

cudaError_t KillLines(const ItemList& list, uint32_t count, const LineArrays& lines,
                      cudaStream_t stream) {
  KillLinesKernel<<<Blocks(count), kItemThreads, 0, stream>>>(list, count, lines);
  return cudaGetLastError();
}

}  // namespace voxeld::gpu::cuda
