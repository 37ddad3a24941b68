// Draws dirty regions: a block of threads draws one in shared memory, layer by layer, and writes it
// out once.
#pragma once

#include <cstddef>

#include "gpu/cuda/flush-inl.h"
#include "gpu/cuda/pairs-inl.h"
#include "gpu/cuda/points-inl.h"
#include "gpu/cuda/spans-inl.h"
#include "gpu/cuda/triangles-inl.h"
#include "gpu/cuda/unsorted-inl.h"

namespace voxeld::gpu::cuda {

// The content that a kernel can draw: thin lines, points and small triangles that have lists, in
// one layer that is shown without blending; the same in any layers; or anything.
enum class DrawWhat : uint8_t { kOneLayer, kLines, kAll };

template <DrawWhat kWhat>
struct DrawScratch {
  RegionScratch region;
  union {  // one after the other
    SpanScratch spans;
    PointScratch points;
  };
};
template <>
struct DrawScratch<DrawWhat::kAll> {
  RegionScratch region;
  union {  // one after the other
    SpanScratch spans;
    PointScratch points;
    PairScratch pairs;
  };
  PairRows rows;
  uint32_t mask[kDrawThreads];  // of the layer being drawn, if it has one; each thread's voxels
};
static_assert(offsetof(DrawScratch<DrawWhat::kAll>, pairs) == sizeof(RegionScratch) &&
              offsetof(PairScratch, solid) == 0);  // SharedBehind
// A multiprocessor must have room for kDrawBlocks of them; the system reserves 1 KB of each.
static_assert(sizeof(DrawScratch<DrawWhat::kAll>) <= (228 / kDrawBlocks - 1) * 1024);

// The destination of a kernel. The kernels for thin lines, points and small triangles are compiled
// for each destination. The kernel for anything is many times larger than the code that writes a
// region out: it is compiled once and checks the destination for each region.
template <DrawTo kTo>
struct FixedOutput {
  __device__ constexpr DrawTo to() const { return kTo; }
};
struct AnyOutput {
  DrawTo value;
  __device__ DrawTo to() const { return value; }
};

template <class Output>
__device__ void Flush(const DrawView& view, const Output& output, const RegionPlace& place,
                      RegionScratch& scratch) {
  if (output.to() == DrawTo::kTiles) return FlushToTiles(view, place, scratch);
  if (output.to() == DrawTo::kPictures) return FlushToPictures(view, place, scratch);
  FlushToReader(view, place, scratch);
}

// Decides what to do with the layer that was found, and which one to find next. A layer with a mask
// takes three steps: it is found to have something here, then its mask is found, then it is drawn.
// Called by the first warp.
template <DrawWhat kWhat>
__device__ void PlanStep(const DrawView& view, int32_t found, RegionScratch& scratch) {
  __syncwarp();
  LayerWanted wanted = scratch.wanted;
  uint32_t under = scratch.under;
  const uint32_t layer = scratch.layer;
  const bool here = layer != kAllLanes && scratch.outside == 0;
  DrawStep step = here ? DrawStep::kLayer : DrawStep::kSkip;
  if (wanted.slot == kAllLanes) {
    wanted.last = found;
    if (layer == kAllLanes) step = DrawStep::kNone;
    if constexpr (kWhat == DrawWhat::kAll) {
      const int32_t mask = here ? view.layers[layer].mask : -1;
      if (mask >= 0) {
        step = DrawStep::kSkip;
        under = layer;
        wanted.slot = static_cast<uint32_t>(mask);
      }
    }
  } else if (under != kAllLanes) {
    wanted.slot = here ? under : kAllLanes;
    if (here) step = DrawStep::kMask;
    under = kAllLanes;
  } else {
    wanted.slot = kAllLanes;
  }
  __syncwarp();
  if (threadIdx.x == 0) {
    scratch.step = step;
    scratch.wanted = wanted;
    scratch.under = under;
  }
}

// A layer that was drawn and whose words are still in shared memory.
struct Standing {
  uint32_t layer = kAllLanes;  // its slot; kAllLanes: none
  uint32_t cutting = 0;        // RegionScratch::cutting
};

// Blends the visible part of the layer over the layers that were settled before, if any. The result
// is put aside, so that the next layer can be drawn; or, if it is the last layer (`last`), it
// replaces the words. Called by the whole block: a thread handles the same voxels each time.
template <DrawWhat kWhat>
static __device__ __noinline__ void Settle(const DrawView& view, Standing standing, bool settled,
                                           bool last, DrawScratch<kWhat>& all) {
  RegionScratch& scratch = all.region;
  const RegionPlace place(view, scratch);
  const LayerLook look = view.layers[standing.layer];
  const CutBy cut_by = CutBy::Of(view, look, standing.cutting);
  uint32_t seen = kAllLanes;
  if constexpr (kWhat == DrawWhat::kAll) {
    if (look.mask >= 0) seen = all.mask[threadIdx.x];
  }
  uint32_t* const below = view.below + static_cast<size_t>(blockIdx.x) * kRegionVoxels;
#pragma unroll 4
  for (uint32_t j = 0; j < kRounds; ++j) {
    const uint32_t v = threadIdx.x + j * kDrawThreads;
    const uint32_t word = scratch.words[v];
    const bool shown =
        word != 0 && (seen >> j & 1) != 0 && (cut_by.cutting == 0 || cut_by.Keeps(place.box, v));
    uint32_t color = 0;
    if (settled && (shown || last)) color = below[v];
    if (shown) color = BlendLayer(color, word, look.blend, look.opacity);
    if (!last && (shown || !settled)) below[v] = color;
    scratch.words[v] = last ? color : 0;
  }
  __syncthreads();
}

// Turns the words into the mask of the layer that follows. Called by the whole block.
static __device__ __noinline__ void TakeMask(const DrawView& view,
                                             DrawScratch<DrawWhat::kAll>& all) {
  RegionScratch& scratch = all.region;
  const RegionPlace place(view, scratch);
  const CutBy cut_by = CutBy::Of(view, view.layers[scratch.layer], scratch.cutting);
  uint32_t mask = 0;  // bit j: the thread's j-th voxel
#pragma unroll 4
  for (uint32_t j = 0; j < kRounds; ++j) {
    const uint32_t v = threadIdx.x + j * kDrawThreads;
    const uint32_t word = scratch.words[v];
    scratch.words[v] = 0;
    if (!IsCovered(word)) continue;
    if (cut_by.cutting == 0 || cut_by.Keeps(place.box, v)) mask |= 1u << j;
  }
  all.mask[threadIdx.x] = mask;
  __syncthreads();
}

// Raises the layer's items in the region into the words. Called by the whole block.
template <DrawWhat kWhat>
__device__ void RaiseLayer(const DrawView& view, DrawScratch<kWhat>& all) {
  RegionScratch& scratch = all.region;
  for (uint32_t left = scratch.line_batches; left != 0; left &= left - 1) {
    const LineBatchView& batch = view.lines.batches[__ffs(static_cast<int>(left)) - 1];
    if constexpr (kWhat == DrawWhat::kAll) {
      if (batch.lists.spans == nullptr) {
        DrawUnsorted(batch.lines, batch.tracks, batch.ends, batch.count, &view.regions);
        continue;
      }
    }
    DrawSpans(batch);
  }
  for (uint32_t left = scratch.point_batches; left != 0; left &= left - 1) {
    const PointBatchView& batch = view.points.batches[__ffs(static_cast<int>(left)) - 1];
    if constexpr (kWhat == DrawWhat::kAll) {
      if (batch.records == nullptr) {
        DrawUnsortedPoints(batch.points, batch.count);
        continue;
      }
    }
    DrawPoints(batch);
  }
  for (uint32_t left = scratch.triangle_batches; left != 0; left &= left - 1) {
    DrawTriangles<kWhat != DrawWhat::kAll>(
        view, static_cast<uint32_t>(__ffs(static_cast<int>(left))) - 1);
  }
  if constexpr (kWhat == DrawWhat::kAll) {
    if (scratch.pairs == 0) return;
    __syncthreads();
    PairScratch& pairs = all.pairs;
    if (threadIdx.x == 0) pairs.heavy_count = pairs.small_count = pairs.small_taken = 0;
    __syncthreads();
    DrawPairs(view, all.rows, pairs);
    for (uint32_t t = 0; t < kRegionTiles && view.unlisted.items != 0; ++t) {
      const uint32_t tile = all.rows.tile[t];
      if (tile != kAllLanes) DrawUnlisted(view, tile, all.rows.owned, scratch, pairs);
    }
    if (pairs.listed() != 0) DrawHeavy(view.table, view.volume.grid);
  }
}

// Draws the layers of a region from the lowest on. Afterwards the words are the visible result.
template <DrawWhat kWhat>
__device__ void DrawLayers(const DrawView& view, const RegionPlace& place,
                           DrawScratch<kWhat>& all) {
  RegionScratch& scratch = all.region;
  if (threadIdx.x == 0) {
    scratch.wanted = LayerWanted();
    scratch.under = kAllLanes;
  }
  Standing standing;
  bool settled = false;
  for (;;) {
    if (threadIdx.x < 32) {
      __syncwarp();
      PairRows* rows = nullptr;
      if constexpr (kWhat == DrawWhat::kAll) rows = &all.rows;
      const int32_t found =
          NextLayer<kWhat == DrawWhat::kAll>(view, place, scratch.wanted, scratch, rows);
      ClipRegion(view, place.box, scratch);
      PlanStep<kWhat>(view, found, scratch);
    }
    __syncthreads();
    const DrawStep step = scratch.step;
    if (step == DrawStep::kNone) break;
    if (step == DrawStep::kSkip) {
      __syncthreads();  // all threads have read it
      continue;
    }
    if (standing.layer != kAllLanes) {
      Settle<kWhat>(view, standing, settled, false, all);
      standing = Standing();
      settled = true;
    }
    RaiseLayer<kWhat>(view, all);
    if (step == DrawStep::kLayer) standing = {scratch.layer, scratch.cutting};
    if constexpr (kWhat == DrawWhat::kOneLayer) break;
    if constexpr (kWhat == DrawWhat::kAll) {
      if (step == DrawStep::kMask) {
        TakeMask(view, all);
        continue;
      }
    }
    __syncthreads();                   // all threads have read the step
    if (view.below == nullptr) break;  // there is only one layer
  }
  if (standing.layer == kAllLanes) return;
  const LayerLook& look = view.layers[standing.layer];
  const bool as_it_is = look.blend == BlendMode::kOver && look.opacity == 255 && look.mask < 0;
  if (settled || standing.cutting != 0 || !as_it_is) {
    Settle<kWhat>(view, standing, settled, true, all);
  }
}

template <DrawWhat kWhat, class Output>
__global__ void __launch_bounds__(kDrawThreads, kDrawBlocks)
    DrawRegionsKernel(const __grid_constant__ DrawView view, const Output output) {
  DrawScratch<kWhat>& all = *reinterpret_cast<DrawScratch<kWhat>*>(SharedMemory());
  RegionScratch& scratch = all.region;
  Counters& counters = *view.volume.counters;
  const uint32_t dirty = *view.listed;
  for (uint32_t i = threadIdx.x; i < kRegionVoxels; i += kDrawThreads) {
    scratch.words[i] = 0;
  }
  if (output.to() == DrawTo::kPictures) {
    if (threadIdx.x < 64 && view.packed.slices.finish.format == display::PixelFormat::kBitPlanes) {
      scratch.least[threadIdx.x] = view.packed.least[threadIdx.x];
    }
  }
  // A block starts with one place in the list, and takes others from the `taken` counter.
  if (threadIdx.x == 0) {
    scratch.lit_change = 0;
    scratch.region = blockIdx.x < dirty ? view.list[blockIdx.x] : kAllLanes;
    scratch.place = gridDim.x + atomicAdd(view.taken, 1u);
  }
  for (;;) {
    if (threadIdx.x < kRegionTiles) scratch.lit[threadIdx.x] = scratch.differs[threadIdx.x] = 0;
    // The result is voted on: the compiler must not see a loop that threads might leave one by one,
    // because it calls functions.
    if (__syncthreads_or(threadIdx.x == 0 && scratch.region != kAllLanes) == 0) break;
    const uint32_t region = scratch.region;
    // Prefetch the next region, and the place of the one after it, while this one is written out.
    uint32_t region_after = kAllLanes, place_after = 0;
    const auto ask_ahead = [&] {
      if (threadIdx.x != 0) return;
      if (scratch.place < dirty) region_after = view.list[scratch.place];
      place_after = gridDim.x + atomicAdd(view.taken, 1u);
    };
    if (kWhat == DrawWhat::kOneLayer && !view.clipped) {
      // All batches are of that layer.
      for (uint32_t b = 0; b < view.lines.count; ++b) DrawSpans(view.lines.batches[b]);
      for (uint32_t b = 0; b < view.points.count; ++b) DrawPoints(view.points.batches[b]);
      for (uint32_t b = 0; b < view.triangles.count; ++b) {
        if (view.triangles.batches[b].Has<true>(region)) DrawTriangles<true>(view, b);
      }
    } else {
      DrawLayers<kWhat>(view, RegionPlace(view, scratch), all);
    }
    ask_ahead();
    Flush(view, output, RegionPlace(view, scratch), scratch);
    if (threadIdx.x == 0) {
      scratch.region = region_after;
      scratch.place = place_after;
    }
  }
  if (threadIdx.x == 0 && scratch.lit_change != 0) {
    atomicAdd(reinterpret_cast<unsigned long long*>(&counters.lit_voxels), scratch.lit_change);
  }
}

template <DrawWhat kWhat, class Output>
cudaError_t DrawRegionsTo(const DrawView& view, const Output& output, uint32_t multiprocessors,
                          cudaStream_t stream) {
  constexpr int kShared = sizeof(DrawScratch<kWhat>);
  const cudaError_t error = cudaFuncSetAttribute(
      DrawRegionsKernel<kWhat, Output>, cudaFuncAttributeMaxDynamicSharedMemorySize, kShared);
  if (error != cudaSuccess) return error;
  const uint32_t blocks = Min(view.regions.count(), kDrawBlocks * multiprocessors);
  DrawRegionsKernel<kWhat, Output><<<blocks, kDrawThreads, kShared, stream>>>(view, output);
  return cudaGetLastError();
}

template <DrawWhat kWhat>
cudaError_t DrawRegionsOf(const DrawView& view, DrawTo to, uint32_t multiprocessors,
                          cudaStream_t stream) {
  switch (to) {
    case DrawTo::kTiles:
      return DrawRegionsTo<kWhat>(view, FixedOutput<DrawTo::kTiles>(), multiprocessors, stream);
    case DrawTo::kPictures:
      return DrawRegionsTo<kWhat>(view, FixedOutput<DrawTo::kPictures>(), multiprocessors, stream);
    case DrawTo::kReader:
      return DrawRegionsTo<kWhat>(view, FixedOutput<DrawTo::kReader>(), multiprocessors, stream);
  }
  return cudaErrorInvalidValue;
}

}  // namespace voxeld::gpu::cuda
