// For kernels over thin lines.
#pragma once

#include "gpu/cuda/items-inl.h"
#include "gpu/cuda/line_types.h"
#include "gpu/primitives/list.h"
#include "gpu/word.h"

namespace voxeld::gpu::cuda {

// Prefetches into the second-level cache.
__device__ inline void AskFor(const void* what) {
#if defined(__CUDA_ARCH__)
  asm volatile("prefetch.global.L2 [%0];" ::"l"(what));
#endif
}

__device__ inline ThinLine LoadLine(const ThinLine* line) {
  const int4* const at = reinterpret_cast<const int4*>(line);
  const int4 a = at[0], b = at[1];
  return {{a.x, a.y, a.z}, a.w, {b.x, b.y, b.z}, static_cast<uint32_t>(b.w)};
}

// Calls f(box, region, k, end) for each drawn region in which the line has voxels.
__device__ void WalkRegions(const RegionGrid& grid, const ThinLine& line, auto&& f) {
  if (line.word == 0) return;
  const int bits[3] = {RegionBits(0), RegionBits(1), RegionBits(2)};
  int32_t begin[3];
  for (int a = 0; a < 3; ++a) begin[a] = line.s[a] >> (8 + bits[a]);
  WalkThin(line, 0, begin, bits, [&](const int32_t box[3], int32_t k, int32_t end) {
    const int32_t block[3] = {box[0] >> kBlockBits, box[1] >> kBlockBits, box[2] >> kBlockBits};
    if (grid.DrawsBlock(block)) f(box, grid.RegionAt(box), k, end);
    return true;
  });
}

// Sets a region's bit, by block as in SpanLists.
__device__ inline void SetRegion(uint64_t* regions, uint32_t region) {
  uint64_t& bits = regions[region / kRegionsInBlock];
  const uint64_t bit = uint64_t{1} << region % kRegionsInBlock;
  // Most bits are already set; if that is not visible yet, a bit is set again.
  if ((*static_cast<const volatile uint64_t*>(&bits) & bit) != 0) return;
  atomicOr(reinterpret_cast<unsigned long long*>(&bits), static_cast<unsigned long long>(bit));
}

// Makes line i of `to` from item i of the list, and returns it.
__device__ inline ThinLine MakeLine(const TableEntry* table, const ItemList& list, uint64_t i,
                                    const LineArrays& to, uint32_t* ends) {
  const uint32_t d = DrawableOf(list, i);
  const TableEntry& entry = table[list.slot(d)];
  const uint32_t item = static_cast<uint32_t>(i - list.first(d));
  const Line line = entry.record.kind == PrimitiveKind::kPoints
                        ? Points::ItemOf(entry.source, item)
                        : Segments::ItemOf(entry.source, item);
  const bool erase = entry.erase != 0;
  ThinLine thin = MakeThin(line, MakeWord(entry.priority, erase, line.color_s));
  uint32_t end = MakeWord(entry.priority, erase, line.color_e);
  if (thin.n == 0) thin.word = end = Max(thin.word, end);  // both ends are the same voxel
  to.lines[i] = thin;
  to.tracks[i] = TrackOf(thin);
  if (ends != nullptr) ends[i] = end;
  return thin;
}

}  // namespace voxeld::gpu::cuda
