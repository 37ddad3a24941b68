// Thin lines: made from drawables' items, and sorted by region.
#include <cub/block/block_scan.cuh>
#include <cub/device/device_scan.cuh>

#include "gpu/cuda/items-inl.h"
#include "gpu/cuda/line_kernels.h"
#include "gpu/primitives/list.h"
#include "gpu/word.h"

namespace voxeld::gpu::cuda {
namespace {

constexpr uint32_t kThreads = 256;

__device__ uint32_t OrderedBits(float value) {
  const uint32_t bits = __float_as_uint(value);
  return bits >> 31 != 0 ? ~bits : bits | 0x80000000u;
}

__global__ void FindBoundsKernel(const float* positions, uint32_t count, uint32_t* bounds) {
  uint32_t least[3] = {~0u, ~0u, ~0u}, greatest[3] = {0, 0, 0};
  const uint64_t stride = static_cast<uint64_t>(gridDim.x) * blockDim.x;
  for (uint64_t i = Thread(); i < count; i += stride) {
    for (uint32_t a = 0; a < 3; ++a) {
      const uint32_t bits = OrderedBits(positions[i * 3 + a]);
      least[a] = Min(least[a], bits);
      greatest[a] = Max(greatest[a], bits);
    }
  }
  for (uint32_t a = 0; a < 3; ++a) {
    for (int lanes = 16; lanes > 0; lanes /= 2) {
      least[a] = Min(least[a], __shfl_xor_sync(~0u, least[a], lanes));
      greatest[a] = Max(greatest[a], __shfl_xor_sync(~0u, greatest[a], lanes));
    }
    if (threadIdx.x % 32 == 0) {
      atomicMin(&bounds[a], least[a]);
      atomicMax(&bounds[3 + a], greatest[a]);
    }
  }
}

__device__ ThinLine Load(const ThinLine* line) {
  const int4* const at = reinterpret_cast<const int4*>(line);
  const int4 a = at[0], b = at[1];
  return {{a.x, a.y, a.z}, a.w, {b.x, b.y, b.z}, static_cast<uint32_t>(b.w)};
}

__global__ void MakeLinesKernel(const TableEntry* table, ItemList list, uint32_t items,
                                ThinLine* lines, uint32_t* ends) {
  const uint64_t i = Thread();
  if (i >= items) return;
  const uint32_t d = DrawableOf(list, i);
  const TableEntry& entry = table[list.slots[d]];
  const uint32_t item = static_cast<uint32_t>(i - list.first[d]);
  const Line line = entry.record.kind == PrimitiveKind::kPoints
                        ? Points::ItemOf(entry.source, item)
                        : Segments::ItemOf(entry.source, item);
  const bool erase = entry.erase != 0;
  lines[i] = MakeThin(line, MakeWord(entry.priority, erase, line.color_s));
  if (ends != nullptr) ends[i] = MakeWord(entry.priority, erase, line.color_e);
}

// Line `i` of the rows.
__device__ uint64_t LineAt(const ItemList& list, uint64_t i) {
  const uint32_t d = DrawableOf(list, i);
  return list.slots[d] + (i - list.first[d]);
}

__global__ void CopyLinesKernel(ItemList list, uint64_t first, uint32_t count, const ThinLine* from,
                                const uint32_t* ends_from, ThinLine* to, uint32_t* ends_to) {
  const uint64_t i = Thread();
  if (i >= count) return;
  const uint64_t at = LineAt(list, first + i);
  const ThinLine line = Load(&from[at]);
  to[first + i] = line;
  if (ends_to != nullptr) ends_to[first + i] = ends_from != nullptr ? ends_from[at] : line.word;
}

// ------------------------------------------------------------------------------ lines into blocks

template <bool kFill>
__global__ void __launch_bounds__(kThreads)
    SortLinesKernel(LineSort sort, const ThinLine* lines, uint32_t count) {
  extern __shared__ uint32_t at[];  // by block: pieces so far; filling, the place of the next
  const uint32_t blocks = sort.grid.block_count();
  uint32_t* const offsets = sort.line_offsets + static_cast<size_t>(blockIdx.x) * blocks;
  for (uint32_t b = threadIdx.x; b < blocks; b += kThreads) {
    at[b] = kFill ? sort.block_begin[b] + offsets[b] : 0;
  }
  __syncthreads();
  const int bits[3] = {RegionBits(0) + kBlockBits, RegionBits(1) + kBlockBits,
                       RegionBits(2) + kBlockBits};
  const uint64_t first = static_cast<uint64_t>(blockIdx.x) * sort.chunk;
  const uint64_t last = Min<uint64_t>(count, first + sort.chunk);
  for (uint64_t i = first + threadIdx.x; i < last; i += kThreads) {
    const ThinLine line = Load(&lines[i]);
    if (line.word == 0) continue;
    int32_t begin[3];
    for (int a = 0; a < 3; ++a) begin[a] = line.s[a] >> (8 + bits[a]);
    WalkThin(line, 0, begin, bits, [&](const int32_t block[3], int32_t k, int32_t) {
      if (!sort.grid.HasBlock(block)) return true;
      const uint32_t place = atomicAdd(&at[sort.grid.BlockAt(block)], 1u);
      if (kFill && place < sort.piece_capacity) {
        sort.pieces[place] = {static_cast<uint32_t>(i), static_cast<uint32_t>(k)};
      }
      return true;
    });
  }
  if (kFill) return;
  __syncthreads();
  for (uint32_t b = threadIdx.x; b < blocks; b += kThreads) {
    offsets[b] = at[b] == 0 ? 0 : atomicAdd(&sort.block_counts[b], at[b]);
  }
}

constexpr uint32_t kScanThreads = 1024;

__global__ void __launch_bounds__(kScanThreads) ScanBlocksKernel(LineSort sort) {
  using Scan = cub::BlockScan<uint32_t, kScanThreads>;
  __shared__ typename Scan::TempStorage pieces_scan, chunks_scan;
  const uint32_t blocks = sort.grid.block_count();
  uint32_t pieces = 0, chunks = 0;
  for (uint32_t base = 0; base < blocks; base += kScanThreads) {
    const uint32_t b = base + threadIdx.x;
    const uint32_t count = b < blocks ? sort.block_counts[b] : 0;
    uint32_t before, all, chunks_before, chunks_all;
    Scan(pieces_scan).ExclusiveSum(count, before, all);
    Scan(chunks_scan)
        .ExclusiveSum((count + kPieceChunk - 1) / kPieceChunk, chunks_before, chunks_all);
    if (b < blocks) {
      sort.block_begin[b] = pieces + before;
      sort.chunk_begin[b] = chunks + chunks_before;
    }
    pieces += all;
    chunks += chunks_all;
    __syncthreads();
  }
  if (threadIdx.x == 0) {
    sort.block_begin[blocks] = pieces;
    sort.chunk_begin[blocks] = chunks;
  }
}

// ---------------------------------------------------------------------------- pieces into regions

// The block of regions whose chunk of pieces this is.
__device__ uint32_t BlockOf(const LineSort& sort, uint32_t chunk) {
  uint32_t low = 0, high = sort.grid.block_count();
  while (high - low > 1) {
    const uint32_t middle = low + (high - low) / 2;
    (sort.chunk_begin[middle] <= chunk ? low : high) = middle;
  }
  return low;
}

template <bool kFill>
__global__ void __launch_bounds__(kThreads)
    SortPiecesKernel(LineSort sort, const ThinLine* lines, const uint32_t* ends,
                     const uint32_t* rows, LineSpan* spans) {
  __shared__ uint32_t at[kRegionsInBlock];
  const int bits[3] = {RegionBits(0), RegionBits(1), RegionBits(2)};
  const uint32_t chunks = sort.chunk_begin[sort.grid.block_count()];
  if (sort.block_begin[sort.grid.block_count()] > sort.piece_capacity) return;
  for (uint32_t chunk = blockIdx.x; chunk < chunks; chunk += gridDim.x) {
    const uint32_t b = BlockOf(sort, chunk);
    int32_t block[3];
    sort.grid.BlockCoordinates(b, block);
    uint32_t* const offsets = sort.piece_offsets + static_cast<size_t>(chunk) * kRegionsInBlock;
    if (threadIdx.x < kRegionsInBlock) {
      at[threadIdx.x] = kFill ? rows[b * kRegionsInBlock + threadIdx.x] + offsets[threadIdx.x] : 0;
    }
    __syncthreads();
    const uint32_t first = sort.block_begin[b] + (chunk - sort.chunk_begin[b]) * kPieceChunk;
    const uint32_t last = Min(sort.block_begin[b + 1], first + kPieceChunk);
    for (uint32_t p = first + threadIdx.x; p < last; p += kThreads) {
      const LinePiece piece = sort.pieces[p];
      const ThinLine line = Load(&lines[piece.line]);
      const int32_t k = static_cast<int32_t>(piece.k);
      int32_t begin[3];
      for (int a = 0; a < 3; ++a) begin[a] = BoxAt(line, a, k, bits[a]);
      bool mixed = false;
      if (kFill && ends != nullptr) mixed = ends[piece.line] != line.word;
      WalkThin(line, k, begin, bits, [&](const int32_t box[3], int32_t from, int32_t to) {
        for (int a = 0; a < 3; ++a) {
          if (box[a] >> kBlockBits != block[a]) return false;
        }
        const uint32_t place = atomicAdd(&at[RegionGrid::InBlock(box)], 1u);
        if (kFill && place < sort.span_capacity) {
          spans[place] = LineSpan::Of(piece.line, from, to - from, mixed);
        }
        return true;
      });
    }
    __syncthreads();
    if (!kFill && threadIdx.x < kRegionsInBlock) {
      const uint32_t count = at[threadIdx.x];
      offsets[threadIdx.x] =
          count == 0 ? 0 : atomicAdd(&sort.region_counts[b * kRegionsInBlock + threadIdx.x], count);
    }
    __syncthreads();
  }
}

// ----------------------------------------------------------------------------------------- marking

__global__ void MarkRowsKernel(const uint32_t* rows, uint32_t regions, uint8_t* dirty) {
  const uint64_t r = Thread();
  if (r < regions && rows[r] != rows[r + 1]) dirty[r] = 1;
}

__global__ void MarkLinesKernel(ItemList list, uint32_t count, const ThinLine* lines,
                                RegionGrid grid, uint8_t* dirty) {
  const uint64_t i = Thread();
  if (i >= count) return;
  const ThinLine line = Load(&lines[LineAt(list, i)]);
  const int bits[3] = {RegionBits(0), RegionBits(1), RegionBits(2)};
  int32_t begin[3];
  for (int a = 0; a < 3; ++a) begin[a] = line.s[a] >> (8 + bits[a]);
  WalkThin(line, 0, begin, bits, [&](const int32_t box[3], int32_t, int32_t) {
    const int32_t block[3] = {box[0] >> kBlockBits, box[1] >> kBlockBits, box[2] >> kBlockBits};
    if (grid.HasBlock(block)) dirty[grid.RegionAt(box)] = 1;
    return true;
  });
}

__global__ void KillLinesKernel(ItemList list, uint32_t count, ThinLine* lines) {
  const uint64_t i = Thread();
  if (i < count) lines[LineAt(list, i)].word = 0;
}

template <bool kFill>
cudaError_t SortLines(const LineSort& sort, const ThinLine* lines, uint32_t count,
                      cudaStream_t stream) {
  const size_t shared = SortLinesShared(sort.grid);
  const uint32_t chunks = (count + sort.chunk - 1) / sort.chunk;
  const cudaError_t error =
      cudaFuncSetAttribute(SortLinesKernel<kFill>, cudaFuncAttributeMaxDynamicSharedMemorySize,
                           static_cast<int>(kMostSortLinesShared));
  if (error != cudaSuccess) return error;
  SortLinesKernel<kFill><<<chunks, kThreads, shared, stream>>>(sort, lines, count);
  return cudaGetLastError();
}

}  // namespace

cudaError_t FindBounds(const float* positions, uint32_t count, uint32_t* bounds,
                       cudaStream_t stream) {
  FindBoundsKernel<<<Min(Blocks(count), 1024u), kThreads, 0, stream>>>(positions, count, bounds);
  return cudaGetLastError();
}

cudaError_t MakeLines(const TableEntry* table, const ItemList& list, uint32_t items,
                      ThinLine* lines, uint32_t* ends, cudaStream_t stream) {
  MakeLinesKernel<<<Blocks(items), kThreads, 0, stream>>>(table, list, items, lines, ends);
  return cudaGetLastError();
}

cudaError_t CopyLines(const ItemList& list, uint64_t first, uint32_t count, const ThinLine* from,
                      const uint32_t* ends_from, ThinLine* to, uint32_t* ends_to,
                      cudaStream_t stream) {
  CopyLinesKernel<<<Blocks(count), kThreads, 0, stream>>>(list, first, count, from, ends_from, to,
                                                          ends_to);
  return cudaGetLastError();
}

cudaError_t CountPieces(const LineSort& sort, const ThinLine* lines, uint32_t count,
                        cudaStream_t stream) {
  if (const cudaError_t error = SortLines<false>(sort, lines, count, stream);
      error != cudaSuccess) {
    return error;
  }
  ScanBlocksKernel<<<1, kScanThreads, 0, stream>>>(sort);
  return cudaGetLastError();
}

cudaError_t FillPieces(const LineSort& sort, const ThinLine* lines, uint32_t count,
                       cudaStream_t stream) {
  return SortLines<true>(sort, lines, count, stream);
}

cudaError_t CountSpans(const LineSort& sort, const ThinLine* lines, uint32_t blocks,
                       cudaStream_t stream) {
  SortPiecesKernel<false><<<blocks, kThreads, 0, stream>>>(sort, lines, nullptr, nullptr, nullptr);
  return cudaGetLastError();
}

cudaError_t SumRows(void* temp, size_t& temp_bytes, const LineSort& sort, uint32_t* rows,
                    cudaStream_t stream) {
  return cub::DeviceScan::ExclusiveSum(temp, temp_bytes, sort.region_counts, rows,
                                       sort.grid.count() + 1, stream);
}

cudaError_t FillSpans(const LineSort& sort, const ThinLine* lines, const uint32_t* ends,
                      const uint32_t* rows, LineSpan* spans, uint32_t blocks, cudaStream_t stream) {
  SortPiecesKernel<true><<<blocks, kThreads, 0, stream>>>(sort, lines, ends, rows, spans);
  return cudaGetLastError();
}

cudaError_t MarkRows(const uint32_t* rows, uint32_t regions, uint8_t* dirty, cudaStream_t stream) {
  MarkRowsKernel<<<Blocks(regions), kThreads, 0, stream>>>(rows, regions, dirty);
  return cudaGetLastError();
}

cudaError_t MarkLines(const ItemList& list, uint32_t count, const ThinLine* lines,
                      const RegionGrid& grid, uint8_t* dirty, cudaStream_t stream) {
  MarkLinesKernel<<<Blocks(count), kThreads, 0, stream>>>(list, count, lines, grid, dirty);
  return cudaGetLastError();
}

cudaError_t KillLines(const ItemList& list, uint32_t count, ThinLine* lines, cudaStream_t stream) {
  KillLinesKernel<<<Blocks(count), kThreads, 0, stream>>>(list, count, lines);
  return cudaGetLastError();
}

}  // namespace voxeld::gpu::cuda
