// A region being drawn, in shared memory: the words of the current layer.
#pragma once

#include "gpu/assemble/blend.h"
#include "gpu/cuda/draw_types.h"
#include "gpu/cuda/warp-inl.h"
#include "gpu/word.h"

namespace voxeld::gpu::cuda {

inline constexpr uint32_t kDrawThreads = 512;
inline constexpr uint32_t kDrawWarps = kDrawThreads / 32;
inline constexpr uint32_t kSpansOfLane = 3;  // that a warp sorts at once
inline constexpr uint32_t kSpansOfWarp = 32 * kSpansOfLane;
inline constexpr uint32_t kMostSpans = kDrawWarps * kSpansOfWarp;
inline constexpr uint32_t kSegments = 256;   // of a region's spans, that are handled at once
inline constexpr uint32_t kRegionTiles = 4;  // bit 0: the farther in x, bit 1: in y

// Returns the index of a voxel in a region: x fastest, then y.
__device__ inline uint32_t IndexInRegion(int32_t x, int32_t y, int32_t z) {
  return static_cast<uint32_t>(z & 15) << 10 | static_cast<uint32_t>(y & 31) << 5 |
         static_cast<uint32_t>(x & 31);
}

// The next step for the current layer.
enum class DrawStep : uint32_t {
  kNone,   // no layer is left
  kSkip,   // nothing: it has nothing visible here
  kMask,   // the voxels that it covers are the mask of the next layer
  kLayer,  // it is blended, within its mask
};

// The layer to find: the visible one of the least rank beyond `last`, or one by its slot.
struct LayerWanted {
  int32_t last = -1;
  uint32_t slot = kAllLanes;  // kAllLanes: any

  __device__ bool Is(uint32_t layer, const LayerLook& look) const {
    return slot == kAllLanes ? look.seen != 0 && look.rank > last : layer == slot;
  }
};

struct RegionScratch {
  // All 0 when the drawing of a region begins: the function that writes it out resets them.
  alignas(16) uint32_t words[kRegionVoxels];
  uint32_t line_batches, point_batches, triangle_batches;  // bits: those of the current layer
  uint32_t layer;                                          // its slot; kAllLanes: none is left
  uint32_t cutting;                // bits: which of its half-spaces cut the region
  uint32_t outside;                // not 0: the whole region lies outside one of them
  uint32_t region;                 // kAllLanes: none is left
  uint32_t place;                  // in the list, of the next region
  alignas(16) uint32_t least[64];  // PackedView::least of the first sub-frame
  uint32_t lit[kRegionTiles], differs[kRegionTiles];
  unsigned long long lit_change;  // of all regions that the block has drawn
  uint32_t pairs;                 // not 0: the layer has some here, or unlisted items
  DrawStep step;
  LayerWanted wanted;
  uint32_t under;  // the layer whose mask is to be found; kAllLanes: none
};

// Scratch memory for drawing lines.
struct SpanScratch {
  LineSpan spans[kMostSpans];        // a part for each warp
  uint32_t buckets[kDrawWarps][32];  // of its spans by length
  // Segments of spans: how many spans lie before each, and the number that has to be added to a
  // span's number to find it.
  uint32_t segment_first[kSegments], segment_from[kSegments];
  uint32_t segments, spans_found;
};

// Scratch memory for drawing points: rows of records that are too many for a thread.
struct PointScratch {
  const PlacedPoint* from[kDrawThreads];
  uint32_t count[kDrawThreads];
  uint32_t segments;
};

// The region that a block of threads draws comes first in its shared memory; the scratch memory for
// drawing follows.
__device__ inline unsigned char* SharedMemory() {
  extern __shared__ __align__(16) unsigned char shared_memory[];
  return shared_memory;
}
__device__ inline RegionScratch& SharedRegion() {
  return *reinterpret_cast<RegionScratch*>(SharedMemory());
}
// The memory after the region. Functions that are not inlined get their scratch memory here, so
// that the compiler knows that it is shared memory.
template <class Scratch>
__device__ inline Scratch& SharedBehind() {
  static_assert(sizeof(RegionScratch) % 16 == 0);
  return *reinterpret_cast<Scratch*>(SharedMemory() + sizeof(RegionScratch));
}
// Returns the word of a colour, where `word` is that of another colour.
__device__ inline uint32_t Recolored(uint32_t word, uint32_t rgb) {
  return (word & ~kColorMask) | Interleave(rgb);
}

// Raises an item's voxels into the region's words. It is one type for all primitives, so that they
// share code such as that of lines; and it holds its state itself, so that the state stays in
// registers where a function has a copy.
class RaiseVoxel {
 public:
  // word: of colour 0; if not `recolor`, of every colour.
  __device__ RaiseVoxel(uint32_t word, bool recolor) : word_(word), recolor_(recolor) {}
  __device__ void operator()(int32_t x, int32_t y, int32_t z, uint32_t rgb) {
    if (recolor_ && rgb != rgb_) {
      rgb_ = rgb;
      word_ = Recolored(word_, rgb);
    }
    atomicMax(&SharedRegion().words[IndexInRegion(x, y, z)], word_);
  }

 private:
  uint32_t word_, rgb_ = 0;  // of the previous voxel
  bool recolor_;
};

__device__ inline SpanScratch& SharedSpans() { return SharedBehind<SpanScratch>(); }

__device__ inline PointScratch& SharedPoints() {
  return *reinterpret_cast<PointScratch*>(SharedMemory() + sizeof(RegionScratch));
}

// For the current layer: rows of pairs, one for each tile and batch.
struct PairRows {
  uint32_t begin[kRegionTiles][kMaxBatches], end[kRegionTiles][kMaxBatches];
  uint32_t tile[kRegionTiles];  // their numbers; kAllLanes: not owned
  uint32_t owned;               // bits: the owned ones
};

// The place of a region: the numbers of its tiles, kAllLanes for those that do not exist or are not
// owned.
struct RegionPlace {
  Box3 box;  // its voxels in the volume
  int32_t tile[3];

  // Computes the place of the current region. It is computed where needed rather than stored while
  // the region is drawn.
  __device__ RegionPlace(const DrawView& view, const RegionScratch& scratch) {
    const uint32_t region = *static_cast<const volatile uint32_t*>(&scratch.region);
    int32_t at[3];
    view.regions.RegionCoordinates(region, at);
    for (int a = 0; a < 3; ++a) {
      box.lo[a] = at[a] << RegionBits(a);
      box.hi[a] = Min(view.volume.grid.voxels[a], (at[a] + 1) << RegionBits(a));
      tile[a] = box.lo[a] / kTileSize;
    }
  }
  __device__ uint32_t TileOf(const VolumeView& volume, uint32_t t) const {
    const int32_t i = tile[0] + static_cast<int32_t>(t & 1),
                  j = tile[1] + static_cast<int32_t>(t >> 1);
    const TileGrid& grid = volume.grid;
    if (i >= grid.tiles[0] || j >= grid.tiles[1] || tile[2] >= grid.tiles[2]) return kAllLanes;
    const uint32_t index = grid.Index(i, j, tile[2]);
    return volume.owned[index] != 0 ? index : kAllLanes;
  }
};

__device__ inline uint32_t LayerOf(uint64_t key) {
  return static_cast<uint32_t>(key) & (kMaxLayers - 1);
}

// Finds the pairs of a tile, in a batch, that belong to the wanted layer of the least rank.
__device__ inline void FindPairs(const DrawView& view, const BatchView& batch, uint32_t tile,
                                 const LayerWanted& wanted, int32_t& best, uint32_t& begin,
                                 uint32_t& end, int32_t& least, uint32_t& layer) {
  const uint32_t stop = batch.row_begin[tile + 1];
  for (uint32_t p = batch.row_begin[tile]; p < stop;) {
    const uint32_t here = LayerOf(batch.keys[p]);
    uint32_t low = p + 1, high = stop;  // the first pair of a later layer
    if (LayerOf(batch.keys[stop - 1]) == here) low = stop;
    while (low < high) {
      const uint32_t middle = low + (high - low) / 2;
      if (LayerOf(batch.keys[middle]) <= here) {
        low = middle + 1;
      } else {
        high = middle;
      }
    }
    const LayerLook look = view.layers[here];
    if (wanted.Is(here, look) && look.rank < best) {
      best = look.rank;
      begin = p;
      end = low;
      if (look.rank < least) {
        least = look.rank;
        layer = here;
      }
    }
    p = low;
  }
}

// Finds the wanted layer of the least rank that has something in the region, and its items. Called
// by the first warp: a lane handles a batch; for pairs, a tile's part of some batches. kAll: there
// may be pairs, and items without lists.
template <bool kAll>
__device__ int32_t NextLayer(const DrawView& view, const RegionPlace& place,
                             const LayerWanted& wanted, RegionScratch& scratch, PairRows* rows) {
  const uint32_t lane = threadIdx.x % 32;
  constexpr int32_t kNone = 0x7FFFFFFF;
  int32_t least = kNone;
  uint32_t layer = kAllLanes;
  constexpr uint32_t kAtOnce = 32 / kRegionTiles, kTurns = kMaxBatches / kAtOnce;
  [[maybe_unused]] const uint32_t t = lane % kRegionTiles;
  int32_t best[kTurns];
  uint32_t begin[kTurns] = {}, end[kTurns] = {};
  for (int32_t& rank : best) rank = kNone;
  if constexpr (kAll) {
    const uint32_t tile = place.TileOf(view.volume, t);
    const uint32_t owned = __ballot_sync(kAllLanes, tile != kAllLanes);
    if (lane < kRegionTiles) rows->tile[lane] = tile;
    if (lane == 0) rows->owned = owned & ((1u << kRegionTiles) - 1);
    for (uint32_t r = 0; r < kTurns; ++r) {
      const uint32_t b = r * kAtOnce + lane / kRegionTiles;
      if (b < view.pairs.count && tile != kAllLanes) {
        FindPairs(view, view.pairs.batches[b], tile, wanted, best[r], begin[r], end[r], least,
                  layer);
      }
    }
  }
  int32_t unlisted_rank = kNone;
  if constexpr (kAll) {
    for (uint32_t i = lane; i < view.unlisted.layer_count; i += 32) {
      const uint32_t slot = view.unlisted.layers[i];
      const LayerLook look = view.layers[slot];
      if (!wanted.Is(slot, look) || look.rank >= unlisted_rank) continue;
      unlisted_rank = look.rank;
      if (look.rank < least) {
        least = look.rank;
        layer = slot;
      }
    }
  }
  const auto rank_here = [&](const auto& batches) {
    if (lane >= batches.count || !batches.batches[lane].template Has<!kAll>(scratch.region))
      return kNone;
    const uint32_t slot = batches.batches[lane].layer;
    const LayerLook look = view.layers[slot];
    if (!wanted.Is(slot, look)) return kNone;
    if (look.rank < least) {
      least = look.rank;
      layer = slot;
    }
    return look.rank;
  };
  const int32_t line_rank = rank_here(view.lines), point_rank = rank_here(view.points),
                triangle_rank = rank_here(view.triangles);
  const int32_t mine = least;
  for (int lanes = 16; lanes > 0; lanes /= 2) {
    least = Min(least, __shfl_xor_sync(kAllLanes, least, lanes));
  }
  bool pairs = false;
  if constexpr (kAll) {
    for (uint32_t r = 0; r < kTurns; ++r) {
      const uint32_t b = r * kAtOnce + lane / kRegionTiles;
      const bool here = best[r] == least && least != kNone;
      rows->begin[t][b] = here ? begin[r] : 0;
      rows->end[t][b] = here ? end[r] : 0;
      pairs |= here;
    }
    pairs |= unlisted_rank == least && least != kNone;
  }
  const uint32_t any_pairs = __ballot_sync(kAllLanes, pairs);
  const uint32_t lines = __ballot_sync(kAllLanes, line_rank == least && least != kNone);
  const uint32_t points = __ballot_sync(kAllLanes, point_rank == least && least != kNone);
  const uint32_t triangles = __ballot_sync(kAllLanes, triangle_rank == least && least != kNone);
  if (lane == 0) {
    scratch.layer = kAllLanes;
    scratch.pairs = any_pairs;
    scratch.line_batches = lines;
    scratch.point_batches = points;
    scratch.triangle_batches = triangles;
  }
  __syncwarp();
  // The layer is the same in all lanes that have it.
  const uint32_t having = __ballot_sync(kAllLanes, mine == least && least != kNone);
  if (having != 0 && lane == static_cast<uint32_t>(__ffs(static_cast<int>(having))) - 1) {
    scratch.layer = layer;
  }
  return least;
}

// Computes on which side of its clips the region lies, for the layer found. Called by the first
// warp: a lane handles a half-space, the last lanes handle cylinders.
constexpr uint32_t kFirstCylinder = 32 - kMaxClipCylinders;
static_assert(kMaxHalfSpaces <= kFirstCylinder);
__device__ inline void ClipRegion(const DrawView& view, const Box3& box, RegionScratch& scratch) {
  const uint32_t lane = threadIdx.x % 32;
  ClipSide side = ClipSide::kInside;
  __syncwarp();
  if (scratch.layer != kAllLanes) {
    const LayerLook& look = view.layers[scratch.layer];
    if (lane < look.half_spaces) side = SideOf(view.half_spaces[look.first_half_space + lane], box);
    const uint32_t cylinder = lane - kFirstCylinder;  // in other lanes greater than any count
    if (cylinder < look.cylinders) {
      side = SideOf(view.cylinders[look.first_cylinder + cylinder], box);
    }
  }
  const uint32_t cutting = __ballot_sync(kAllLanes, side == ClipSide::kCut);
  const uint32_t outside = __ballot_sync(kAllLanes, side == ClipSide::kOutside);
  if (lane == 0) {
    scratch.cutting = cutting;
    scratch.outside = outside;
  }
}

// The clips of the found layer that cut the region: the bits of ClipRegion.
struct CutBy {
  const VoxelHalfSpace* half_spaces = nullptr;
  const VoxelCylinder* cylinders = nullptr;
  uint32_t cutting = 0;

  __device__ static CutBy Of(const DrawView& view, const LayerLook& look, uint32_t cutting) {
    return {view.half_spaces + look.first_half_space, view.cylinders + look.first_cylinder,
            cutting};
  }
  // Returns whether a voxel of the region (given by its index) lies inside all of them.
  __device__ bool Keeps(const Box3& box, uint32_t v) const {
    const int32_t x = box.lo[0] + static_cast<int32_t>(v & 31),
                  y = box.lo[1] + static_cast<int32_t>(v >> 5 & 31),
                  z = box.lo[2] + static_cast<int32_t>(v >> 10);
    for (uint32_t left = cutting; left != 0; left &= left - 1) {
      const uint32_t i = static_cast<uint32_t>(__ffs(static_cast<int>(left))) - 1;
      const bool inside = i < kFirstCylinder ? IsInside(half_spaces[i], x, y, z)
                                             : IsInside(cylinders[i - kFirstCylinder], x, y, z);
      if (!inside) return false;
    }
    return true;
  }
};

}  // namespace voxeld::gpu::cuda
