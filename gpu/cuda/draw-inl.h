// The drawing of dirty regions: a block of threads draws one in shared memory, layer by layer, and
// writes it out once.
#pragma once

#include "gpu/cuda/flush-inl.h"
#include "gpu/cuda/pairs-inl.h"
#include "gpu/cuda/spans-inl.h"

namespace voxeld::gpu::cuda {

// What a drawing has to reckon with: lines of one layer that is seen as it is; of any layers; or
// anything.
enum class DrawWhat : uint8_t { kOneLayer, kLines, kAll };

template <DrawWhat kWhat>
struct DrawScratch {
  RegionScratch region;
};
template <>
struct DrawScratch<DrawWhat::kAll> {
  RegionScratch region;
  PairScratch pairs;
};

// color(v): of voxel v of the region; any thread can tell.
template <DrawTo kTo, typename Color>
__device__ void Flush(const DrawView& view, const RegionPlace& place, const Ahead& ahead,
                      RegionScratch& scratch, Color&& color) {
  const auto round = [&](uint32_t j) { return color(threadIdx.x + j * kDrawThreads); };
  if constexpr (kTo == DrawTo::kTiles) FlushToTiles(view, place, scratch, round);
  if constexpr (kTo == DrawTo::kPictures) FlushToPictures(view, place, ahead, scratch, color);
  if constexpr (kTo == DrawTo::kReader) FlushToReader(view, place, scratch, round);
}

// The layers of a region from the lowest on, each raised into the words; blend() after each.
template <DrawWhat kWhat, typename Blend>
__device__ void DrawLayers(const DrawView& view, const RegionPlace& place, DrawScratch<kWhat>& all,
                           Blend&& blend) {
  RegionScratch& scratch = all.region;
  int32_t rank = -1;
  for (;;) {
    if (threadIdx.x < 32) {
      PairRows* rows = nullptr;
      if constexpr (kWhat == DrawWhat::kAll) rows = &all.pairs.rows;
      rank = NextLayer<kWhat == DrawWhat::kAll>(view, place, rank, scratch, rows);
      ClipRegion(view, place.box, scratch);
    }
    __syncthreads();
    if (scratch.layer == kAllLanes) return;
    if (scratch.outside != 0) {
      __syncthreads();  // all have seen it
      continue;
    }
    for (uint32_t left = scratch.line_batches; left != 0; left &= left - 1) {
      DrawSpans(view, view.lines.batches[__ffs(static_cast<int>(left)) - 1], scratch);
    }
    if constexpr (kWhat == DrawWhat::kAll) {
      if (scratch.pairs != 0) {
        for (uint32_t t = 0; t < kRegionTiles; ++t) {
          const uint32_t tile = place.TileOf(view.volume, t);
          if (tile != kAllLanes) DrawPairs(view, t, tile, scratch, all.pairs);
        }
      }
    }
    blend();
    if constexpr (kWhat == DrawWhat::kOneLayer) return;
    __syncthreads();
  }
}

template <DrawWhat kWhat>
constexpr int kBlocksAtOnce = kWhat == DrawWhat::kOneLayer ? 2
                              : kWhat == DrawWhat::kLines  ? 2
                                                           : 1;

template <DrawWhat kWhat, DrawTo kTo>
__global__ void __launch_bounds__(kDrawThreads, kBlocksAtOnce<kWhat>)
    DrawRegionsKernel(const __grid_constant__ DrawView view) {
  extern __shared__ __align__(16) unsigned char memory[];
  DrawScratch<kWhat>& all = *reinterpret_cast<DrawScratch<kWhat>*>(memory);
  RegionScratch& scratch = all.region;
  Counters& counters = *view.volume.counters;
  // The first thread asks for the region after the next one, and for the place of the one after
  // that, before it needs them.
  const uint32_t dirty = counters.dirty;
  const auto listed = [&](uint32_t place) {
    return place < dirty ? view.volume.dirty_list[place] : kAllLanes;
  };
  uint32_t place_after = 0, region_after = kAllLanes;
  if (threadIdx.x == 0) {
    scratch.lit_change = 0;
    region_after = listed(atomicAdd(&counters.next_region, 1u));
    place_after = atomicAdd(&counters.next_region, 1u);
  }
  for (;;) {
    if (threadIdx.x == 0) {
      scratch.region = region_after;
      region_after = listed(place_after);
      place_after = atomicAdd(&counters.next_region, 1u);
    }
    if (threadIdx.x < kRegionTiles) scratch.lit[threadIdx.x] = scratch.differs[threadIdx.x] = 0;
    uint4* const words = reinterpret_cast<uint4*>(scratch.words);
    for (uint32_t v = threadIdx.x; v < kRegionVoxels / 4; v += kDrawThreads) {
      words[v] = make_uint4(0, 0, 0, 0);
    }
    __syncthreads();
    const uint32_t region = scratch.region;
    if (region == kAllLanes) break;
    const RegionPlace place(view, region);
    const Ahead ahead = Ahead::Of<kTo>(view, place);
    if constexpr (kWhat == DrawWhat::kOneLayer) {
      const VoxelHalfSpace* cut_by = nullptr;
      uint32_t cutting = 0;
      if (view.clipped) {
        DrawLayers<kWhat>(view, place, all, [&] {
          cutting = scratch.cutting;
          cut_by = view.half_spaces + view.layers[scratch.layer].first_half_space;
        });
      } else {
        // All batches are of the layer.
        for (uint32_t b = 0; b < view.lines.count; ++b) {
          if (view.lines.batches[b].lists.Has(region)) {
            DrawSpans(view, view.lines.batches[b], scratch);
          }
        }
      }
      const auto shown = [&](uint32_t v) {
        const uint32_t word = scratch.words[v];
        return (word & kEraseBit) != 0 ? 0 : word & kColorMask;
      };
      if (cutting == 0) {
        Flush<kTo>(view, place, ahead, scratch, shown);
      } else {
        Flush<kTo>(view, place, ahead, scratch, [&](uint32_t v) {
          return IsInsideAll(cut_by, cutting, place.box, v) ? shown(v) : 0;
        });
      }
    } else {
      uint32_t colors[kRounds];
#pragma unroll
      for (uint32_t j = 0; j < kRounds; ++j) colors[j] = 0;
      DrawLayers<kWhat>(view, place, all, [&] {
        const LayerLook look = view.layers[scratch.layer];
        const uint32_t cutting = scratch.cutting;
        const VoxelHalfSpace* const cut_by = view.half_spaces + look.first_half_space;
#pragma unroll
        for (uint32_t j = 0; j < kRounds; ++j) {
          const uint32_t v = threadIdx.x + j * kDrawThreads;
          const uint32_t word = scratch.words[v];
          scratch.words[v] = 0;
          if (word == 0) continue;
          if (cutting != 0 && !IsInsideAll(cut_by, cutting, place.box, v)) continue;
          colors[j] = BlendLayer(colors[j], word, look.blend, look.opacity);
        }
      });
#pragma unroll
      for (uint32_t j = 0; j < kRounds; ++j) {
        scratch.words[threadIdx.x + j * kDrawThreads] = colors[j];
      }
      __syncthreads();
      Flush<kTo>(view, place, ahead, scratch, [&](uint32_t v) { return scratch.words[v]; });
    }
    __syncthreads();
  }
  if (threadIdx.x == 0 && scratch.lit_change != 0) {
    atomicAdd(reinterpret_cast<unsigned long long*>(&counters.lit_voxels), scratch.lit_change);
  }
}

template <DrawWhat kWhat, DrawTo kTo>
cudaError_t DrawRegionsTo(const DrawView& view, uint32_t multiprocessors, cudaStream_t stream) {
  constexpr int kShared = sizeof(DrawScratch<kWhat>);
  const cudaError_t error = cudaFuncSetAttribute(
      DrawRegionsKernel<kWhat, kTo>, cudaFuncAttributeMaxDynamicSharedMemorySize, kShared);
  if (error != cudaSuccess) return error;
  const uint32_t blocks =
      Min(view.regions.count(), static_cast<uint32_t>(kBlocksAtOnce<kWhat>) * multiprocessors);
  DrawRegionsKernel<kWhat, kTo><<<blocks, kDrawThreads, kShared, stream>>>(view);
  return cudaGetLastError();
}

template <DrawWhat kWhat>
cudaError_t DrawRegionsOf(const DrawView& view, DrawTo to, uint32_t multiprocessors,
                          cudaStream_t stream) {
  switch (to) {
    case DrawTo::kTiles:
      return DrawRegionsTo<kWhat, DrawTo::kTiles>(view, multiprocessors, stream);
    case DrawTo::kPictures:
      return DrawRegionsTo<kWhat, DrawTo::kPictures>(view, multiprocessors, stream);
    case DrawTo::kReader:
      return DrawRegionsTo<kWhat, DrawTo::kReader>(view, multiprocessors, stream);
  }
  return cudaErrorInvalidValue;
}

}  // namespace voxeld::gpu::cuda
