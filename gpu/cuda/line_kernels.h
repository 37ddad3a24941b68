// Thin lines on the device: made, and sorted by the regions that they touch, in two goes. Lines are
// cut into pieces by block of regions: counted, in chunks that reserve their places, and then put
// there. A block's pieces are cut into spans, chunk by chunk, each sorted by region in shared memory.
//
// Each function queues its kernels in `stream` and answers whether that could be done.
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "gpu/cuda/line_types.h"

namespace voxeld::gpu::cuda {

// bounds[6]: of `count` positions, the least and the greatest on each axis, as OrderedBits; they
// begin as ~0, ~0, ~0, 0, 0, 0.
cudaError_t FindBounds(const float* positions, uint32_t count, uint32_t* bounds,
                       cudaStream_t stream);
// A float's bits in the order of the numbers, and back.
inline float FromOrderedBits(uint32_t bits) {
  bits = bits >> 31 != 0 ? bits ^ 0x80000000u : ~bits;
  float value;
  std::memcpy(&value, &bits, sizeof(value));
  return value;
}

// Line i of `to` is item i of the list, of segments or points without thickness. `ends`: may be null.
cudaError_t MakeLines(const TableEntry* table, const ItemList& list, uint32_t items,
                      const LineArrays& to, uint32_t* ends, cudaStream_t stream);

// Line first + i of `to` is slot(d) + … of `from` for i up to `count`, item first + i of the list being the …-th of
// its d-th row. `ends_to` may be null; where `ends_from` is, a line's end is as its beginning.
cudaError_t CopyLines(const ItemList& list, uint64_t first, uint32_t count, const LineArrays& from,
                      const uint32_t* ends_from, const LineArrays& to, uint32_t* ends_to,
                      cudaStream_t stream);

// ---- sorting
// Shared memory that the first go takes of a block of threads, at most.
size_t SortLinesShared(const RegionGrid& grid);

// After the second of them block_begin and chunk_begin are there.
cudaError_t CountPieces(const LineSort& sort, const ThinLine* lines, uint32_t count,
                        cudaStream_t stream);
cudaError_t FillPieces(const LineSort& sort, const ThinLine* lines, uint32_t count,
                       cudaStream_t stream);
// All of it at once, of kMostFewLines at most; of `sort` all is put down but what is between the goes.
// With a table the lines are made first, as MakeLines does, after the entries have been put into it.
inline constexpr uint32_t kMostFewLines = 1024;
struct FewLines {
  LineSort sort;
  LineArrays lines;
  uint32_t* ends = nullptr;
  uint32_t count = 0, entry_count = 0;
  TableEntry* table = nullptr;
  ItemList list;
  FewEntries entries;
};
static_assert(sizeof(FewLines) <= 4096, "arguments have 4 KB");
cudaError_t SortFewLines(const FewLines& few, cudaStream_t stream);
// Shared memory that this takes.
size_t SortFewLinesShared(const RegionGrid& grid);
// `ends`: which lines have two colours; may be null. By so many blocks of threads.
cudaError_t SortSpans(const LineSort& sort, const ThinLine* lines, const uint32_t* ends,
                      uint32_t blocks, cudaStream_t stream);

// ---- what is to be drawn anew
// Those that have spans; `regions` by block as SpanLists has it.
cudaError_t MarkRegions(const uint64_t* regions, uint32_t blocks, uint8_t* dirty,
                        cudaStream_t stream);
// Of lines in rows, `count` in all; the first of the d-th is slot(d). Marks the regions that they
// touch.
cudaError_t MarkLines(const ItemList& list, uint32_t count, const ThinLine* lines,
                      const RegionGrid& grid, uint8_t* dirty, cudaStream_t stream);
// Adds to `regions`, by block, those that any of `count` lines touches.
cudaError_t FindRegions(const ThinLine* lines, uint32_t count, const RegionGrid& grid,
                        uint64_t* regions, cudaStream_t stream);
// Of lines in rows: they draw nothing from now on.
cudaError_t KillLines(const ItemList& list, uint32_t count, const LineArrays& lines,
                      cudaStream_t stream);

}  // namespace voxeld::gpu::cuda
