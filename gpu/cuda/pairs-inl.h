// Raises pairs of items and tiles into a region's words: everything except thin lines, points and
// small triangles with lists, and items without a list of pairs as well.
#pragma once

#include "gpu/cuda/filled-inl.h"
#include "gpu/cuda/implicit-inl.h"
#include "gpu/cuda/items-inl.h"
#include "gpu/cuda/region_scratch-inl.h"
#include "gpu/cuda/samples-inl.h"
#include "gpu/cuda/solids-inl.h"
#include "gpu/primitives/list.h"

namespace voxeld::gpu::cuda {

struct PairScratch {
  union {  // must be first: SharedBehind
    SolidBlock solid;
    SmallSolids small_solids;
    ImplicitScratch implicit;
    SampleScratch samples;
  };
  uint64_t heavy[kDrawThreads];  // pairs for many threads; from the end on small solids,
  uint32_t tiles[kDrawThreads];  // and the tile of each
  uint32_t heavy_count;
  uint32_t small_count, small_taken;  // small_taken: by warps that draw them

  __device__ uint32_t listed() const { return heavy_count + small_count; }
};

// Returns the existing voxels of the region in which a tile lies.
__device__ inline Box3 RegionAround(const TileGrid& grid, uint32_t tile) {
  Box3 box = grid.VoxelsOf(tile);
  for (int a = 0; a < 3; ++a) {
    box.lo[a] &= -(1 << RegionBits(a));
    box.hi[a] = Min(grid.voxels[a], box.lo[a] + (1 << RegionBits(a)));
  }
  return box;
}

// Raises a pair's voxels in `box`.
template <class Primitive>
static __device__ __noinline__ void DrawItem(const TableEntry& entry, uint32_t item,
                                             const Box3& box) {
  const bool erase = entry.erase != 0;
  Primitive::EmitVoxels(entry.source, item, box,
                        RaiseVoxel(MakeWord(entry.priority, erase, 0), /*recolor=*/!erase));
}

static __device__ __noinline__ Box3 BoundsOfTriangle(const TableEntry& entry, uint32_t item) {
  return BoundsOf(Triangles::ItemOf(entry.source, item), entry.source.radius);
}

// Returns whether an item is better drawn by many threads: thick items, solids, large triangles.
__device__ inline bool IsHeavy(const TableEntry& entry, uint32_t item, const Box3& box) {
  switch (entry.record.kind) {
    case PrimitiveKind::kPoints:
    case PrimitiveKind::kSegments:
      return entry.source.radius > 0;
    case PrimitiveKind::kTriangles: {
      if (entry.source.radius > 0) return true;
      const Box3 part = Intersect(box, BoundsOfTriangle(entry, item));
      constexpr int32_t kSmall = 128;  // voxels
      return (part.hi[0] - part.lo[0]) * (part.hi[1] - part.lo[1]) * (part.hi[2] - part.lo[2]) >
             kSmall;
    }
    default:
      return true;
  }
}

// Returns whether the kind is drawn by the whole block rather than by a warp.
__device__ inline bool IsForBlock(PrimitiveKind kind) {
  return IsSolid(kind) || kind == PrimitiveKind::kImplicit || kind == PrimitiveKind::kSamples ||
         kind == PrimitiveKind::kFilled;
}

// Raises the voxels that the CPU has drawn for a tile, by a warp. Voxels are identified by their
// places in the tile.
__device__ inline void RaiseDrawn(const CpuVoxelsView& drawn, uint32_t item, const Box3& box,
                                  const TileGrid& grid, uint32_t* words) {
  constexpr uint32_t kMask = kTileSize - 1;
  for (uint64_t v = drawn.begin[item] + threadIdx.x % 32; v < drawn.begin[item + 1]; v += 32) {
    const uint64_t voxel = drawn.voxels[v];
    const uint32_t place = static_cast<uint32_t>(voxel >> 32);
    atomicMax(
        &words[IndexInRegion(box.lo[0] + static_cast<int32_t>(place >> grid.shift[0] & kMask),
                             box.lo[1] + static_cast<int32_t>(place >> grid.shift[1] & kMask),
                             box.lo[2] + static_cast<int32_t>(place >> grid.shift[2] & kMask))],
        static_cast<uint32_t>(voxel));
  }
}

// Draws any other heavy item, by a warp: each lane draws it in boxes of its own.
__device__ inline void DrawByWarp(const TableEntry& entry, uint32_t item, const Box3& box,
                                  const TileGrid& grid, uint32_t* words) {
  if (entry.record.kind == kDrawnByCpu) return RaiseDrawn(entry.drawn, item, box, grid, words);
  constexpr int32_t kBlock = 4;
  constexpr uint32_t kBlocks = kTileSize / kBlock;
  for (uint32_t b = threadIdx.x % 32; b < kBlocks * kBlocks * kBlocks; b += 32) {
    const int32_t at[3] = {static_cast<int32_t>(b % kBlocks),
                           static_cast<int32_t>(b / kBlocks % kBlocks),
                           static_cast<int32_t>(b / kBlocks / kBlocks)};
    Box3 part;
    for (int a = 0; a < 3; ++a) {
      part.lo[a] = box.lo[a] + at[a] * kBlock;
      part.hi[a] = Min(box.hi[a], part.lo[a] + kBlock);
    }
    if (IsEmpty(part)) continue;
    switch (entry.record.kind) {
      case PrimitiveKind::kPoints:
        DrawItem<Points>(entry, item, part);
        break;
      case PrimitiveKind::kSegments:
        DrawItem<Segments>(entry, item, part);
        break;
      default:
        DrawItem<Triangles>(entry, item, part);
        break;
    }
  }
}

// A solid is drawn once in a region: with its first tile there. owned: PairRows::owned.
__device__ inline bool IsFirstTile(const Solid& s, const Box3& tile, uint32_t owned) {
  uint32_t halves[2], place = 0;  // place: of the region along x and y: bits
  for (int a = 0; a < 2; ++a) {
    const int32_t middle = (tile.lo[a] & -(2 * kTileSize)) + kTileSize;
    halves[a] = (s.bounds.lo[a] < middle ? 1 : 0) | (s.bounds.hi[a] > middle ? 2 : 0);
    if (tile.lo[a] == middle) place |= 1u << a;
  }
  const uint32_t touched =
      ((halves[1] & 1) != 0 ? halves[0] : 0) | ((halves[1] & 2) != 0 ? halves[0] << 2 : 0);
  return (touched & owned & ((1u << place) - 1)) == 0;
}

// Draws the listed small solids, each by a warp: a warp that is done takes the next. Called by the
// whole block.
static __device__ __noinline__ void DrawSmallSolids(const TableEntry* table, const TileGrid& grid) {
  PairScratch& scratch = SharedBehind<PairScratch>();
  const uint32_t count = scratch.small_count, warp = threadIdx.x / 32;
  const Box3 region = RegionAround(grid, scratch.tiles[kDrawThreads - 1]);
  for (;;) {
    uint32_t i = 0;
    if (threadIdx.x % 32 == 0) i = atomicAdd(&scratch.small_taken, 1u);
    i = __shfl_sync(kAllLanes, i, 0);
    if (i >= count) break;
    DrawSmallSolid(table[scratch.heavy[kDrawThreads - 1 - i] >> 32], region, SharedRegion().words,
                   scratch.small_solids.columns[warp]);
  }
}

// Returns whether an earlier pair in the list is of the same drawable. Called by the whole block.
__device__ inline bool IsListedBefore(const PairScratch& scratch, uint32_t i) {
  return __syncthreads_or(threadIdx.x < i &&
                          scratch.heavy[threadIdx.x] >> 32 == scratch.heavy[i] >> 32) != 0;
}

// Draws all listed pairs and clears the list. Called by the whole block, after a barrier. Not
// inlined: it holds the code of all solids, and is called from four places.
static __device__ __noinline__ void DrawHeavy(const TableEntry* table, const TileGrid& grid) {
  PairScratch& scratch = SharedBehind<PairScratch>();
  uint32_t* const words = SharedRegion().words;
  const uint32_t count = scratch.heavy_count;
  if (scratch.small_count != 0) DrawSmallSolids(table, grid);
  // Several solids are drawn at once; a single one is drawn by all threads.
  constexpr uint32_t kSeveral = 3;
  const bool several = count >= kSeveral;
  for (uint32_t i = threadIdx.x / 32; i < count; i += kDrawWarps) {
    const TableEntry& entry = table[scratch.heavy[i] >> 32];
    const Box3 box = grid.VoxelsOf(scratch.tiles[i]);
    if (several && IsSolid(entry.record.kind)) {
      DrawSolidByWarp(entry, box, words);
    } else if (!IsForBlock(entry.record.kind)) {
      DrawByWarp(entry, static_cast<uint32_t>(scratch.heavy[i]), box, grid, words);
    }
  }
  __syncthreads();
  for (uint32_t i = 0; i < count; ++i) {
    const TableEntry& entry = table[scratch.heavy[i] >> 32];
    if (several && IsSolid(entry.record.kind)) continue;
    const Box3 box = grid.VoxelsOf(scratch.tiles[i]);
    switch (entry.record.kind) {
      case PrimitiveKind::kBox:
        DrawSolid<Box>(entry, box, words, scratch.solid);
        break;
      case PrimitiveKind::kSphere:
        DrawSolid<Sphere>(entry, box, words, scratch.solid);
        break;
      case PrimitiveKind::kCylinder:
        DrawSolid<Cylinder>(entry, box, words, scratch.solid);
        break;
      case PrimitiveKind::kImplicit: {
        const uint32_t item = static_cast<uint32_t>(scratch.heavy[i]);
        if (entry.source.implicit.rows != nullptr) {
          if (!IsListedBefore(scratch, i)) {
            DrawCovered(entry, RegionAround(grid, scratch.tiles[i]));
          }
        } else {
          DrawImplicit(entry, item, box, words, scratch.implicit);
        }
        break;
      }
      case PrimitiveKind::kSamples:
        DrawSamples(entry, box);
        break;
      case PrimitiveKind::kFilled:
        // Draws the whole part in the region at once, unless it has to test all triangles.
        if (entry.source.inside == nullptr) {
          DrawFilled(entry, box);
        } else if (!IsListedBefore(scratch, i)) {
          DrawFilled(entry, RegionAround(grid, scratch.tiles[i]));
        }
        break;
      default:
        break;
    }
  }
  __syncthreads();
  if (threadIdx.x == 0) scratch.heavy_count = scratch.small_count = scratch.small_taken = 0;
  __syncthreads();
}

// Returns whether an item may have voxels in a tile.
__device__ inline bool MayTouch(const TableEntry& entry, uint32_t item, uint32_t tile,
                                const Box3& box) {
  Box3 bounds;
  switch (entry.record.kind) {
    case kDrawnByCpu:
      return entry.drawn.tiles[item] == tile;
    case PrimitiveKind::kPoints:
      bounds = BoundsOf(Points::ItemOf(entry.source, item), entry.source.radius);
      break;
    case PrimitiveKind::kSegments:
      bounds = BoundsOf(Segments::ItemOf(entry.source, item), entry.source.radius);
      break;
    case PrimitiveKind::kTriangles:
      bounds = BoundsOfTriangle(entry, item);
      break;
    case PrimitiveKind::kImplicit:
    case PrimitiveKind::kSamples:
    case PrimitiveKind::kFilled:
      bounds = BlockOf(entry.source, item);
      break;
    default:
      bounds = entry.source.solid.bounds;
      break;
  }
  return !IsEmpty(Intersect(box, bounds));
}

// Computes the value of a pair; returns whether item `i` of the unlisted items is of that layer,
// and may have voxels in the tile.
__device__ inline bool FindUnlisted(const DrawView& view, uint64_t i, uint32_t layer, uint32_t tile,
                                    const Box3& box, uint64_t& value) {
  const uint32_t d = DrawableOf(view.unlisted, i);
  const uint32_t slot = view.unlisted.slot(d);
  const TableEntry& entry = view.table[slot];
  if (entry.layer != layer) return false;
  const uint32_t item = static_cast<uint32_t>(i - view.unlisted.first(d));
  value = PairValue(slot, item);
  return MayTouch(entry, item, tile, box);
}

// Draws a pair's voxels; returns true if it was listed instead, to be drawn by many threads. owned:
// PairRows::owned.
__device__ inline bool DrawLight(const DrawView& view, uint64_t value, uint32_t tile,
                                 uint32_t owned, PairScratch& scratch) {
  const Box3 box = view.volume.grid.VoxelsOf(tile);
  const TableEntry& entry = view.table[value >> 32];
  const uint32_t item = static_cast<uint32_t>(value);
  if (entry.alive != 0 && IsSolid(entry.record.kind) && SmallSolids::Has(entry.source.solid)) {
    if (!IsFirstTile(entry.source.solid, box, owned)) return false;
    const uint32_t at = kDrawThreads - 1 - atomicAdd(&scratch.small_count, 1u);
    scratch.heavy[at] = value;
    scratch.tiles[at] = tile;
    return true;
  }
  const bool heavy = entry.alive != 0 && IsHeavy(entry, item, box);
  if (entry.alive == 0) {
  } else if (heavy) {
    const uint32_t at = atomicAdd(&scratch.heavy_count, 1u);
    scratch.heavy[at] = value;
    scratch.tiles[at] = tile;
  } else if (entry.record.kind == PrimitiveKind::kPoints) {
    DrawItem<Points>(entry, item, box);
  } else if (entry.record.kind == PrimitiveKind::kSegments) {
    DrawItem<Segments>(entry, item, box);
  } else {
    DrawItem<Triangles>(entry, item, box);
  }
  return heavy;
}

// Draws the layer's pairs of all tiles, by the whole block. Heavy items are listed: they are drawn
// together, at the end, or when the list might overflow.
__device__ inline void DrawPairs(const DrawView& view, const PairRows& rows, PairScratch& scratch) {
  const TileGrid& grid = view.volume.grid;
  for (uint32_t b = 0; b < view.pairs.count; ++b) {
    uint32_t until[kRegionTiles];  // pairs of the tiles up to each one
    for (uint32_t t = 0, sum = 0; t < kRegionTiles; ++t) {
      until[t] = sum += rows.end[t][b] - rows.begin[t][b];
    }
    const uint32_t end = until[kRegionTiles - 1];
    // All threads have the same result; they vote because they call functions (DrawRegionsKernel).
    // The votes are also barriers between the listing of items and the threads that count them.
    for (uint32_t round = 0; __syncthreads_or(round < end) != 0; round += kDrawThreads) {
      const bool full = scratch.listed() + Min(end - round, kDrawThreads) > kDrawThreads;
      if (__syncthreads_or(full) != 0) DrawHeavy(view.table, grid);
      const uint32_t p = round + threadIdx.x;
      if (p < end) {
        uint32_t t = 0, before = 0;
        for (uint32_t u = 0; u + 1 < kRegionTiles; ++u) {
          if (p >= until[u]) t = u + 1, before = until[u];
        }
        const uint64_t value = view.pairs.batches[b].values[rows.begin[t][b] + (p - before)];
        DrawLight(view, value, rows.tile[t], rows.owned, scratch);
      }
    }
  }
}

// Draws the layer's unlisted items in one tile, by the whole block. It is rare and in a function of
// its own, so that pairs are drawn as they would be without it; its loop ends by vote, as required
// around calls.
static __device__ __noinline__ void DrawUnlisted(const DrawView& view, uint32_t tile,
                                                 uint32_t owned, RegionScratch& region,
                                                 PairScratch& scratch) {
  const TileGrid& grid = view.volume.grid;
  const Box3 box = grid.VoxelsOf(tile);
  if (scratch.listed() != 0) DrawHeavy(view.table, grid);
  for (uint64_t i = threadIdx.x; __syncthreads_or(i < view.unlisted.items) != 0;
       i += kDrawThreads) {
    bool heavy = false;
    uint64_t value;
    if (i < view.unlisted.items && FindUnlisted(view, i, region.layer, tile, box, value)) {
      heavy = DrawLight(view, value, tile, owned, scratch);
    }
    if (__syncthreads_or(heavy ? 1 : 0) != 0) {
      DrawHeavy(view.table, grid);
    }
  }
}

}  // namespace voxeld::gpu::cuda
