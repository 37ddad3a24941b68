// The voxels of dirty tiles: a block of threads draws a tile in shared memory, layer by layer, and
// writes it out once.
#include "gpu/assemble/blend.h"
#include "gpu/cuda/kernels.h"
#include "gpu/primitives/list.h"

namespace voxeld::gpu::cuda {
namespace {

constexpr uint32_t kThreads = 256;
constexpr uint32_t kWarps = kThreads / 32;
constexpr uint32_t kMostHeavy = 256;
constexpr uint32_t kAll = 0xFFFFFFFFu;

struct TileScratch {
  uint32_t words[kTileVoxels];
  uint32_t colors[kTileVoxels];
  uint32_t row_begin[kMaxBatches], row_end[kMaxBatches];  // of the layer under way
  uint64_t heavy[kMostHeavy];                             // pairs for many threads
  uint32_t heavy_count;
  uint32_t tile;
  uint32_t layer;    // its slot; kAll: no more
  uint32_t cutting;  // bits: which of its half-spaces cut the tile
  uint32_t outside;  // not 0: all of the tile lies outside one of them
  uint32_t lit, differs;
  SolidBlock solid;
};

// A pair's voxels in `box`, raised into the tile's words.
template <class Primitive>
__device__ void DrawItem(const TableEntry& entry, uint32_t item, const Box3& box,
                         const TileGrid& grid, uint32_t* words) {
  const uint32_t priority = entry.priority;
  const bool erase = entry.erase != 0;
  uint32_t rgb_before = 0;
  uint32_t word = MakeWord(priority, erase, rgb_before);
  Primitive::EmitVoxels(entry.source, item, box,
                        [&](int32_t x, int32_t y, int32_t z, uint32_t rgb) {
                          if (rgb != rgb_before) {
                            rgb_before = rgb;
                            word = MakeWord(priority, erase, rgb);
                          }
                          atomicMax(&words[grid.IndexInTile(x, y, z)], word);
                        });
}

// Whether an item is better drawn by many threads: thick ones, solids, large triangles.
__device__ bool IsHeavy(const TableEntry& entry, uint32_t item, const Box3& box) {
  switch (entry.record.kind) {
    case PrimitiveKind::kPoints:
    case PrimitiveKind::kSegments:
      return entry.source.radius > 0;
    case PrimitiveKind::kTriangles: {
      const Box3 part = Intersect(box, BoundsOf(Triangles::ItemOf(entry.source, item)));
      constexpr int32_t kSmall = 128;  // voxels
      return (part.hi[0] - part.lo[0]) * (part.hi[1] - part.lo[1]) * (part.hi[2] - part.lo[2]) >
             kSmall;
    }
    default:
      return true;
  }
}

__device__ bool IsSolid(PrimitiveKind kind) {
  return kind == PrimitiveKind::kBox || kind == PrimitiveKind::kSphere ||
         kind == PrimitiveKind::kCylinder;
}

// A solid in a tile, by the whole block: rows of what is inside, with a rim, then what is seen of
// them.
template <class Shape>
__device__ void DrawSolid(const TableEntry& entry, const Box3& box, const TileGrid& grid,
                          TileScratch& scratch) {
  const Solid& s = entry.source.solid;
  const Box3 part = Intersect(box, s.bounds);
  const uint32_t word = MakeWord(entry.priority, entry.erase != 0, entry.record.color & 0x00FFFFFF);
  if (threadIdx.x == 0 && Contains(box, s.origin[0], s.origin[1], s.origin[2]) &&
      !IsInside<Shape>(s, s.origin[0], s.origin[1], s.origin[2])) {
    atomicMax(&scratch.words[grid.IndexInTile(static_cast<int32_t>(s.origin[0]),
                                              static_cast<int32_t>(s.origin[1]),
                                              static_cast<int32_t>(s.origin[2]))],
              word);
  }
  if (IsEmpty(part)) return;  // the same for every thread
  int64_t lo[3], hi[3];
  for (int a = 0; a < 3; ++a) {
    lo[a] = static_cast<int64_t>(part.lo[a]) - 1;
    hi[a] = static_cast<int64_t>(part.hi[a]) + 1;
  }
  const int32_t rows_y = static_cast<int32_t>(hi[1] - lo[1]);
  const int32_t rows = rows_y * static_cast<int32_t>(hi[2] - lo[2]);
  for (int32_t i = static_cast<int32_t>(threadIdx.x); i < rows; i += kThreads) {
    scratch.solid.FillRow<Shape>(s, lo, hi, lo[1] + i % rows_y, lo[2] + i / rows_y);
  }
  __syncthreads();
  const int32_t inner_y = part.hi[1] - part.lo[1];
  const int32_t inner = inner_y * (part.hi[2] - part.lo[2]);
  for (int32_t i = static_cast<int32_t>(threadIdx.x); i < inner; i += kThreads) {
    const int32_t y = i % inner_y, z = i / inner_y;
    uint32_t row = scratch.solid.bits[z + 1][y + 1];
    if (row != 0 && entry.record.fill == Fill::kSurface) {
      row &= ~scratch.solid.Enclosed(y + 1, z + 1, entry.record.rule);
    }
    for (int32_t x = part.lo[0]; x < part.hi[0]; ++x) {
      if ((row >> (x - part.lo[0] + 1)) & 1u) {
        atomicMax(&scratch.words[grid.IndexInTile(x, part.lo[1] + y, part.lo[2] + z)], word);
      }
    }
  }
  __syncthreads();
}

// What the CPU has drawn, by a warp.
__device__ void RaiseDrawn(const CpuVoxelsView& drawn, uint32_t item, TileScratch& scratch) {
  for (uint64_t v = drawn.begin[item] + threadIdx.x % 32; v < drawn.begin[item + 1]; v += 32) {
    const uint64_t voxel = drawn.voxels[v];
    atomicMax(&scratch.words[voxel >> 32], static_cast<uint32_t>(voxel));
  }
}

// Every other heavy item, by a warp: each lane draws it in boxes of its own.
__device__ void DrawByWarp(const TableEntry& entry, uint32_t item, const Box3& box,
                           const TileGrid& grid, TileScratch& scratch) {
  if (entry.record.kind == kDrawnByCpu) return RaiseDrawn(entry.drawn, item, scratch);
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
        DrawItem<Points>(entry, item, part, grid, scratch.words);
        break;
      case PrimitiveKind::kSegments:
        DrawItem<Segments>(entry, item, part, grid, scratch.words);
        break;
      default:
        DrawItem<Triangles>(entry, item, part, grid, scratch.words);
        break;
    }
  }
}

__device__ void DrawHeavy(const TableEntry* table, const Box3& box, const TileGrid& grid,
                          TileScratch& scratch) {
  const uint32_t count = scratch.heavy_count;
  for (uint32_t i = threadIdx.x / 32; i < count; i += kWarps) {
    const TableEntry& entry = table[scratch.heavy[i] >> 32];
    if (!IsSolid(entry.record.kind)) {
      DrawByWarp(entry, static_cast<uint32_t>(scratch.heavy[i]), box, grid, scratch);
    }
  }
  __syncthreads();
  for (uint32_t i = 0; i < count; ++i) {
    const TableEntry& entry = table[scratch.heavy[i] >> 32];
    switch (entry.record.kind) {
      case PrimitiveKind::kBox:
        DrawSolid<Box>(entry, box, grid, scratch);
        break;
      case PrimitiveKind::kSphere:
        DrawSolid<Sphere>(entry, box, grid, scratch);
        break;
      case PrimitiveKind::kCylinder:
        DrawSolid<Cylinder>(entry, box, grid, scratch);
        break;
      default:
        break;
    }
  }
  __syncthreads();
}

__device__ uint32_t LayerOf(uint64_t key) { return static_cast<uint32_t>(key) & (kMaxLayers - 1); }

// The layer of the least rank beyond `last` that has pairs in the tile, and where they are. By the
// first warp: a lane looks after a batch.
__device__ int32_t NextLayer(const LayerLook* layers, const BatchList& batches, uint32_t tile,
                             int32_t last, TileScratch& scratch) {
  const uint32_t lane = threadIdx.x % 32;
  constexpr int32_t kNone = 0x7FFFFFFF;
  int32_t best = kNone;
  uint32_t best_begin = 0, best_end = 0, best_layer = kAll;
  if (lane < batches.count) {
    const BatchView& batch = batches.batches[lane];
    const uint32_t end = batch.row_begin[tile + 1];
    for (uint32_t p = batch.row_begin[tile]; p < end;) {
      const uint32_t layer = LayerOf(batch.keys[p]);
      uint32_t low = p + 1, high = end;  // the first pair of a later layer
      if (LayerOf(batch.keys[end - 1]) == layer) low = end;
      while (low < high) {
        const uint32_t middle = low + (high - low) / 2;
        if (LayerOf(batch.keys[middle]) <= layer) {
          low = middle + 1;
        } else {
          high = middle;
        }
      }
      const LayerLook look = layers[layer];
      if (look.visible != 0 && look.rank > last && look.rank < best) {
        best = look.rank;
        best_begin = p;
        best_end = low;
        best_layer = layer;
      }
      p = low;
    }
  }
  int32_t least = best;
  for (int offset = 16; offset > 0; offset /= 2) {
    least = Min(least, __shfl_xor_sync(kAll, least, offset));
  }
  const bool mine = best == least && least != kNone;
  scratch.row_begin[lane] = mine ? best_begin : 0;
  scratch.row_end[lane] = mine ? best_end : 0;
  if (lane == 0) scratch.layer = kAll;
  __syncwarp();
  if (mine) scratch.layer = best_layer;  // the same in all that have it
  return least;
}

// How the layer found lies to the tile. By the first warp: a lane looks after a half-space.
static_assert(kMaxHalfSpaces <= 32);
__device__ void ClipTile(const LayerLook* layers, const VoxelHalfSpace* half_spaces,
                         const Box3& box, TileScratch& scratch) {
  const uint32_t lane = threadIdx.x % 32;
  ClipSide side = ClipSide::kInside;
  __syncwarp();
  if (scratch.layer != kAll) {
    const LayerLook& look = layers[scratch.layer];
    if (lane < look.half_spaces) side = SideOf(half_spaces[look.first_half_space + lane], box);
  }
  const uint32_t cutting = __ballot_sync(kAll, side == ClipSide::kCut);
  const uint32_t outside = __ballot_sync(kAll, side == ClipSide::kOutside);
  if (lane == 0) {
    scratch.cutting = cutting;
    scratch.outside = outside;
  }
}

// Whether a voxel of the tile lies inside all half-spaces that cut it. `v`: its place in memory.
__device__ bool IsInsideAll(const VoxelHalfSpace* half_spaces, uint32_t cutting, const Box3& box,
                            const TileGrid& grid, uint32_t v) {
  int64_t at[3];
  for (int a = 0; a < 3; ++a) {
    at[a] = box.lo[a] + static_cast<int32_t>((v >> grid.shift[a]) % kTileSize);
  }
  for (; cutting != 0; cutting &= cutting - 1) {
    if (!IsInside(half_spaces[__ffs(static_cast<int>(cutting)) - 1], at[0], at[1], at[2])) {
      return false;
    }
  }
  return true;
}

__global__ void __launch_bounds__(kThreads, 2)
    DrawTilesKernel(const TableEntry* table, const LayerLook* layers,
                    const VoxelHalfSpace* half_spaces, const __grid_constant__ BatchList batches,
                    VolumeView volume, SliceIndexView slices) {
  extern __shared__ __align__(16) unsigned char memory[];
  TileScratch& scratch = *reinterpret_cast<TileScratch*>(memory);
  Counters& counters = *volume.counters;
  for (;;) {
    if (threadIdx.x == 0) {
      const uint32_t next = atomicAdd(&counters.next_tile, 1u);
      scratch.tile = next < counters.dirty ? volume.dirty_list[next] : kAll;
      scratch.lit = 0;
      scratch.differs = 0;
    }
    for (uint32_t v = threadIdx.x; v < kTileVoxels; v += kThreads) scratch.colors[v] = 0;
    __syncthreads();
    const uint32_t tile = scratch.tile;
    if (tile == kAll) return;
    const Box3 box = volume.grid.VoxelsOf(tile);

    int32_t rank = -1;
    for (;;) {
      if (threadIdx.x < 32) {
        rank = NextLayer(layers, batches, tile, rank, scratch);
        ClipTile(layers, half_spaces, box, scratch);
      }
      if (threadIdx.x == 0) scratch.heavy_count = 0;
      for (uint32_t v = threadIdx.x; v < kTileVoxels; v += kThreads) scratch.words[v] = 0;
      __syncthreads();
      const uint32_t layer = scratch.layer;
      if (layer == kAll) break;
      if (scratch.outside != 0) {
        __syncthreads();  // all have seen it
        continue;
      }
      for (uint32_t b = 0; b < batches.count; ++b) {
        const uint32_t end = scratch.row_end[b];
        // In rounds of the block's size, so that what is heavy is drawn before its list is full.
        for (uint32_t round = scratch.row_begin[b]; round < end; round += kThreads) {
          const uint32_t p = round + threadIdx.x;
          bool heavy = false;
          if (p < end) {
            const uint64_t value = batches.batches[b].values[p];
            const TableEntry& entry = table[value >> 32];
            const uint32_t item = static_cast<uint32_t>(value);
            heavy = entry.alive != 0 && IsHeavy(entry, item, box);
            if (entry.alive == 0) {
            } else if (heavy) {
              scratch.heavy[atomicAdd(&scratch.heavy_count, 1u)] = value;
            } else if (entry.record.kind == PrimitiveKind::kPoints) {
              DrawItem<Points>(entry, item, box, volume.grid, scratch.words);
            } else if (entry.record.kind == PrimitiveKind::kSegments) {
              DrawItem<Segments>(entry, item, box, volume.grid, scratch.words);
            } else {
              DrawItem<Triangles>(entry, item, box, volume.grid, scratch.words);
            }
          }
          if (__syncthreads_or(heavy ? 1 : 0) != 0) {
            DrawHeavy(table, box, volume.grid, scratch);
            if (threadIdx.x == 0) scratch.heavy_count = 0;
            __syncthreads();
          }
        }
      }
      __syncthreads();
      const LayerLook look = layers[layer];
      const uint32_t cutting = scratch.cutting;
      const VoxelHalfSpace* const cut_by = half_spaces + look.first_half_space;
      for (uint32_t v = threadIdx.x; v < kTileVoxels; v += kThreads) {
        const uint32_t word = scratch.words[v];
        if (word == 0) continue;
        if (cutting != 0 && !IsInsideAll(cut_by, cutting, box, volume.grid, v)) continue;
        scratch.colors[v] = BlendLayer(scratch.colors[v], word, look.blend, look.opacity);
      }
      __syncthreads();
    }

    uint32_t* const held = volume.colors + static_cast<size_t>(tile) * kTileVoxels;
    uint32_t lit = 0;
    bool differs = false;
    for (uint32_t v = threadIdx.x; v < kTileVoxels; v += kThreads) {
      const uint32_t color = scratch.colors[v];
      lit += color != 0 ? 1 : 0;
      if (held[v] != color) {
        held[v] = color;
        differs = true;
      }
    }
    atomicAdd(&scratch.lit, lit);
    if (differs) atomicOr(&scratch.differs, 1u);
    __syncthreads();
    if (scratch.differs != 0) {
      const uint32_t before = volume.lit[tile], now = scratch.lit;
      int32_t ijk[3];
      volume.grid.Coordinates(tile, ijk);
      uint32_t outer = 0;
      for (int a = 0; a < 3; ++a) outer += static_cast<uint32_t>(ijk[a]) * slices.stride[a];
      const uint32_t inner = static_cast<uint32_t>(ijk[slices.inner_axis]);
      const uint32_t more = static_cast<uint32_t>(now != 0) - static_cast<uint32_t>(before != 0);
      for (uint32_t i = slices.begin[outer] + threadIdx.x; i < slices.begin[outer + 1];
           i += kThreads) {
        const int32_t slice = slices.slices[i];
        if (slice < slices.first || slice >= slices.last) continue;
        const uint32_t set = static_cast<uint32_t>(slice) % slices.inner_sets;
        if (slices.inner_seen[set * slices.inner_tiles + inner] == 0) continue;
        slices.dirty[slice - slices.first] = 1;
        if (more != 0) atomicAdd(&slices.lit_tiles[slice - slices.first], more);
      }
      __syncthreads();
      if (threadIdx.x == 0) {
        volume.lit[tile] = now;
        atomicAdd(reinterpret_cast<unsigned long long*>(&counters.lit_voxels),
                  static_cast<unsigned long long>(now) - before);
      }
    }
    __syncthreads();
  }
}

__global__ void ListDirtyKernel(VolumeView volume) {
  const uint32_t tile = blockIdx.x * blockDim.x + threadIdx.x;
  if (tile >= volume.grid.count() || volume.dirty[tile] == 0) return;
  volume.dirty[tile] = 0;
  volume.dirty_list[atomicAdd(&volume.counters->dirty, 1u)] = tile;
  atomicAdd(&volume.counters->tiles_drawn, 1u);
}

struct BoxArgs {
  int32_t lo[3], size[3];
};

__global__ void ReadBoxKernel(VolumeView volume, BoxArgs box, uint32_t* out) {
  const uint64_t i = static_cast<uint64_t>(blockIdx.x) * blockDim.x + threadIdx.x;
  const uint64_t nx = static_cast<uint64_t>(box.size[0]), ny = static_cast<uint64_t>(box.size[1]);
  if (i >= nx * ny * static_cast<uint64_t>(box.size[2])) return;
  const int32_t x = box.lo[0] + static_cast<int32_t>(i % nx);
  const int32_t y = box.lo[1] + static_cast<int32_t>(i / nx % ny);
  const int32_t z = box.lo[2] + static_cast<int32_t>(i / nx / ny);
  const TileGrid& grid = volume.grid;
  const Box3 all{{0, 0, 0}, {grid.voxels[0], grid.voxels[1], grid.voxels[2]}};
  out[i] =
      Contains(all, x, y, z)
          ? Deinterleave(volume.colors[static_cast<size_t>(grid.TileOf(x, y, z)) * kTileVoxels +
                                       grid.IndexInTile(x, y, z)])
          : 0;
}

}  // namespace

cudaError_t ListDirty(const VolumeView& volume, cudaStream_t stream) {
  ListDirtyKernel<<<(volume.grid.count() + kThreads - 1) / kThreads, kThreads, 0, stream>>>(volume);
  return cudaGetLastError();
}

cudaError_t DrawTiles(const TableEntry* table, const LayerLook* layers,
                      const VoxelHalfSpace* half_spaces, const BatchList& batches,
                      const VolumeView& volume, const SliceIndexView& slices, uint32_t blocks,
                      cudaStream_t stream) {
  DrawTilesKernel<<<blocks, kThreads, sizeof(TileScratch), stream>>>(table, layers, half_spaces,
                                                                     batches, volume, slices);
  return cudaGetLastError();
}

cudaError_t ReadBox(const VolumeView& volume, const int32_t lo[3], const int32_t size[3],
                    uint32_t* out, cudaStream_t stream) {
  BoxArgs box;
  uint64_t count = 1;
  for (int a = 0; a < 3; ++a) {
    box.lo[a] = lo[a];
    box.size[a] = size[a];
    count *= static_cast<uint64_t>(size[a]);
  }
  ReadBoxKernel<<<static_cast<uint32_t>((count + kThreads - 1) / kThreads), kThreads, 0, stream>>>(
      volume, box, out);
  return cudaGetLastError();
}

}  // namespace voxeld::gpu::cuda
