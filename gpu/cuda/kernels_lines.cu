// Thin lines: made from drawables' items, and sorted by region.
#include <cub/block/block_scan.cuh>

#include "gpu/cuda/items-inl.h"
#include "gpu/cuda/line_kernels.h"
#include "gpu/cuda/lines-inl.h"
#include "gpu/cuda/warp-inl.h"

namespace voxeld::gpu::cuda {
namespace {

constexpr uint32_t kThreads = 256;
constexpr uint32_t kWarps = kThreads / 32;
constexpr uint32_t kAll = 0xFFFFFFFFu;
static_assert(kLineChunk == kThreads, "a line each");

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

__global__ void MakeLinesKernel(const TableEntry* table, ItemList list, uint32_t items,
                                LineArrays to, uint32_t* ends) {
  const uint64_t i = Thread();
  if (i >= items) return;
  MakeLine(table, list, i, to, ends);
}

__global__ void CopyLinesKernel(ItemList list, uint64_t first, uint32_t count, LineArrays from,
                                const uint32_t* ends_from, LineArrays to, uint32_t* ends_to) {
  const uint64_t i = Thread();
  if (i >= count) return;
  const uint64_t at = PlaceOf(list, first + i);
  const ThinLine line = from.lines[at];
  to.lines[first + i] = line;
  to.tracks[first + i] = from.tracks[at];
  if (ends_to != nullptr) ends_to[first + i] = ends_from != nullptr ? ends_from[at] : line.word;
}

// ------------------------------------------------------------------------------ lines into blocks

__device__ void WalkBlocks(const RegionGrid& grid, const ThinLine* lines, uint32_t i,
                           uint32_t count, auto&& f) {
  if (i >= count) return;
  const ThinLine line = LoadLine(&lines[i]);
  if (line.word == 0) return;
  const int bits[3] = {RegionBits(0) + kBlockBits, RegionBits(1) + kBlockBits,
                       RegionBits(2) + kBlockBits};
  int32_t begin[3];
  for (int a = 0; a < 3; ++a) begin[a] = line.s[a] >> (8 + bits[a]);
  WalkThin(line, 0, begin, bits, [&](const int32_t block[3], int32_t k, int32_t end) {
    if (grid.DrawsBlock(block)) f(grid.BlockAt(block), LinePiece::Of(i, k, end - k));
    return true;
  });
}

__global__ void __launch_bounds__(kThreads)
    CountPiecesKernel(LineSort sort, const ThinLine* lines, uint32_t count) {
  extern __shared__ uint32_t found[];  // by block
  const uint32_t blocks = sort.grid.block_count();
  uint32_t* const offsets = sort.line_offsets + static_cast<size_t>(blockIdx.x) * blocks;
  for (uint32_t b = threadIdx.x; b < blocks; b += kThreads) found[b] = 0;
  __syncthreads();
  WalkBlocks(sort.grid, lines, blockIdx.x * kLineChunk + threadIdx.x, count,
             [&](uint32_t b, LinePiece) { atomicAdd(&found[b], 1u); });
  __syncthreads();
  for (uint32_t b = threadIdx.x; b < blocks; b += kThreads) {
    offsets[b] = found[b] == 0 ? 0 : atomicAdd(&sort.block_counts[b], found[b]);
  }
}

// Pieces that are written in the order of their blocks, because single writes to scattered
// addresses are slowest. A thread has a row; pieces that do not fit are written at once.
constexpr uint32_t kStagedEach = 18;
constexpr uint32_t kStaged = kStagedEach * kThreads;
constexpr uint32_t kMostSortedBlocks = 4 * kThreads;
struct PieceScratch {
  LinePiece pieces[kStaged];
  uint32_t places[kStaged];  // block, and from bit 16 on the rank in it
  uint16_t order[kStaged];
};

// Up to this many chunks, each of them sums the blocks for itself, which takes less time than
// another kernel.
constexpr uint32_t kFewLineChunks = 32;
bool SumsWhereFilled(const RegionGrid& grid, uint32_t count) {
  return grid.block_count() <= kMostSortedBlocks && count <= kFewLineChunks * kLineChunk;
}

// Does the same as ScanBlocksKernel, in each block of threads: begin[b] is where the pieces of b
// begin. The first block writes the results that later kernels need.
__device__ void SumBlocksHere(const LineSort& sort, uint32_t* begin) {
  using Scan = cub::BlockScan<uint32_t, kThreads>;
  __shared__ typename Scan::TempStorage pieces_scan, chunks_scan;
  constexpr uint32_t kEach = kMostSortedBlocks / kThreads;
  const uint32_t blocks = sort.grid.block_count();
  uint32_t pieces[kEach], chunks[kEach], all_pieces, all_chunks;
  for (uint32_t e = 0; e < kEach; ++e) {
    const uint32_t b = threadIdx.x * kEach + e;
    pieces[e] = b < blocks ? sort.block_counts[b] : 0;
    chunks[e] = (pieces[e] + kPieceChunk - 1) / kPieceChunk;
  }
  Scan(pieces_scan).ExclusiveSum(pieces, pieces, all_pieces);
  Scan(chunks_scan).ExclusiveSum(chunks, chunks, all_chunks);
  for (uint32_t e = 0; e < kEach; ++e) {
    const uint32_t b = threadIdx.x * kEach + e;
    if (b >= blocks) break;
    begin[b] = pieces[e];
    if (blockIdx.x != 0) continue;
    sort.block_begin[b] = pieces[e];
    sort.chunk_begin[b] = chunks[e];
  }
  if (blockIdx.x == 0 && threadIdx.x == 0) {
    sort.block_begin[blocks] = all_pieces;
    sort.chunk_begin[blocks] = all_chunks;
  }
}

// `sum`: block_begin has not been computed.
__global__ void __launch_bounds__(kThreads)
    FillPiecesKernel(LineSort sort, const ThinLine* lines, uint32_t count, bool sum) {
  extern __shared__ __align__(16) unsigned char memory[];
  const uint32_t blocks = sort.grid.block_count();
  const bool staged = blocks <= kMostSortedBlocks;
  PieceScratch& scratch = *reinterpret_cast<PieceScratch*>(memory);  // if staged
  uint32_t* const found =
      reinterpret_cast<uint32_t*>(memory + (staged ? sizeof(PieceScratch) : 0));  // by block
  const uint32_t* const offsets = sort.line_offsets + static_cast<size_t>(blockIdx.x) * blocks;
  for (uint32_t b = threadIdx.x; b < blocks; b += kThreads) found[b] = 0;
  const uint32_t* begin = sort.block_begin;
  if (sum) {
    SumBlocksHere(sort, found + blocks);
    begin = found + blocks;
  }
  __syncthreads();
  const auto put = [&](uint32_t b, uint32_t rank, LinePiece piece) {
    const uint32_t place = begin[b] + offsets[b] + rank;
    if (place < sort.piece_capacity) sort.pieces[place] = piece;
  };
  uint32_t mine = 0;
  WalkBlocks(sort.grid, lines, blockIdx.x * kLineChunk + threadIdx.x, count,
             [&](uint32_t b, LinePiece piece) {
               const uint32_t rank = atomicAdd(&found[b], 1u);
               if (!staged || mine == kStagedEach) return put(b, rank, piece);
               const uint32_t slot = mine++ * kThreads + threadIdx.x;
               scratch.pieces[slot] = piece;
               scratch.places[slot] = b | rank << 16;
             });
  if (!staged) return;
  using Scan = cub::BlockScan<uint32_t, kThreads>;
  __shared__ typename Scan::TempStorage scan;
  for (uint32_t i = threadIdx.x; i < kStaged; i += kThreads) scratch.order[i] = 0xFFFF;
  __syncthreads();
  uint32_t counts[kMostSortedBlocks / kThreads], total;
  for (uint32_t e = 0; e < kMostSortedBlocks / kThreads; ++e) {
    const uint32_t b = threadIdx.x * (kMostSortedBlocks / kThreads) + e;
    counts[e] = b < blocks ? found[b] : 0;
  }
  Scan(scan).ExclusiveSum(counts, counts, total);
  for (uint32_t e = 0; e < kMostSortedBlocks / kThreads; ++e) {
    const uint32_t b = threadIdx.x * (kMostSortedBlocks / kThreads) + e;
    if (b < blocks) found[b] = counts[e];
  }
  __syncthreads();
  for (uint32_t m = 0; m < mine; ++m) {
    const uint32_t slot = m * kThreads + threadIdx.x;
    const uint32_t at = found[scratch.places[slot] & 0xFFFF] + (scratch.places[slot] >> 16);
    // Places beyond it were written at once by other threads.
    if (at < kStaged) {
      scratch.order[at] = static_cast<uint16_t>(slot);
    } else {
      put(scratch.places[slot] & 0xFFFF, scratch.places[slot] >> 16, scratch.pieces[slot]);
    }
  }
  __syncthreads();
  for (uint32_t i = threadIdx.x; i < Min(total, kStaged); i += kThreads) {
    const uint32_t slot = scratch.order[i];
    if (slot == 0xFFFF) continue;
    put(scratch.places[slot] & 0xFFFF, scratch.places[slot] >> 16, scratch.pieces[slot]);
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

// Returns the block of regions to which this chunk of pieces belongs.
__device__ uint32_t BlockOf(const LineSort& sort, uint32_t chunk) {
  uint32_t low = 0, high = sort.grid.block_count();
  while (high - low > 1) {
    const uint32_t middle = low + (high - low) / 2;
    (sort.chunk_begin[middle] <= chunk ? low : high) = middle;
  }
  return low;
}

constexpr uint32_t kPiecesOfWarp = kPieceChunk / kWarps;
constexpr uint32_t kSpansOfWarp = kPiecesOfWarp * kMostSpansOfPiece;
constexpr uint32_t kLengths = 32;

struct SpanScratch {
  LinePiece order[kPieceChunk];          // by length, so that a warp's lanes have similar work
  LineSpan spans[kWarps][kSpansOfWarp];  // in the order in which they were found
  uint32_t found[kWarps];
  uint32_t lengths[kLengths];
  uint32_t at[kRegionsInBlock];  // per region: its spans, then the place of the next
  uint32_t base;
};

constexpr uint32_t kPiecesEach = kPieceChunk / kThreads;

// A chunk of pieces: the `count` pieces from `first` on, in block b.
struct PieceChunk {
  uint32_t b, first, count;
  LinePiece mine[kPiecesEach];

  // Loads `chunk`, whose block is b or a later one. The loads of its pieces are started.
  __device__ void Load(const LineSort& sort, uint32_t chunk) {
    while (sort.chunk_begin[b + 1] <= chunk) ++b;
    first = sort.block_begin[b] + (chunk - sort.chunk_begin[b]) * kPieceChunk;
    count = Min(sort.block_begin[b + 1] - first, kPieceChunk);
#pragma unroll
    for (uint32_t e = 0; e < kPiecesEach; ++e) {
      const uint32_t p = threadIdx.x + e * kThreads;
      if (p < count) mine[e] = sort.pieces[first + p];
    }
  }
};

// Sorts pieces into `order`.
__device__ void OrderPieces(const LinePiece mine[kPiecesEach], uint32_t count,
                            const ThinLine* lines, SpanScratch& scratch) {
  uint32_t rank[kPiecesEach], bucket[kPiecesEach];
#pragma unroll
  for (uint32_t e = 0; e < kPiecesEach; ++e) {
    const uint32_t p = threadIdx.x + e * kThreads;
    if (p >= count) continue;
    AskFor(&lines[mine[e].line]);
    bucket[e] = Min(mine[e].count() / 4, kLengths - 1);
    rank[e] = atomicAdd(&scratch.lengths[bucket[e]], 1u);
  }
  __syncthreads();
  if (threadIdx.x < kLengths) {
    uint32_t total;
    scratch.lengths[threadIdx.x] = SumBefore(scratch.lengths[threadIdx.x], total);
  }
  __syncthreads();
#pragma unroll
  for (uint32_t e = 0; e < kPiecesEach; ++e) {
    if (threadIdx.x + e * kThreads >= count) continue;
    scratch.order[scratch.lengths[bucket[e]] + rank[e]] = mine[e];
  }
  __syncthreads();
}

__global__ void __launch_bounds__(kThreads, 4)
    SortSpansKernel(LineSort sort, const ThinLine* lines, const uint32_t* ends) {
  __shared__ SpanScratch scratch;
  const uint32_t chunks = sort.chunk_begin[sort.grid.block_count()];
  if (sort.block_begin[sort.grid.block_count()] > sort.piece_capacity) return;
  const uint32_t warp = threadIdx.x / 32, lane = threadIdx.x % 32;
  const int bits[3] = {RegionBits(0), RegionBits(1), RegionBits(2)};
  // A run of chunks, usually of the same block of regions.
  const uint32_t begin_chunk =
      static_cast<uint32_t>(static_cast<uint64_t>(chunks) * blockIdx.x / gridDim.x);
  const uint32_t end_chunk =
      static_cast<uint32_t>(static_cast<uint64_t>(chunks) * (blockIdx.x + 1) / gridDim.x);
  if (begin_chunk == end_chunk) return;
  PieceChunk next{BlockOf(sort, begin_chunk)};
  next.Load(sort, begin_chunk);
  for (uint32_t chunk = begin_chunk; chunk < end_chunk; ++chunk) {
    if (threadIdx.x < kRegionsInBlock) scratch.at[threadIdx.x] = 0;
    if (threadIdx.x < kLengths) scratch.lengths[threadIdx.x] = 0;
    if (threadIdx.x < kWarps) scratch.found[threadIdx.x] = 0;
    __syncthreads();
    const uint32_t b = next.b, count = next.count;
    OrderPieces(next.mine, count, lines, scratch);
    if (chunk + 1 < end_chunk) next.Load(sort, chunk + 1);
    for (uint32_t round = 0; round < kPieceChunk / kThreads; ++round) {
      // A warp that has less work in one round has more in the next.
      const uint32_t group = round % 2 == 0 ? warp : kWarps - 1 - warp;
      const uint32_t p = round * kThreads + group * 32 + lane;
      __syncwarp();  // otherwise lanes that are done would run ahead
      if (p >= count) continue;
      const LinePiece piece = scratch.order[p];
      const ThinLine line = LoadLine(&lines[piece.line]);
      const int32_t k = piece.k(), stop = k + static_cast<int32_t>(piece.count());
      int32_t begin[3];
      for (int a = 0; a < 3; ++a) begin[a] = BoxAt(line, a, k, bits[a]);
      const bool mixed = ends != nullptr && ends[piece.line] != line.word;
      WalkThin(line, k, begin, bits, [&](const int32_t box[3], int32_t from, int32_t to) {
        const uint32_t region = RegionGrid::InBlock(box);
        atomicAdd(&scratch.at[region], 1u);
        // Lanes that are active together reserve their places together.
        const uint32_t here = __activemask();
        uint32_t place = 0;
        if (lane == static_cast<uint32_t>(__ffs(static_cast<int>(here))) - 1) {
          place = atomicAdd(&scratch.found[warp], static_cast<uint32_t>(__popc(here)));
        }
        place = __shfl_sync(here, place, __ffs(static_cast<int>(here)) - 1) +
                static_cast<uint32_t>(__popc(here & ((1u << lane) - 1)));
        scratch.spans[warp][place] = LineSpan::Of(piece.line, from, to - from, region, mixed);
        return to < stop;
      });
    }
    __syncthreads();
    if (warp == 0) {
      const uint32_t low = scratch.at[2 * lane], high = scratch.at[2 * lane + 1];
      uint32_t total;
      const uint32_t before = SumBefore(low + high, total);
      uint16_t* const offsets = sort.offsets + static_cast<size_t>(chunk) * (kRegionsInBlock + 1);
      offsets[2 * lane] = static_cast<uint16_t>(before);
      offsets[2 * lane + 1] = static_cast<uint16_t>(before + low);
      scratch.at[2 * lane] = before;
      scratch.at[2 * lane + 1] = before + low;
      if (sort.dirty != nullptr) {
        uint8_t* const dirty = sort.dirty + static_cast<size_t>(b) * kRegionsInBlock + 2 * lane;
        if (low != 0) dirty[0] = 1;
        if (high != 0) dirty[1] = 1;
      }
      uint64_t any = static_cast<uint64_t>(low != 0) << 2 * lane | static_cast<uint64_t>(high != 0)
                                                                       << (2 * lane + 1);
      for (int lanes = 16; lanes > 0; lanes /= 2) any |= __shfl_xor_sync(kAll, any, lanes);
      if (lane == 0) {
        offsets[kRegionsInBlock] = static_cast<uint16_t>(total);
        scratch.base = atomicAdd(sort.span_count, total);
        sort.base[chunk] = scratch.base;
        atomicOr(reinterpret_cast<unsigned long long*>(&sort.regions[b]),
                 static_cast<unsigned long long>(any));
      }
    }
    __syncthreads();
    const uint32_t base = scratch.base;
    for (uint32_t i = lane; i < scratch.found[warp]; i += 32) {
      const LineSpan span = scratch.spans[warp][i];
      const uint32_t place = base + atomicAdd(&scratch.at[span.region()], 1u);
      if (place < sort.span_capacity) {
        __stcs(reinterpret_cast<uint2*>(sort.spans) + place, make_uint2(span.line, span.bits));
      }
    }
    __syncthreads();
  }
}

size_t BlockNumbersShared(const RegionGrid& grid) {
  return size_t{grid.block_count()} * sizeof(uint32_t);
}

size_t FillShared(const RegionGrid& grid, bool sum) {
  const size_t staged = grid.block_count() <= kMostSortedBlocks ? sizeof(PieceScratch) : 0;
  return staged + BlockNumbersShared(grid) * (sum ? 2 : 1);
}

}  // namespace

size_t SortLinesShared(const RegionGrid& grid) {
  // Its static memory is additional: less than this size.
  constexpr size_t kSums = 4096;
  return FillShared(grid, grid.block_count() <= kMostSortedBlocks) + kSums;
}

cudaError_t FindBounds(const float* positions, uint32_t count, uint32_t* bounds,
                       cudaStream_t stream) {
  FindBoundsKernel<<<Min(Blocks(count), 1024u), kThreads, 0, stream>>>(positions, count, bounds);
  return cudaGetLastError();
}

cudaError_t MakeLines(const TableEntry* table, const ItemList& list, uint32_t items,
                      const LineArrays& to, uint32_t* ends, cudaStream_t stream) {
  MakeLinesKernel<<<Blocks(items), kThreads, 0, stream>>>(table, list, items, to, ends);
  return cudaGetLastError();
}

cudaError_t CopyLines(const ItemList& list, uint64_t first, uint32_t count, const LineArrays& from,
                      const uint32_t* ends_from, const LineArrays& to, uint32_t* ends_to,
                      cudaStream_t stream) {
  CopyLinesKernel<<<Blocks(count), kThreads, 0, stream>>>(list, first, count, from, ends_from, to,
                                                          ends_to);
  return cudaGetLastError();
}

cudaError_t CountPieces(const LineSort& sort, const ThinLine* lines, uint32_t count,
                        cudaStream_t stream) {
  const size_t shared = BlockNumbersShared(sort.grid);
  cudaError_t error = cudaFuncSetAttribute(
      CountPiecesKernel, cudaFuncAttributeMaxDynamicSharedMemorySize, static_cast<int>(shared));
  if (error != cudaSuccess) return error;
  CountPiecesKernel<<<(count + kLineChunk - 1) / kLineChunk, kThreads, shared, stream>>>(
      sort, lines, count);
  if (error = cudaGetLastError(); error != cudaSuccess) return error;
  if (SumsWhereFilled(sort.grid, count)) return cudaSuccess;
  ScanBlocksKernel<<<1, kScanThreads, 0, stream>>>(sort);
  return cudaGetLastError();
}

cudaError_t FillPieces(const LineSort& sort, const ThinLine* lines, uint32_t count,
                       cudaStream_t stream) {
  const bool sum = SumsWhereFilled(sort.grid, count);
  const size_t shared = FillShared(sort.grid, sum);
  const cudaError_t error = cudaFuncSetAttribute(
      FillPiecesKernel, cudaFuncAttributeMaxDynamicSharedMemorySize, static_cast<int>(shared));
  if (error != cudaSuccess) return error;
  FillPiecesKernel<<<(count + kLineChunk - 1) / kLineChunk, kThreads, shared, stream>>>(sort, lines,
                                                                                        count, sum);
  return cudaGetLastError();
}

cudaError_t SortSpans(const LineSort& sort, const ThinLine* lines, const uint32_t* ends,
                      uint32_t blocks, cudaStream_t stream) {
  SortSpansKernel<<<blocks, kThreads, 0, stream>>>(sort, lines, ends);
  return cudaGetLastError();
}

}  // namespace voxeld::gpu::cuda
