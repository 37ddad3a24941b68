// Draws the slice images of dirty slices: sampled through footprints, toned, dithered, packed, and
// compared with the previous bytes, in one pass.
#include "gpu/cuda/kernels.h"
#include "gpu/cuda/pixels-inl.h"
#include "gpu/slice/finish.h"
#include "gpu/slice/weight.h"
#include "gpu/word.h"

namespace voxeld::gpu::cuda {
namespace {

constexpr uint32_t kThreads = 256;
constexpr uint32_t kColumns = 8;           // of a slice, per block: the pixels of a byte of bits
constexpr uint32_t kLineBytes = 48 << 10;  // of shared memory, for columns of voxels
constexpr uint32_t kAll = 0xFFFFFFFFu;

__device__ uint32_t ColorAt(const VolumeView& volume, int32_t x, int32_t y, int32_t z) {
  const uint32_t tile = volume.grid.TileOf(x, y, z);
  if (volume.lit[tile] == 0) return 0;
  return volume.colors[static_cast<size_t>(tile) * kTileVoxels + volume.grid.IndexInTile(x, y, z)];
}

// Returns the colour of the voxel `along` further on the inner axis.
__device__ uint32_t ColorAlong(const VolumeView& volume, uint32_t axis,
                               const display::FootprintEntry& outer, int32_t along) {
  return ColorAt(volume, outer.x + (axis == 0 ? along : 0), outer.y + (axis == 1 ? along : 0),
                 outer.z + (axis == 2 ? along : 0));
}

__device__ int32_t Along(uint32_t axis, const display::FootprintEntry& inner) {
  return axis == 0 ? inner.x : axis == 1 ? inner.y : inner.z;
}

struct Rows {
  const display::FootprintEntry* begin;
  const display::FootprintEntry* end;
};

__device__ Rows OuterOf(const SliceView& view, uint32_t slice, uint32_t u) {
  const uint32_t* row = view.outer.begin + static_cast<size_t>(slice) * view.columns + u;
  return {view.outer.entries + row[0], view.outer.entries + row[1]};
}

__device__ Rows InnerOf(const SliceView& view, uint32_t slice, uint32_t v) {
  const uint32_t* row =
      view.inner.begin + static_cast<size_t>(slice % view.inner_sets) * view.height + v;
  return {view.inner.entries + row[0], view.inner.entries + row[1]};
}

// Returns 0x00RRGGBB. The maximum over a product of lists is the maximum, over the inner list, of
// the maximum over the outer: `line`, if not null, has the latter.
__device__ uint32_t SampleMax(const VolumeView& volume, const SliceView& view, uint32_t slice,
                              uint32_t u, uint32_t v, const uint32_t* line) {
  uint32_t greatest = 0;
  const Rows inner = InnerOf(view, slice, v);
  for (const display::FootprintEntry* i = inner.begin; i != inner.end; ++i) {
    const int32_t along = Along(view.inner_axis, *i);
    if (line != nullptr) {
      greatest = Max(greatest, line[along]);
      continue;
    }
    const Rows outer = OuterOf(view, slice, u);
    for (const display::FootprintEntry* o = outer.begin; o != outer.end; ++o) {
      greatest = Max(greatest, ColorAlong(volume, view.inner_axis, *o, along));
    }
  }
  return Deinterleave(greatest);
}

__device__ uint32_t SampleWeighted(const VolumeView& volume, const SliceView& view, uint32_t slice,
                                   uint32_t u, uint32_t v) {
  uint32_t rgb = 0;
  const Rows outer = OuterOf(view, slice, u), inner = InnerOf(view, slice, v);
  for (const display::FootprintEntry* o = outer.begin; o != outer.end; ++o) {
    for (const display::FootprintEntry* i = inner.begin; i != inner.end; ++i) {
      const uint32_t color = ColorAlong(volume, view.inner_axis, *o, Along(view.inner_axis, *i));
      if (color == 0) continue;
      rgb = RaiseWeighted(rgb, FootprintWeight(o->weight, i->weight), Deinterleave(color));
    }
  }
  return rgb;
}

// For bit planes: 8 neighbouring lanes together write a byte of each plane.
__device__ bool PutBits(const SliceView& view, uint32_t u, uint32_t v, bool inside, Levels q,
                        uint8_t* picture) {
  const size_t row = (view.width + 7) / 8, plane = row * view.height;
  const uint32_t first = threadIdx.x % 32 & ~7u;
  bool differs = false;
  const uint32_t levels[3] = {q.r, q.g, q.b};
  uint8_t* byte = picture + v * row + u / 8;
  for (uint32_t bit = view.finish.bits; bit-- > 0;) {
    for (size_t c = 0; c < 3; ++c, byte += plane) {
      const uint32_t lanes = __ballot_sync(kAll, inside && (levels[c] >> bit & 1) != 0);
      const uint32_t value = __brev(lanes >> first & 0xFF) >> 24;
      if (inside && u % 8 == 0) differs |= PutByte(byte, value);
    }
  }
  return differs;
}

// For rows side by side: a byte has a pixel of the upper half and one of the lower, which different
// threads write.
__device__ bool PutPaired(const SliceView& view, uint32_t u, uint32_t v, Levels q,
                          uint8_t* picture) {
  const uint32_t half = view.height / 2, shift = v < half ? 0 : 3;
  uint8_t* byte = picture + static_cast<size_t>(v % half) * view.width + u;
  bool differs = false;
  for (uint32_t bit = view.finish.bits; bit-- > 0; byte += static_cast<size_t>(half) * view.width) {
    const uint32_t rgb = (q.r >> bit & 1) | (q.g >> bit & 1) << 1 | (q.b >> bit & 1) << 2;
    const uintptr_t place = reinterpret_cast<uintptr_t>(byte), within = place % sizeof(uint32_t);
    uint32_t* const word = reinterpret_cast<uint32_t*>(place - within);
    const uint32_t at = static_cast<uint32_t>(within) * 8 + shift;
    // Only this thread changes these bits.
    const uint32_t change = (*static_cast<volatile uint32_t*>(word) >> at & 7) ^ rgb;
    if (change == 0) continue;
    atomicXor(word, change << at);
    differs = true;
  }
  return differs;
}

// Writes a pixel's levels to its slice image, by 8 neighbouring lanes at once.
__device__ bool PutPixel(const SliceView& view, uint32_t u, uint32_t v, bool inside, Levels q,
                         uint8_t* picture) {
  switch (view.finish.format) {
    case display::PixelFormat::kRgb888:
    case display::PixelFormat::kRgb332:
    case display::PixelFormat::kPlanes24:
      return inside && PutLevels(view, u, v, q, picture);
    case display::PixelFormat::kBitPlanes:
      return PutBits(view, u, v, inside, q, picture);
    case display::PixelFormat::kHub75:
      return inside && PutPaired(view, u, v, q, picture);
  }
  return false;
}

// The place of a pixel in a slice image and in the outer footprints.
struct PixelPlace {
  uint32_t slice, u, v;  // slice: among all slices
  size_t row;
  bool inside;
};

// Writes a pixel's colour to the slice images of the owned slice `s`, by 8 neighbouring lanes at
// once.
__device__ void PutToned(const SliceView& view, uint32_t s, const PixelPlace& at, uint32_t rgb) {
  const Finish& finish = view.finish;
  const Light light = rgb != 0 ? finish.LightAt(rgb, at.row) : Light{0, 0, 0};
  for (uint32_t sub = 0; sub < view.sub_frames; ++sub) {
    // A pixel without light is at the lowest level, whatever the threshold is.
    Levels q = {0, 0, 0};
    if (rgb != 0) q = finish.LevelsAt(light, at.slice, at.u, at.v, sub);
    const uint32_t picture = s * view.sub_frames + sub;
    if (PutPixel(view, at.u, at.v, at.inside, q,
                 view.bytes + static_cast<size_t>(picture) * view.bytes_per_picture)) {
      view.differs[picture] = 1;
    }
  }
}

// For displays whose pixels each have a list of their own: a thread per pixel.
__global__ void DrawFlatKernel(VolumeView volume, SliceIndexView index, SliceView view,
                               uint32_t begin) {
  const uint32_t s = begin + blockIdx.y;
  if (index.dirty[s] == 0) return;
  const bool blank = index.lit_tiles[s] == 0;
  if (blank && view.blank[s] != 0) return;
  const uint32_t slice = static_cast<uint32_t>(index.first) + s;
  const uint32_t pixel = blockIdx.x * kThreads + threadIdx.x;
  const uint32_t u = pixel % view.flat_row, v = pixel / view.flat_row;
  const bool inside = v < view.height && u < view.width;
  uint32_t rgb = 0;
  if (inside && !blank) {
    rgb = view.sampling == display::Sampling::kWeighted
              ? SampleWeighted(volume, view, slice, pixel, 0)
              : SampleMax(volume, view, slice, pixel, 0, nullptr);
  }
  PutToned(view, s, {slice, u, v, static_cast<size_t>(slice) * view.columns + pixel, inside}, rgb);
}

__global__ void DrawSlicesKernel(VolumeView volume, SliceIndexView index, SliceView view,
                                 uint32_t begin, bool with_line) {
  extern __shared__ uint32_t lines[];  // kColumns of view.line voxels
  const uint32_t s = begin + blockIdx.y;
  if (index.dirty[s] == 0) return;
  const bool blank = index.lit_tiles[s] == 0;
  if (blank && view.blank[s] != 0) return;
  const uint32_t slice = static_cast<uint32_t>(index.first) + s;
  const uint32_t u0 = blockIdx.x * kColumns;
  if (with_line && !blank) {
    for (uint32_t i = threadIdx.x; i < kColumns * view.line; i += kThreads) {
      const uint32_t u = u0 + i / view.line;
      uint32_t greatest = 0;
      if (u < view.width) {
        const Rows outer = OuterOf(view, slice, u);
        for (const display::FootprintEntry* o = outer.begin; o != outer.end; ++o) {
          greatest = Max(greatest, ColorAlong(volume, view.inner_axis, *o,
                                              static_cast<int32_t>(i % view.line)));
        }
      }
      lines[i] = greatest;
    }
    __syncthreads();
  }
  const uint32_t pixels = kColumns * view.height;
  for (uint32_t p = threadIdx.x; p < (pixels + kThreads - 1) / kThreads * kThreads; p += kThreads) {
    const uint32_t column = p % kColumns, u = u0 + column, v = p / kColumns;
    const bool inside = v < view.height && u < view.width;
    uint32_t rgb = 0;
    if (inside && !blank) {
      rgb = view.sampling == display::Sampling::kWeighted
                ? SampleWeighted(volume, view, slice, u, v)
                : SampleMax(volume, view, slice, u, v,
                            with_line ? lines + column * view.line : nullptr);
    }
    PutToned(view, s, {slice, u, v, static_cast<size_t>(slice) * view.columns + u, inside}, rgb);
  }
}

__device__ void EndSlice(const SliceIndexView& index, const SliceView& view, uint32_t s,
                         uint64_t frame, bool sampled, Counters* counters) {
  if (index.dirty[s] == 0) return;
  index.dirty[s] = 0;
  view.blank[s] = sampled && index.lit_tiles[s] == 0 ? 1 : 0;
  uint32_t changed = 0;
  for (uint32_t sub = 0; sub < view.sub_frames; ++sub) {
    const uint32_t picture = s * view.sub_frames + sub;
    if (view.differs[picture] != 0 || view.changed_in[picture] == 0) {
      view.differs[picture] = 0;
      view.changed_in[picture] = view.told[picture] = frame;
      ++changed;
    }
  }
  atomicAdd(&counters->slices_drawn, 1u);
  if (changed != 0) atomicAdd(&counters->pictures_changed, changed);
}

__device__ void TellAndClear(volatile Counters& counters, Counters& told) {
  told.tiles_drawn = counters.tiles_drawn;
  told.slices_drawn = counters.slices_drawn;
  told.pictures_changed = counters.pictures_changed;
  told.lit_voxels = counters.lit_voxels;
  counters.tiles_drawn = 0;
  counters.slices_drawn = 0;
  counters.pictures_changed = 0;
  counters.ended = 0;
  for (uint32_t g = 0; g < kMostDrawGroups; ++g) {
    counters.dirty[g] = 0;
    counters.taken[g] = 0;
  }
}

__global__ void EndSlicesKernel(SliceIndexView index, SliceView view, uint32_t begin,
                                uint32_t count, uint64_t frame, bool sampled, Counters* counters,
                                Counters* told) {
  const uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i < count) EndSlice(index, view, begin + i, frame, sampled, counters);
  if (told == nullptr) return;
  __syncthreads();
  if (threadIdx.x != 0) return;
  __threadfence();
  if (atomicAdd(&counters->ended, 1u) + 1 < gridDim.x) return;
  __threadfence();
  TellAndClear(*counters, *told);
}

}  // namespace

cudaError_t DrawSlices(const VolumeView& volume, const SliceIndexView& index, const SliceView& view,
                       uint32_t begin, uint32_t count, uint64_t frame, Counters* told,
                       cudaStream_t stream) {
  const size_t line_bytes = sizeof(uint32_t) * kColumns * view.line;
  const bool with_line = view.sampling == display::Sampling::kMax && line_bytes <= kLineBytes;
  if (count > 0 && view.flat_row > 0) {
    const dim3 grid((view.columns + kThreads - 1) / kThreads, count);
    DrawFlatKernel<<<grid, kThreads, 0, stream>>>(volume, index, view, begin);
  } else if (count > 0) {
    const dim3 grid((view.width + kColumns - 1) / kColumns, count);
    DrawSlicesKernel<<<grid, kThreads, with_line ? line_bytes : 0, stream>>>(volume, index, view,
                                                                             begin, with_line);
  }
  if (const cudaError_t error = cudaGetLastError(); error != cudaSuccess) return error;
  return EndSlices(volume, index, view, begin, count, frame, true, told, stream);
}

cudaError_t EndSlices(const VolumeView& volume, const SliceIndexView& index, const SliceView& view,
                      uint32_t begin, uint32_t count, uint64_t frame, bool sampled, Counters* told,
                      cudaStream_t stream) {
  EndSlicesKernel<<<Max(1u, (count + kThreads - 1) / kThreads), kThreads, 0, stream>>>(
      index, view, begin, count, frame, sampled, volume.counters, told);
  return cudaGetLastError();
}

}  // namespace voxeld::gpu::cuda
