// Thin lines on the device: made, and sorted by the regions that they touch, in two steps. Lines
// are cut into pieces by block of regions: the pieces are counted, in chunks that reserve their
// places, and then written there. A block's pieces are cut into spans, chunk by chunk, each sorted
// by region in shared memory.
//
// Each function queues its kernels in `stream` and returns whether that succeeded.
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "gpu/cuda/line_types.h"

namespace voxeld::gpu::cuda {

// Computes bounds[6], the least and the greatest of `count` positions on each axis, as OrderedBits;
// the initial values must be ~0, ~0, ~0, 0, 0, 0.
cudaError_t FindBounds(const float* positions, uint32_t count, uint32_t* bounds,
                       cudaStream_t stream);
// Converts a float's bits to the order of the numbers, and back.
inline float FromOrderedBits(uint32_t bits) {
  bits = bits >> 31 != 0 ? bits ^ 0x80000000u : ~bits;
  float value;
  std::memcpy(&value, &bits, sizeof(value));
  return value;
}

// Makes line i of `to` from item i of the list, of segments or points without thickness. `ends` may
// be null.
cudaError_t MakeLines(const TableEntry* table, const ItemList& list, uint32_t items,
                      const LineArrays& to, uint32_t* ends, cudaStream_t stream);

// Copies `count` lines: if item first + i of the list is the j-th of its d-th row, line first + i
// of `to` is line slot(d) + j of `from`. `ends_to` may be null; if `ends_from` is null, a line's
// end has the word of its beginning.
cudaError_t CopyLines(const ItemList& list, uint64_t first, uint32_t count, const LineArrays& from,
                      const uint32_t* ends_from, const LineArrays& to, uint32_t* ends_to,
                      cudaStream_t stream);

// ---- sorting
// Returns the greatest shared memory that the first step takes for a block of threads.
size_t SortLinesShared(const RegionGrid& grid);

// After FillPieces, block_begin and chunk_begin are set.
cudaError_t CountPieces(const LineSort& sort, const ThinLine* lines, uint32_t count,
                        cudaStream_t stream);
cudaError_t FillPieces(const LineSort& sort, const ThinLine* lines, uint32_t count,
                       cudaStream_t stream);
// Does both steps at once, for at most kMostFewLines lines; fills in everything in `sort` except
// the intermediate arrays. With a table the lines are made first, as by MakeLines, after the
// entries have been put into it.
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
// Returns the shared memory that SortFewLines takes.
size_t SortFewLinesShared(const RegionGrid& grid);
// `ends`: which lines have two colours; may be null. Uses `blocks` blocks of threads.
cudaError_t SortSpans(const LineSort& sort, const ThinLine* lines, const uint32_t* ends,
                      uint32_t blocks, cudaStream_t stream);

// ---- marking dirty regions
// Marks the regions that have spans; `regions` is by block, as in SpanLists.
cudaError_t MarkRegions(const uint64_t* regions, uint32_t blocks, uint8_t* dirty,
                        cudaStream_t stream);
// For lines in rows, `count` in all, where the first line of the d-th row is slot(d): marks the
// regions that they touch.
cudaError_t MarkLines(const ItemList& list, uint32_t count, const ThinLine* lines,
                      const RegionGrid& grid, uint8_t* dirty, cudaStream_t stream);
// Adds to `regions`, by block, those that any of `count` lines touches.
cudaError_t FindRegions(const ThinLine* lines, uint32_t count, const RegionGrid& grid,
                        uint64_t* regions, cudaStream_t stream);
// For lines in rows: makes them draw nothing from now on.
cudaError_t KillLines(const ItemList& list, uint32_t count, const LineArrays& lines,
                      cudaStream_t stream);

}  // namespace voxeld::gpu::cuda
