// Makes a few thin lines and sorts them by region, in one block of threads: for so few, each of the
// six kernels used for many lines would finish before the next could be queued.
#include <cub/block/block_scan.cuh>

#include "gpu/cuda/line_kernels.h"
#include "gpu/cuda/lines-inl.h"

namespace voxeld::gpu::cuda {
namespace {

constexpr uint32_t kThreads = kMostFewLines;  // one line each
constexpr uint32_t kAll = 0xFFFFFFFFu;

// Replaces counts[r] by the sum of those before; returns the sum of all.
__device__ uint32_t SumCounts(uint32_t* counts, uint32_t regions) {
  using Scan = cub::BlockScan<uint32_t, kThreads>;
  __shared__ typename Scan::TempStorage scan;
  const uint32_t each = (regions + kThreads - 1) / kThreads;
  const uint32_t first = Min(threadIdx.x * each, regions), last = Min(first + each, regions);
  uint32_t sum = 0, all;
  for (uint32_t r = first; r < last; ++r) sum += counts[r];
  Scan(scan).ExclusiveSum(sum, sum, all);
  for (uint32_t r = first; r < last; ++r) {
    const uint32_t count = counts[r];
    counts[r] = sum;
    sum += count;
  }
  __syncthreads();
  return all;
}

// Writes the arrays of SpanLists, with one chunk for every block of regions. counts: spans before
// each region.
__device__ void PutLists(const LineSort& sort, const uint32_t* counts, uint32_t all) {
  const uint32_t blocks = sort.grid.block_count(), regions = sort.grid.count();
  for (uint32_t b = threadIdx.x; b <= blocks; b += kThreads) {
    sort.chunk_begin[b] = b;
    if (b < blocks) sort.base[b] = counts[b * kRegionsInBlock];
  }
  static_assert(kRegionsInBlock % 32 == 0);
  for (uint32_t r = threadIdx.x; r < regions; r += kThreads) {
    const uint32_t b = r / kRegionsInBlock, in_block = r % kRegionsInBlock;
    const uint32_t begin = counts[b * kRegionsInBlock];
    const uint32_t after = r + 1 < regions ? counts[r + 1] : all;
    uint16_t* const offsets = sort.offsets + static_cast<size_t>(b) * (kRegionsInBlock + 1);
    offsets[in_block] = static_cast<uint16_t>(counts[r] - begin);
    if (in_block + 1 == kRegionsInBlock)
      offsets[in_block + 1] = static_cast<uint16_t>(after - begin);
    const bool any = after != counts[r];
    if (any && sort.dirty != nullptr) sort.dirty[r] = 1;
    const uint32_t bits = __ballot_sync(kAll, any);
    if (threadIdx.x % 32 == 0) reinterpret_cast<uint32_t*>(sort.regions)[r / 32] = bits;
  }
}

__global__ void __launch_bounds__(kThreads)
    SortFewLinesKernel(const __grid_constant__ FewLines few) {
  // Per region: its number of spans, then the spans before it, then the place of the next.
  extern __shared__ uint32_t counts[];
  const LineSort& sort = few.sort;
  const uint32_t regions = sort.grid.count(), i = threadIdx.x;
  for (uint32_t r = i; r < regions; r += kThreads) counts[r] = 0;
  PutFew(few.table, few.entries, few.entry_count);
  __syncthreads();
  ThinLine line = {};
  if (i < few.count) {
    line = few.table != nullptr ? MakeLine(few.table, few.list, i, few.lines, few.ends)
                                : LoadLine(&few.lines.lines[i]);
  }
  const bool mixed = i < few.count && few.ends != nullptr && few.ends[i] != line.word;
  WalkRegions(sort.grid, line, [&](const int32_t[3], uint32_t region, int32_t, int32_t) {
    atomicAdd(&counts[region], 1u);
  });
  __syncthreads();
  PutLists(sort, counts, SumCounts(counts, regions));
  __syncthreads();
  WalkRegions(sort.grid, line, [&](const int32_t box[3], uint32_t region, int32_t k, int32_t end) {
    const uint32_t place = atomicAdd(&counts[region], 1u);
    if (place >= sort.span_capacity) return;
    sort.spans[place] = LineSpan::Of(i, k, end - k, RegionGrid::InBlock(box), mixed);
  });
}

}  // namespace

// The memory of the scan is additional: less than 4 KB.
size_t SortFewLinesShared(const RegionGrid& grid) {
  return size_t{grid.count()} * sizeof(uint32_t);
}

cudaError_t SortFewLines(const FewLines& few, cudaStream_t stream) {
  const size_t shared = SortFewLinesShared(few.sort.grid);
  const cudaError_t error = cudaFuncSetAttribute(
      SortFewLinesKernel, cudaFuncAttributeMaxDynamicSharedMemorySize, static_cast<int>(shared));
  if (error != cudaSuccess) return error;
  SortFewLinesKernel<<<1, kThreads, shared, stream>>>(few);
  return cudaGetLastError();
}

}  // namespace voxeld::gpu::cuda
