// Draws regions with anything in them; lists dirty regions; reads voxels for ReadVoxels.

// Here intervals are used for implicit shapes whose voxels did not fit in memory (implicit-inl.h).
#define VOXELD_INTERVALS_OUT_OF_LINE
#include "gpu/cuda/draw-inl.h"
#include "gpu/cuda/draw_kernels.h"
#include "gpu/cuda/items-inl.h"

namespace voxeld::gpu::cuda {

namespace {

__global__ void ListDirtyKernel(VolumeView volume, RegionGrid regions, DrawGroups groups) {
  const uint64_t region = Thread();
  if (region >= regions.count()) return;
  int32_t at[3];
  regions.RegionCoordinates(static_cast<uint32_t>(region), at);
  bool dirty = volume.region_dirty[region] != 0;
  volume.region_dirty[region] = 0;
  uint32_t owned = 0;
  for (int32_t t = 0; t < static_cast<int32_t>(kRegionTiles); ++t) {
    const int32_t i = at[0] * 2 + (t & 1), j = at[1] * 2 + (t >> 1), k = at[2];
    const TileGrid& grid = volume.grid;
    if (i >= grid.tiles[0] || j >= grid.tiles[1] || k >= grid.tiles[2]) continue;
    const uint32_t tile = grid.Index(i, j, k);
    if (volume.owned[tile] == 0) continue;
    ++owned;
    if (volume.dirty[tile] == 0) continue;
    dirty = true;
    volume.dirty[tile] = 0;
  }
  if (!dirty || owned == 0) return;
  uint32_t group = 0;
  while (group + 1 < groups.count && at[2] >= groups.end[group]) ++group;
  const uint32_t first =
      group == 0 ? 0 : static_cast<uint32_t>(groups.end[group - 1]) * regions.count_of_plane();
  volume.dirty_list[first + atomicAdd(&volume.counters->dirty[group], 1u)] =
      static_cast<uint32_t>(region);
  atomicAdd(&volume.counters->tiles_drawn, 1u);
}

__global__ void PickRegionsKernel(const uint32_t* from, const uint32_t* listed, RegionGrid within,
                                  uint32_t* list, PickedRegions* picked) {
  const uint64_t i = Thread();
  if (i >= *listed) return;
  int32_t block[3];
  within.BlockCoordinates(from[i] / kRegionsInBlock, block);
  if (!within.DrawsBlock(block)) return;
  list[atomicAdd(&picked->count, 1u)] = from[i];
  for (int a = 0; a < 3; ++a) {
    atomicMin(&picked->lo[a], block[a]);
    atomicMax(&picked->hi[a], block[a] + 1);
  }
}

struct BoxArgs {
  int32_t lo[3], size[3];
};

__global__ void ReadBoxKernel(VolumeView volume, BoxArgs box, uint32_t* out) {
  const uint64_t i = Thread();
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

cudaError_t ListDirty(const VolumeView& volume, const RegionGrid& regions, const DrawGroups& groups,
                      cudaStream_t stream) {
  ListDirtyKernel<<<Blocks(regions.count()), kItemThreads, 0, stream>>>(volume, regions, groups);
  return cudaGetLastError();
}

cudaError_t PickRegions(const DrawView& view, const RegionGrid& within, uint32_t* list,
                        PickedRegions* picked, cudaStream_t stream) {
  PickRegionsKernel<<<Blocks(within.count()), kItemThreads, 0, stream>>>(view.list, view.listed,
                                                                         within, list, picked);
  return cudaGetLastError();
}

cudaError_t DrawAll(const DrawView& view, DrawTo to, uint32_t multiprocessors,
                    cudaStream_t stream) {
  return DrawRegionsTo<DrawWhat::kAll>(view, AnyOutput{to}, multiprocessors, stream);
}

size_t DrawShared() { return sizeof(DrawScratch<DrawWhat::kAll>); }

cudaError_t ReadBox(const VolumeView& volume, const int32_t lo[3], const int32_t size[3],
                    uint32_t* out, cudaStream_t stream) {
  BoxArgs box;
  uint64_t count = 1;
  for (int a = 0; a < 3; ++a) {
    box.lo[a] = lo[a];
    box.size[a] = size[a];
    count *= static_cast<uint64_t>(size[a]);
  }
  ReadBoxKernel<<<Blocks(count), kItemThreads, 0, stream>>>(volume, box, out);
  return cudaGetLastError();
}

}  // namespace voxeld::gpu::cuda
