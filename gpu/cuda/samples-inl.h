// A grid of samples in a tile, by a block of threads: what primitives/samples.h says of each voxel, with what
// is the same for a column of them worked out once. At a level, depths go into shared memory first, of the tile
// and one voxel around it, so that each is worked out once.
#pragma once

#include "gpu/cuda/draw_types.h"
#include "gpu/cuda/region_scratch-inl.h"
#include "gpu/primitives/samples.h"
#include "gpu/word.h"

namespace voxeld::gpu::cuda {

struct SampleScratch {
  static constexpr int32_t kRows = kTileSize + 2;
  static constexpr uint32_t kDepths = kRows * kRows * kRows;
  union {
    uint32_t table[SampleHead::kTableEntries];  // words; 0: nothing
    float depth[kDepths];                       // x fastest, from one voxel before the tile on
  };
};

// Numbers around a place. `Number` is how they lie in memory.
template <class Number>
struct SampleReader {
  const Number* samples;
  uint32_t size[3];

  __device__ explicit SampleReader(const SampleView& view)
      : samples(reinterpret_cast<const Number*>(view.samples())),
        size{view.head().size[0], view.head().size[1], view.head().size[2]} {}

  __device__ float At(uint32_t x, uint32_t row) const {
    return static_cast<float>(__ldg(samples + row + x));
  }

  // As Samples::Find and ValueIn; false outside of the grid. Without branches, so that several go on at once:
  // outside, what is read is the grid's edge.
  template <bool kNearest>
  __device__ bool Value(const float q[3], float* value) const {
    uint32_t first[3], second[3];
    float t[3];
    bool in = true;
    for (int a = 0; a < 3; ++a) {
      in = in && q[a] >= 0 && q[a] < static_cast<float>(size[a]);
      const int32_t last = static_cast<int32_t>(size[a]) - 1;
      const float p = kNearest ? q[a] : q[a] - 0.5f;
      // Of what is far outside, which fits no whole number, a place at the edge.
      const int32_t whole = static_cast<int32_t>(Clamp(p, 0.0f, static_cast<float>(last)));
      const int32_t below = !kNearest && p < 0 ? -1 : whole;
      first[a] = static_cast<uint32_t>(Clamp(below, 0, last));
      second[a] = static_cast<uint32_t>(Clamp(below + 1, 0, last));
      t[a] = p - static_cast<float>(below);
    }
    const uint32_t near = first[2] * size[1], far = second[2] * size[1];
    const uint32_t row0 = (near + first[1]) * size[0];
    if (kNearest) {
      *value = At(first[0], row0);
      return in;
    }
    const uint32_t row1 = (near + second[1]) * size[0], row2 = (far + first[1]) * size[0],
                   row3 = (far + second[1]) * size[0];
    const float corner[8] = {At(first[0], row0),  At(second[0], row0), At(first[0], row1),
                             At(second[0], row1), At(first[0], row2),  At(second[0], row2),
                             At(first[0], row3),  At(second[0], row3)};
    *value = Samples::MixCorners(corner, t);
    return in;
  }
};

// The grid's coordinates of voxels along z: Solid::Canonical, with the part that does not change first.
struct SampleColumn {
  float base[3];

  __device__ SampleColumn(const Solid& s, int32_t x, int32_t y) {
    const float dx = s.Distance(0, x), dy = s.Distance(1, y);
    for (int r = 0; r < 3; ++r) base[r] = s.inverse[r][0] * dx + s.inverse[r][1] * dy;
  }
  __device__ void At(const Solid& s, int32_t z, float q[3]) const {
    const float dz = s.Distance(2, z);
    for (int r = 0; r < 3; ++r) q[r] = base[r] + s.inverse[r][2] * dz;
  }
};

// Numbers through the table.
template <class Number, bool kNearest>
__device__ void DrawNumbers(const TableEntry& entry, const SampleView& view, const Box3& part,
                            uint32_t* words, SampleScratch& scratch) {
  const Source& source = entry.source;
  for (uint32_t i = threadIdx.x; i < SampleHead::kTableEntries; i += kDrawThreads) {
    const uint32_t color = view.table()[i];
    scratch.table[i] =
        (color & SampleHead::kDrawn) != 0
            ? MakeWord(entry.priority, entry.erase != 0, Tinted(color & 0x00FFFFFF, source.tint))
            : 0;
  }
  __syncthreads();
  const SampleReader<Number> reader(view);
  const float low = view.head().low, scale = view.head().scale;
  const int32_t nx = part.hi[0] - part.lo[0], ny = part.hi[1] - part.lo[1];
  // A thread has every second voxel of a column of the tile, four at once.
  constexpr uint32_t kColumns = kTileSize * kTileSize, kStep = kDrawThreads / kColumns;
  constexpr int32_t kAtOnce = 4;
  static_assert(kDrawThreads % kColumns == 0);
  const int32_t i = static_cast<int32_t>(threadIdx.x % kTileSize),
                j = static_cast<int32_t>(threadIdx.x / kTileSize % kTileSize);
  if (i < nx && j < ny) {
    const int32_t x = part.lo[0] + i, y = part.lo[1] + j;
    const SampleColumn column(source.solid, x, y);
    for (int32_t z = part.lo[2] + static_cast<int32_t>(threadIdx.x / kColumns); z < part.hi[2];
         z += static_cast<int32_t>(kStep) * kAtOnce) {
      float value[kAtOnce];
      bool in[kAtOnce];
#pragma unroll
      for (int32_t k = 0; k < kAtOnce; ++k) {
        float q[3];
        column.At(source.solid, z + k * static_cast<int32_t>(kStep), q);
        in[k] = reader.template Value<kNearest>(q, &value[k]);
      }
#pragma unroll
      for (int32_t k = 0; k < kAtOnce; ++k) {
        const int32_t at = z + k * static_cast<int32_t>(kStep);
        if (!in[k] || at >= part.hi[2] || implicit::IsNan(value[k])) continue;
        const float place = (value[k] - low) * scale;
        const uint32_t word =
            scratch.table[place > 0 ? (place >= 255.0f ? 255 : static_cast<uint32_t>(place)) : 0];
        if (word != 0) atomicMax(&words[IndexInRegion(x, y, at)], word);
      }
    }
  }
  __syncthreads();
}

// As Samples::IsAtLevel.
template <class Number, bool kNearest>
__device__ void DrawLevel(const TableEntry& entry, const SampleView& view, const Box3& part,
                          uint32_t* words, SampleScratch& scratch) {
  constexpr int32_t kRows = SampleScratch::kRows;
  const Source& source = entry.source;
  const SampleReader<Number> reader(view);
  const float level = view.head().level;
  constexpr uint32_t kAtOnce = 4;
  for (uint32_t begin = threadIdx.x; begin < SampleScratch::kDepths;
       begin += kDrawThreads * kAtOnce) {
    float value[kAtOnce];
    bool in[kAtOnce];
#pragma unroll
    for (uint32_t k = 0; k < kAtOnce; ++k) {
      const uint32_t i = begin + k * kDrawThreads;
      const int32_t x = part.lo[0] - 1 + static_cast<int32_t>(i % kRows),
                    y = part.lo[1] - 1 + static_cast<int32_t>(i / kRows % kRows),
                    z = part.lo[2] - 1 + static_cast<int32_t>(i / kRows / kRows);
      float q[3];
      source.solid.Canonical(source.solid.Distance(0, x), source.solid.Distance(1, y),
                             source.solid.Distance(2, z), q);
      in[k] = reader.template Value<kNearest>(q, &value[k]);
    }
#pragma unroll
    for (uint32_t k = 0; k < kAtOnce; ++k) {
      const uint32_t i = begin + k * kDrawThreads;
      const float depth = level - value[k];
      if (i < SampleScratch::kDepths) {
        scratch.depth[i] = in[k] && !implicit::IsNan(depth) ? depth : implicit::Infinity();
      }
    }
  }
  __syncthreads();
  const bool solid = source.record->fill == Fill::kSolid,
             cover = source.record->rule == SurfaceRule::kCover, shell = source.implicit.half > 0,
             colored = view.head().by_level == 2;
  const uint32_t word = MakeWord(entry.priority, entry.erase != 0, source.UniformColor());
  const int32_t n[3] = {part.hi[0] - part.lo[0], part.hi[1] - part.lo[1], part.hi[2] - part.lo[2]};
  for (int32_t i = static_cast<int32_t>(threadIdx.x); i < n[0] * n[1] * n[2]; i += kDrawThreads) {
    const int32_t x = i % n[0], y = i / n[0] % n[1], z = i / n[0] / n[1];
    const float* const at = &scratch.depth[((z + 1) * kRows + y + 1) * kRows + x + 1];
    const float depth = *at;
    const bool inside = depth <= 0;
    bool covered = solid && inside;
    // Of a neighbour: it is on the other side, and not nearer to the level.
    const auto faces = [&](int32_t step) {
      const float other = at[step];
      return (other <= 0) != inside && Abs(depth) <= Abs(other);
    };
    if (!solid && !cover) {
      constexpr int32_t kY = kRows, kZ = kRows * kRows;
      covered = faces(-1) || faces(1) || faces(-kY) || faces(kY) || faces(-kZ) || faces(kZ);
    } else if (!solid) {
      for (int32_t k = 0; k < 27 && !covered; ++k) {
        if (k != 13) covered = faces(((k / 9 - 1) * kRows + k / 3 % 3 - 1) * kRows + k % 3 - 1);
      }
    }
    if (!solid && !covered && shell && depth < implicit::Infinity()) {
      covered = Samples::IsWithinShell(source, view, part.lo[0] + x, part.lo[1] + y, part.lo[2] + z,
                                       depth);
    }
    if (covered) {
      const int32_t at_x = part.lo[0] + x, at_y = part.lo[1] + y, at_z = part.lo[2] + z;
      atomicMax(&words[IndexInRegion(at_x, at_y, at_z)],
                colored ? MakeWord(entry.priority, entry.erase != 0,
                                   Samples::ColorAtLevel(source, view, at_x, at_y, at_z))
                        : word);
    }
  }
  __syncthreads();
}

// Of any kind: colours, and grids with more samples than 32 bits count.
__device__ inline void DrawAnySamples(const TableEntry& entry, const Box3& part, uint32_t* words) {
  const uint32_t nx = static_cast<uint32_t>(part.hi[0] - part.lo[0]),
                 ny = static_cast<uint32_t>(part.hi[1] - part.lo[1]),
                 nz = static_cast<uint32_t>(part.hi[2] - part.lo[2]);
  for (uint32_t i = threadIdx.x; i < nx * ny * nz; i += kDrawThreads) {
    const int32_t x = part.lo[0] + static_cast<int32_t>(i % nx),
                  y = part.lo[1] + static_cast<int32_t>(i / nx % ny),
                  z = part.lo[2] + static_cast<int32_t>(i / nx / ny);
    uint32_t rgb;
    if (!Samples::Covers(entry.source, x, y, z, &rgb)) continue;
    atomicMax(&words[IndexInRegion(x, y, z)], MakeWord(entry.priority, entry.erase != 0, rgb));
  }
}

template <class Number>
__device__ void DrawSamplesOf(const TableEntry& entry, const SampleView& view, const Box3& part,
                              uint32_t* words, SampleScratch& scratch) {
  const bool nearest = view.head().filter == SampleFilter::kNearest;
  if (view.head().by_level != 0) {
    return nearest ? DrawLevel<Number, true>(entry, view, part, words, scratch)
                   : DrawLevel<Number, false>(entry, view, part, words, scratch);
  }
  return nearest ? DrawNumbers<Number, true>(entry, view, part, words, scratch)
                 : DrawNumbers<Number, false>(entry, view, part, words, scratch);
}

static __device__ __noinline__ void DrawSamples(const TableEntry& entry, const Box3& box,
                                                uint32_t* words, SampleScratch& scratch) {
  const Box3 part = Intersect(box, entry.source.solid.bounds);
  if (IsEmpty(part)) return;  // the same for every thread
  const SampleView view{entry.source.indices};
  const SampleHead& head = view.head();
  const bool counted =
      static_cast<uint64_t>(head.size[0]) * head.size[1] * head.size[2] <= 0xFFFFFFFFu;
  const SampleFormat format = counted ? head.format : SampleFormat::kRgba8;
  switch (format) {
    case SampleFormat::kU8:
      return DrawSamplesOf<uint8_t>(entry, view, part, words, scratch);
    case SampleFormat::kU16:
      return DrawSamplesOf<uint16_t>(entry, view, part, words, scratch);
    case SampleFormat::kF32:
      return DrawSamplesOf<float>(entry, view, part, words, scratch);
    default:
      return DrawAnySamples(entry, part, words);
  }
}

}  // namespace voxeld::gpu::cuda
