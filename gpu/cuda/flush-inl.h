// Where a region's colours go. Each function is called by the whole block; color(v) is the final
// colour of voxel v of the region, for v = threadIdx.x + j·kDrawThreads: a warp has a row along x.
#pragma once

#include "gpu/cuda/region_scratch-inl.h"
#include "gpu/slice/pack.h"

namespace voxeld::gpu::cuda {

inline constexpr uint32_t kRounds = kRegionVoxels / kDrawThreads;

struct RowPlace {
  uint32_t lane, half;  // which of the two tiles along x
  int32_t x, y, z;

  __device__ RowPlace(const RegionPlace& place, uint32_t j) {
    const uint32_t v = threadIdx.x + j * kDrawThreads;
    lane = v & 31;
    half = lane >> 4;
    x = place.box.lo[0] + static_cast<int32_t>(lane);
    y = place.box.lo[1] + static_cast<int32_t>(v >> 5 & 31);
    z = place.box.lo[2] + static_cast<int32_t>(v >> 10);
  }
  // Of the region's four.
  __device__ uint32_t tile() const { return half | (static_cast<uint32_t>(y) >> 4 & 1) << 1; }
};

// Counts a row's lit voxels for the two tiles that it crosses.
__device__ inline void CountLit(bool lit, const RowPlace& at, RegionScratch& scratch) {
  const uint32_t lanes = __ballot_sync(kAllLanes, lit);
  if (at.lane % 16 == 0 && lanes != 0) {
    const uint32_t mine = __popc(lanes >> at.lane & 0xFFFF);
    if (mine != 0) atomicAdd(&scratch.lit[at.tile()], mine);
  }
}

// What the tile's number of lit voxels was and is; by one thread a tile.
__device__ inline uint32_t PutLit(const VolumeView& volume, uint32_t tile, uint32_t now) {
  const uint32_t before = volume.lit[tile];
  volume.lit[tile] = now;
  if (now != before) {
    atomicAdd(reinterpret_cast<unsigned long long*>(&volume.counters->lit_voxels),
              static_cast<unsigned long long>(now) - before);
  }
  return before;
}

// Slices that look at a tile whose colours changed. `more`: 1 if it has become lit, −1 if dark.
__device__ inline void MarkSlices(const SliceIndexView& slices, const TileGrid& grid, uint32_t tile,
                                  uint32_t more, uint32_t thread, uint32_t threads) {
  int32_t ijk[3];
  grid.Coordinates(tile, ijk);
  uint32_t outer = 0;
  for (int a = 0; a < 3; ++a) outer += static_cast<uint32_t>(ijk[a]) * slices.stride[a];
  const uint32_t inner = static_cast<uint32_t>(ijk[slices.inner_axis]);
  for (uint32_t i = slices.begin[outer] + thread; i < slices.begin[outer + 1]; i += threads) {
    const int32_t slice = slices.slices[i];
    if (slice < slices.first || slice >= slices.last) continue;
    const uint32_t set = static_cast<uint32_t>(slice) % slices.inner_sets;
    if (slices.inner_seen[set * slices.inner_tiles + inner] == 0) continue;
    slices.dirty[slice - slices.first] = 1;
    if (more != 0) atomicAdd(&slices.lit_tiles[slice - slices.first], more);
  }
}

// Into the tiles' colours; marks the slices that look at those that changed.
template <typename Color>
__device__ void FlushToTiles(const DrawView& view, const RegionPlace& place, RegionScratch& scratch,
                             Color&& color) {
  const VolumeView& volume = view.volume;
#pragma unroll
  for (uint32_t j = 0; j < kRounds; ++j) {
    const RowPlace at(place, j);
    const uint32_t tile = place.TileOf(volume, at.tile());
    const bool inside = tile != kAllLanes && at.x < place.box.hi[0] && at.y < place.box.hi[1] &&
                        at.z < place.box.hi[2];
    const uint32_t c = inside ? color(j) : 0;
    if (inside) {
      uint32_t& held = volume.colors[static_cast<size_t>(tile) * kTileVoxels +
                                     volume.grid.IndexInTile(at.x, at.y, at.z)];
      if (held != c) {
        held = c;
        scratch.differs[at.tile()] = 1;
      }
    }
    CountLit(c != 0, at, scratch);
  }
  __syncthreads();
  // A warp looks after a tile.
  if (threadIdx.x < 32 * kRegionTiles) {
    const uint32_t t = threadIdx.x / 32, lane = threadIdx.x % 32;
    const uint32_t tile = place.TileOf(volume, t);
    if (tile != kAllLanes && scratch.differs[t] != 0) {
      uint32_t before = 0;
      if (lane == 0) before = PutLit(volume, tile, scratch.lit[t]);
      before = __shfl_sync(kAllLanes, before, 0);
      const uint32_t more =
          static_cast<uint32_t>(scratch.lit[t] != 0) - static_cast<uint32_t>(before != 0);
      MarkSlices(view.slices, volume.grid, tile, more, lane, 32);
    }
  }
}

// Writes a byte; true if it was another.
__device__ inline bool PutByte(uint8_t* at, uint32_t value) {
  if (*at == value) return false;
  *at = static_cast<uint8_t>(value);
  return true;
}

// A row's pixels into a picture. A warp together.
__device__ inline bool PutRow(const PackedView& packed, uint32_t sub, const RowPlace& at,
                              uint32_t v, uint32_t color, bool inside, uint8_t* picture) {
  const SliceView& view = packed.slices;
  const uint32_t u = static_cast<uint32_t>(at.x);
  if (view.format == display::PixelFormat::kBitPlanes3) {
    const uint32_t least = packed.least[(sub * 8 + v % 8) * 8 + u % 8];
    constexpr uint32_t kBlue = 0x249249;
    const bool on = inside && color != 0;
    const uint32_t red = __ballot_sync(kAllLanes, on && (color & kBlue << 1) >= least << 1);
    const uint32_t green = __ballot_sync(kAllLanes, on && (color & kBlue << 2) >= least << 2);
    const uint32_t blue = __ballot_sync(kAllLanes, on && (color & kBlue) >= least);
    // Twelve lanes write a byte each: of a plane's 32 pixels the eight from 8·(lane % 4) on.
    const uint32_t plane = at.lane / 4, part = at.lane % 4;
    const uint32_t first = u - at.lane + part * 8;
    if (plane > 2 || first >= view.width) return false;
    const uint32_t bits = plane == 0 ? red : plane == 1 ? green : blue;
    const size_t row = (view.width + 7) / 8;
    return PutByte(picture + plane * row * view.height + v * row + first / 8,
                   __brev(bits >> part * 8 & 0xFF) >> 24);
  }
  if (!inside) return false;
  Levels q = {0, 0, 0};
  if (color != 0) {
    const uint32_t rgb = Deinterleave(color);
    const Levels levels = LevelsOf(view.format);
    const uint32_t threshold = Threshold(view.dither, u, v, sub, view.sub_frames);
    q = {Quantize(view.lut[rgb >> 16], levels.r, threshold),
         Quantize(view.lut[rgb >> 8 & 0xFF], levels.g, threshold),
         Quantize(view.lut[rgb & 0xFF], levels.b, threshold)};
  }
  const size_t pixel = static_cast<size_t>(v) * view.width + u;
  if (view.format == display::PixelFormat::kRgb332) {
    return PutByte(picture + pixel, q.r << 5 | q.g << 2 | q.b);
  }
  bool differs = PutByte(picture + pixel * 3, q.r);
  differs |= PutByte(picture + pixel * 3 + 1, q.g);
  differs |= PutByte(picture + pixel * 3 + 2, q.b);
  return differs;
}

// Straight into the pictures of the slices that the region's planes are.
template <typename Color>
__device__ void FlushToPictures(const DrawView& view, const RegionPlace& place,
                                RegionScratch& scratch, Color&& color) {
  const PackedView& packed = view.packed;
  const SliceView& slices = packed.slices;
#pragma unroll 4
  for (uint32_t j = 0; j < kRounds; ++j) {
    const RowPlace at(place, j);
    const int32_t v = (at.y - packed.y0) * packed.y_step;
    const int32_t s = at.z < place.box.hi[2] ? packed.slice_of_z[at.z] : -1;
    const bool row = s >= 0 && at.y < place.box.hi[1];  // the same in all lanes
    const bool inside = row && at.x < place.box.hi[0];
    const uint32_t c = inside ? color(j) : 0;
    CountLit(c != 0, at, scratch);
    if (!row || v < 0 || v >= static_cast<int32_t>(slices.height)) continue;
    for (uint32_t sub = 0; sub < slices.sub_frames; ++sub) {
      const uint32_t picture = static_cast<uint32_t>(s) * slices.sub_frames + sub;
      const bool pixel = inside && static_cast<uint32_t>(at.x) < slices.width;
      const bool differs =
          PutRow(packed, sub, at, static_cast<uint32_t>(v), c, pixel,
                 slices.bytes + static_cast<size_t>(picture) * slices.bytes_per_picture);
      if (__any_sync(kAllLanes, differs) && at.lane == 0) {
        atomicOr(&scratch.pictures[at.z - place.box.lo[2]], 1u << sub);
      }
    }
  }
  __syncthreads();
  const int32_t z = place.box.lo[2] + static_cast<int32_t>(threadIdx.x);
  if (z < place.box.hi[2] && scratch.pictures[threadIdx.x] != 0) {
    const uint32_t s = static_cast<uint32_t>(packed.slice_of_z[z]);
    packed.slice_dirty[s] = 1;
    for (uint32_t sub = 0; sub < slices.sub_frames; ++sub) {
      if (scratch.pictures[threadIdx.x] >> sub & 1) {
        slices.differs[s * slices.sub_frames + sub] = 1;
      }
    }
  }
  if (threadIdx.x < kRegionTiles) {
    const uint32_t tile = place.TileOf(view.volume, threadIdx.x);
    if (tile != kAllLanes) PutLit(view.volume, tile, scratch.lit[threadIdx.x]);
  }
}

// To who asks for voxels.
template <typename Color>
__device__ void FlushToReader(const DrawView& view, const RegionPlace& place, RegionScratch&,
                              Color&& color) {
  const Box3& box = view.read.box;
#pragma unroll 4
  for (uint32_t j = 0; j < kRounds; ++j) {
    const RowPlace at(place, j);
    if (at.x >= place.box.hi[0] || at.y >= place.box.hi[1] || at.z >= place.box.hi[2]) continue;
    if (!Contains(box, at.x, at.y, at.z)) continue;
    if (place.TileOf(view.volume, at.tile()) == kAllLanes) continue;
    const size_t nx = static_cast<size_t>(box.hi[0] - box.lo[0]),
                 ny = static_cast<size_t>(box.hi[1] - box.lo[1]);
    view.read
        .out[(static_cast<size_t>(at.z - box.lo[2]) * ny + static_cast<size_t>(at.y - box.lo[1])) *
                 nx +
             static_cast<size_t>(at.x - box.lo[0])] = Deinterleave(color(j));
  }
}

}  // namespace voxeld::gpu::cuda
