// Writes a region's colours to their destination. Each function is called by the whole block, and
// sets the words to 0. When a thread returns, all threads have read the variables that identify the
// region. The visible colour of a voxel is its word's colour (0 for an erase), or the colour that
// replaced the word.
#pragma once

#include "gpu/cuda/pixels-inl.h"
#include "gpu/cuda/region_scratch-inl.h"
#include "gpu/slice/pack.h"

namespace voxeld::gpu::cuda {

inline constexpr uint32_t kRounds = kRegionVoxels / kDrawThreads;

// The place of voxel threadIdx.x + j·kDrawThreads of a region: a warp has a row along x.
struct RowPlace {
  uint32_t v, lane, half;  // half: which of the two tiles along x
  int32_t x, y, z;

  __device__ RowPlace(const RegionPlace& place, uint32_t j) {
    v = threadIdx.x + j * kDrawThreads;
    lane = v & 31;
    half = lane >> 4;
    x = place.box.lo[0] + static_cast<int32_t>(lane);
    y = place.box.lo[1] + static_cast<int32_t>(v >> 5 & 31);
    z = place.box.lo[2] + static_cast<int32_t>(v >> 10);
  }
  // Returns which of the region's four tiles it is.
  __device__ uint32_t tile() const { return half | (static_cast<uint32_t>(y) >> 4 & 1) << 1; }
};

__device__ inline uint32_t TakeWord(RegionScratch& scratch, const RowPlace& at) {
  uint32_t& word = scratch.words[at.v];
  const uint32_t taken = word;
  word = 0;
  return taken;
}

// Counts a row's lit voxels for the two tiles that it crosses.
__device__ inline void CountLit(bool lit, const RowPlace& at, RegionScratch& scratch) {
  const uint32_t lanes = __ballot_sync(kAllLanes, lit);
  if (at.lane % 16 == 0 && lanes != 0) {
    const uint32_t mine = __popc(lanes >> at.lane & 0xFFFF);
    if (mine != 0) atomicAdd(&scratch.lit[at.tile()], mine);
  }
}

// Notes a tile's number of lit voxels. Called by one thread per tile.
__device__ inline void PutLit(const VolumeView& volume, uint32_t tile, uint8_t owner,
                              uint32_t before, uint32_t now, RegionScratch& scratch) {
  if (now == before) return;
  volume.lit[tile] = now;
  if (owner != kOwned) return;
  atomicAdd(&scratch.lit_change, static_cast<unsigned long long>(now) - before);
}

// Marks the slices that look at a tile whose colours changed. `more`: 1 if it has become lit, −1 if
// dark.
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

// Writes to the tiles' colours; marks the slices that look at tiles that changed.
__device__ inline void FlushToTiles(const DrawView& view, const RegionPlace& place,
                                    RegionScratch& scratch) {
  const VolumeView& volume = view.volume;
#pragma unroll
  for (uint32_t j = 0; j < kRounds; ++j) {
    const RowPlace at(place, j);
    const uint32_t drawn = TakeWord(scratch, at);
    const uint32_t tile = place.TileOf(volume, at.tile());
    const bool inside = tile != kAllLanes && at.x < place.box.hi[0] && at.y < place.box.hi[1] &&
                        at.z < place.box.hi[2];
    const uint32_t c = inside ? drawn & kColorMask : 0;
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
  // A warp handles a tile.
  if (threadIdx.x < 32 * kRegionTiles) {
    const uint32_t t = threadIdx.x / 32, lane = threadIdx.x % 32;
    const uint32_t tile = place.TileOf(volume, t);
    if (tile != kAllLanes && scratch.differs[t] != 0) {
      const uint32_t before = volume.lit[tile];
      __syncwarp();
      if (lane == 0) {
        PutLit(volume, tile, volume.owned[tile], before, scratch.lit[t], scratch);
      }
      const uint32_t more =
          static_cast<uint32_t>(scratch.lit[t] != 0) - static_cast<uint32_t>(before != 0);
      MarkSlices(view.slices, volume.grid, tile, more, lane, 32);
    }
  }
  __syncthreads();
}

// Writes a row's pixels into a slice image of bytes.
__device__ inline bool PutPixel(const SliceView& view, uint32_t sub, uint32_t u, uint32_t v,
                                uint32_t color, uint8_t* picture) {
  Levels q = {0, 0, 0};
  if (color != 0) {
    const uint32_t rgb = Deinterleave(color);
    const Finish& finish = view.finish;
    const Levels levels = LevelsOf(finish.format, finish.bits);
    const Light light = finish.LightOf(rgb);
    const uint32_t threshold = Threshold(finish.dither, u, v, sub, view.sub_frames);
    q = {Quantize(light.r, levels.r, threshold), Quantize(light.g, levels.g, threshold),
         Quantize(light.b, levels.b, threshold)};
  }
  return PutLevels(view, u, v, q, picture);
}

// The place of three planes' words for a row of 32 pixels in a slice image of bits, as far as the
// slice image reaches.
struct BitsPlace {
  uint8_t* at = nullptr;  // of the first plane; null: none
  uint32_t plane = 0;     // bytes from one to the next
  int32_t count = 0;      // pixels
  bool whole = false;     // they are words in memory

  // For row `lane` of the region's plane that is `slice`.
  __device__ BitsPlace(const PackedView& packed, const RegionPlace& place, int32_t slice,
                       uint32_t sub) {
    const SliceView& view = packed.slices;
    const int32_t lane = static_cast<int32_t>(threadIdx.x % 32);
    const int32_t v = (place.box.lo[1] + lane - packed.y0) * packed.y_step;
    count = static_cast<int32_t>(view.width) - place.box.lo[0];
    if (slice < 0 || lane >= place.box.hi[1] - place.box.lo[1] || v < 0 ||
        v >= static_cast<int32_t>(view.height) || count <= 0) {
      return;
    }
    const uint32_t row = (view.width + 7) / 8;
    plane = row * view.height;
    at = view.bytes +
         static_cast<size_t>(static_cast<uint32_t>(slice) * view.sub_frames + sub) *
             view.bytes_per_picture +
         static_cast<uint32_t>(v) * row + static_cast<uint32_t>(place.box.lo[0]) / 8;
    whole = count >= 32 && (reinterpret_cast<uintptr_t>(at) | plane) % 4 == 0;
  }
  __device__ void Load(uint32_t held[3]) const {
    if (at == nullptr || !whole) return;
#pragma unroll
    for (uint32_t p = 0; p < 3; ++p) held[p] = *reinterpret_cast<uint32_t*>(at + p * plane);
  }
  // Writes the bits, the first pixel in the highest bit. Returns true if they changed.
  __device__ bool Put(const uint32_t bits[3], const uint32_t held[3]) const {
    if (at == nullptr) return false;
    const uint32_t kept = count >= 32 ? kAllLanes : ~(kAllLanes >> count);
    bool differs = false;
#pragma unroll
    for (uint32_t p = 0; p < 3; ++p) {
      const uint32_t bytes = __byte_perm(bits[p] & kept, 0, 0x0123);
      if (whole) {
        if (held[p] == bytes) continue;
        *reinterpret_cast<uint32_t*>(at + p * plane) = bytes;
        differs = true;
        continue;
      }
      for (int32_t i = 0; i < 4 && i * 8 < count; ++i) {
        differs |= PutByte(at + p * plane + i, bytes >> 8 * i & 0xFF);
      }
    }
    return differs;
  }
};

// Bits of a row's 32 voxels, the first in the highest bit.
struct RowBits {
  uint32_t lit = 0, red = 0, green = 0, blue = 0;
};

// Takes a row out of shared memory. Each lane processes a row alone, and its warp 32 rows: each
// starts with other voxels, so that the accesses are spread over all banks. least:
// PackedView::least of eight pixels of the row. `keep`: the words are used again. limit: the number
// of existing voxels in the row.
__device__ inline RowBits TakeRow(uint32_t* row, uint32_t v, int32_t limit, const uint4 least[2],
                                  bool keep) {
  constexpr uint32_t kBlue = 0x249249;
  const uint32_t begin = threadIdx.x % 8 * 4;
  const bool odd = threadIdx.x % 2 != 0;
  const uint4 near = least[odd ? 1 : 0], far = least[odd ? 0 : 1];
  const uint32_t leasts[8] = {near.x, near.y, near.z, near.w, far.x, far.y, far.z, far.w};
  RowBits bits;  // of voxels below the least, and of dark voxels
#pragma unroll 1
  for (uint32_t step = 0; step < 32; step += 8) {
#pragma unroll
    for (uint32_t half = 0; half < 8; half += 4) {
      const uint32_t x = (begin + step + half) % 32;
      uint4& place = *reinterpret_cast<uint4*>(row + x);
      const uint4 words = place;
      if (__any_sync(kAllLanes, (words.x | words.y | words.z | words.w) != 0) == 0) {
        bits.lit = bits.lit << 4 | 0xF;
        bits.red = bits.red << 4 | 0xF;
        bits.green = bits.green << 4 | 0xF;
        bits.blue = bits.blue << 4 | 0xF;
        continue;
      }
      if (!keep) place = make_uint4(0, 0, 0, 0);
      const uint32_t four[4] = {words.x, words.y, words.z, words.w};
#pragma unroll
      for (uint32_t i = 0; i < 4; ++i) {
        const uint32_t at = x + i, l = leasts[half + i];
        const uint32_t c = static_cast<int32_t>(at) < limit ? four[i] & kColorMask : 0;
        // The sign of the difference says whether it is less.
        bits.lit = __funnelshift_l(c - 1, bits.lit, 1);
        bits.red = __funnelshift_l((c & kBlue << 1) - (l << 1), bits.red, 1);
        bits.green = __funnelshift_l((c & kBlue << 2) - (l << 2), bits.green, 1);
        bits.blue = __funnelshift_l((c & kBlue) - l, bits.blue, 1);
      }
    }
  }
  const auto in_order = [&](uint32_t turned) {
    return ~__funnelshift_l(turned, turned, 32 - begin);
  };
  // A pixel without light is at the lowest level, whatever the least is.
  bits.lit = in_order(bits.lit);
  bits.red = in_order(bits.red) & bits.lit;
  bits.green = in_order(bits.green) & bits.lit;
  bits.blue = in_order(bits.blue) & bits.lit;
  return bits;
}

// The data in memory that writing a region to slice images needs, all requested at once. A warp has
// a plane, which is a slice; each of the first few threads has a tile.
struct PicturesHeld {
  int32_t slice = -1;                     // from the first owned slice; −1: none
  uint32_t slice_dirty = 0, differs = 0;  // of its first slice image
  uint32_t held[3] = {};                  // of that image, this lane's row of bits
  uint32_t tile = kAllLanes, lit = 0;
  uint8_t owner = 0;

  __device__ PicturesHeld(const DrawView& view, const RegionPlace& place) {
    const PackedView& packed = view.packed;
    const int32_t z = place.box.lo[2] + static_cast<int32_t>(threadIdx.x / 32);
    if (z < place.box.hi[2]) slice = __ldg(&packed.slice_of_z[z]);
    if (threadIdx.x < kRegionTiles) {
      tile = place.TileOf(view.volume, threadIdx.x);
      if (tile != kAllLanes) {
        lit = view.volume.lit[tile];
        owner = view.volume.owned[tile];
      }
    }
    if (slice < 0) return;
    slice_dirty = packed.slice_dirty[slice];
    differs = packed.slices.differs[static_cast<uint32_t>(slice) * packed.slices.sub_frames];
    if (packed.slices.finish.format == display::PixelFormat::kBitPlanes) {
      BitsPlace(packed, place, slice, 0).Load(held);
    }
  }
};

// Writes one plane of the region, by a warp: a lane has a row. Returns bits: which sub-frames'
// slice images changed. limit[2]: the existing part of the plane, along x and y.
__device__ inline uint32_t FlushPlane(const PackedView& packed, const RegionPlace& place,
                                      const PicturesHeld& before, const int32_t limit[2],
                                      RegionScratch& scratch) {
  const SliceView& view = packed.slices;
  const uint32_t lane = threadIdx.x % 32, row = threadIdx.x;
  const uint32_t v =
      static_cast<uint32_t>((place.box.lo[1] + static_cast<int32_t>(lane) - packed.y0) *
                            packed.y_step) %
      8;
  const int32_t voxels = static_cast<int32_t>(lane) < limit[1] ? limit[0] : 0;
  uint32_t pictures = 0;
  for (uint32_t sub = 0; sub < view.sub_frames; ++sub) {
    const uint4* const leasts =
        reinterpret_cast<const uint4*>(sub == 0 ? scratch.least : packed.least + sub * 64) + v * 2;
    const BitsPlace bits_place(packed, place, before.slice, sub);
    uint32_t held[3] = {before.held[0], before.held[1], before.held[2]};
    if (sub > 0) bits_place.Load(held);  // they are loaded while the row is read
    const RowBits drawn =
        TakeRow(scratch.words + row * 32, row * 32, voxels, leasts, sub + 1 < view.sub_frames);
    if (sub == 0) {
      // Counts over 16 rows: of the nearer tile in the lower half, of the farther tile in the
      // upper.
      uint32_t counts = static_cast<uint32_t>(__popc(drawn.lit >> 16)) |
                        static_cast<uint32_t>(__popc(drawn.lit & 0xFFFF)) << 16;
      for (int lanes = 8; lanes > 0; lanes /= 2) {
        counts += __shfl_xor_sync(kAllLanes, counts, lanes);
      }
      if (lane % 16 == 0 && counts != 0) {
        atomicAdd(&scratch.lit[lane / 8], counts & 0xFFFF);
        atomicAdd(&scratch.lit[lane / 8 + 1], counts >> 16);
      }
    }
    const uint32_t bits[3] = {drawn.red, drawn.green, drawn.blue};
    const bool differs = bits_place.Put(bits, held);
    if (__any_sync(kAllLanes, differs)) pictures |= 1u << sub;
  }
  return pictures;
}

// Writes directly to the slice images of the slices that are the region's planes: a warp has a
// plane.
static_assert(kDrawWarps == 1u << RegionBits(2));
__device__ inline void FlushToPictures(const DrawView& view, const RegionPlace& place,
                                       RegionScratch& scratch) {
  const PackedView& packed = view.packed;
  const SliceView& slices = packed.slices;
  const uint32_t lane = threadIdx.x % 32, warp = threadIdx.x / 32;
  const int32_t z = place.box.lo[2] + static_cast<int32_t>(warp);
  const bool inside = z < place.box.hi[2];
  const PicturesHeld before(view, place);
  const int32_t s = before.slice;
  const int32_t limit[2] = {inside ? place.box.hi[0] - place.box.lo[0] : 0,
                            inside ? place.box.hi[1] - place.box.lo[1] : 0};
  uint32_t pictures = 0;
  if (slices.finish.format == display::PixelFormat::kBitPlanes) {
    pictures = FlushPlane(packed, place, before, limit, scratch);
  } else {
    const int32_t x = place.box.lo[0] + static_cast<int32_t>(lane);
    for (int32_t y = 0; y < 32; ++y) {
      const uint32_t voxel = warp << 10 | static_cast<uint32_t>(y) << 5 | lane;
      uint32_t& word = scratch.words[voxel];
      const bool here = static_cast<int32_t>(lane) < limit[0] && y < limit[1];
      const uint32_t c = here ? word & kColorMask : 0;
      word = 0;
      const uint32_t lit = __ballot_sync(kAllLanes, c != 0);
      if (lane < 2 && (lit >> 16 * lane & 0xFFFF) != 0) {
        atomicAdd(&scratch.lit[(y >> 4) * 2 + lane], __popc(lit >> 16 * lane & 0xFFFF));
      }
      const int32_t v = (place.box.lo[1] + y - packed.y0) * packed.y_step;
      if (s < 0 || !here || v < 0 || v >= static_cast<int32_t>(slices.height) ||
          x >= static_cast<int32_t>(slices.width)) {
        continue;
      }
      for (uint32_t sub = 0; sub < slices.sub_frames; ++sub) {
        const uint32_t picture = static_cast<uint32_t>(s) * slices.sub_frames + sub;
        if (PutPixel(slices, sub, static_cast<uint32_t>(x), static_cast<uint32_t>(v), c,
                     slices.bytes + static_cast<size_t>(picture) * slices.bytes_per_picture)) {
          pictures |= 1u << sub;
        }
      }
    }
    for (int lanes = 16; lanes > 0; lanes /= 2) {
      pictures |= __shfl_xor_sync(kAllLanes, pictures, lanes);
    }
  }
  if (lane == 0 && pictures != 0) {
    // Usually another region has already marked it.
    if (before.slice_dirty == 0) packed.slice_dirty[s] = 1;
    for (uint32_t sub = 0; sub < slices.sub_frames; ++sub) {
      if ((pictures >> sub & 1) == 0 || (sub == 0 && before.differs != 0)) continue;
      slices.differs[static_cast<uint32_t>(s) * slices.sub_frames + sub] = 1;
    }
  }
  __syncthreads();
  if (before.tile != kAllLanes) {
    PutLit(view.volume, before.tile, before.owner, before.lit, scratch.lit[threadIdx.x], scratch);
  }
}

// Writes to the caller of ReadVoxels.
__device__ inline void FlushToReader(const DrawView& view, const RegionPlace& place,
                                     RegionScratch& scratch) {
  const Box3& box = view.read.box;
#pragma unroll 4
  for (uint32_t j = 0; j < kRounds; ++j) {
    const RowPlace at(place, j);
    const uint32_t drawn = TakeWord(scratch, at);
    if (at.x >= place.box.hi[0] || at.y >= place.box.hi[1] || at.z >= place.box.hi[2]) continue;
    if (!Contains(box, at.x, at.y, at.z)) continue;
    if (place.TileOf(view.volume, at.tile()) == kAllLanes) continue;
    const size_t nx = static_cast<size_t>(box.hi[0] - box.lo[0]),
                 ny = static_cast<size_t>(box.hi[1] - box.lo[1]);
    view.read
        .out[(static_cast<size_t>(at.z - box.lo[2]) * ny + static_cast<size_t>(at.y - box.lo[1])) *
                 nx +
             static_cast<size_t>(at.x - box.lo[0])] = Deinterleave(drawn & kColorMask);
  }
  __syncthreads();
}

}  // namespace voxeld::gpu::cuda
