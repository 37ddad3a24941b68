// Draws a grid of samples in a tile, by a block of threads, as primitives/samples.h defines each
// voxel; terms that are the same for a column of voxels are computed once. For LINEAR numbers, the
// samples around the tile are first loaded into shared memory, if they are not too many: a voxel
// reads eight of them. For a level, the depths of the tile's voxels and of one voxel around it are
// stored there, so that each is computed once.
#pragma once

#include <type_traits>

#include "gpu/cuda/draw_types.h"
#include "gpu/cuda/region_scratch-inl.h"
#include "gpu/primitives/samples.h"
#include "gpu/word.h"

namespace voxeld::gpu::cuda {

// The samples around a tile, and the other data for drawing it.
struct NearSamples {
  static constexpr int32_t kMostSide = 32;  // along x and y
  static constexpr int32_t kMost = 9216;

  uint32_t table[SampleHead::kTableEntries];  // words; 0: nothing
  alignas(16) float step[kTileSize]
                        [4];  // for the voxels of a column: the part of coordinates that changes
  int32_t lo[3], size[3];     // of the samples: from −1 on, which is one before the grid
  bool fit;                   // the samples are not too many
  bool within;                // all voxels are within the grid
  alignas(16) float samples[kMost];  // x fastest; beyond the grid its edge

  // Returns the distance between rows along x.
  __device__ int32_t row() const { return (size[0] + 1) & -2; }
};

struct SampleScratch {
  static constexpr int32_t kRows = kTileSize + 2;
  static constexpr uint32_t kDepths = kRows * kRows * kRows;
  union {
    NearSamples near;
    float depth[kDepths];  // x fastest, from one voxel before the tile on
  };
};

// Reads numbers around a place. `Number` is their type in memory.
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

  // The same as Samples::Find and ValueIn; returns false outside the grid. It has no branches, so
  // that several evaluations overlap: outside, it reads the grid's edge.
  template <bool kNearest>
  __device__ bool Value(const float q[3], float* value) const {
    uint32_t first[3], second[3];
    float t[3];
    bool in = true;
    for (int a = 0; a < 3; ++a) {
      in = in && q[a] >= 0 && q[a] < static_cast<float>(size[a]);
      const int32_t last = static_cast<int32_t>(size[a]) - 1;
      const float p = kNearest ? q[a] : q[a] - 0.5f;
      // A place far outside, which does not fit in an integer, is clamped to the edge.
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

// The grid's coordinates of voxels along z: Solid::Canonical, with the part that does not change
// first.
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

// Finds the samples that voxels need, and the changes of coordinates along columns. Called by a
// warp.
__device__ inline void FindNear(const Solid& s, const SampleHead& head, const Box3& part,
                                NearSamples& near) {
  const int32_t lane = static_cast<int32_t>(threadIdx.x % 32);
  if (lane < kTileSize) {
    const float dz = s.Distance(2, part.lo[2] + lane);
    for (int r = 0; r < 3; ++r) near.step[lane][r] = s.inverse[r][2] * dz;
  }
  int32_t lo = 0, size = 0;
  bool within = true;
  if (lane < 3) {
    // The range of voxels' centres, in double, with a margin for rounding in single precision.
    double low = 0, high = 0, terms = 0;
    for (int c = 0; c < 3; ++c) {
      const double row = static_cast<double>(s.inverse[lane][c]);
      const double from = static_cast<double>(s.Distance(c, part.lo[c])),
                   to = static_cast<double>(s.Distance(c, int64_t{part.hi[c]} - 1));
      low += row < 0 ? row * to : row * from;
      high += row < 0 ? row * from : row * to;
      terms += Abs(row) * Max(Abs(from), Abs(to));
    }
    const double room = 1e-4 + 1e-5 * terms, samples = head.size[lane];
    within = low - room >= 0 && high + room < samples;
    size = NearSamples::kMost + 1;
    constexpr double kFar = 1e9;
    if (low > -kFar && high < kFar) {
      // From the first sample of the first voxel to the second of the last, within the grid and its
      // edge.
      const double first = Clamp(low - room - 0.5, -1.0, samples - 1),
                   last = Clamp(high + room - 0.5, -1.0, samples - 1);
      lo = static_cast<int32_t>(FloorToInt(first));
      size = static_cast<int32_t>(FloorToInt(last)) + 2 - lo;
    }
    near.lo[lane] = lo;
    near.size[lane] = size;
  }
  const bool all_within = __all_sync(kAllLanes, within) != 0;
  const int32_t nx = __shfl_sync(kAllLanes, size, 0), ny = __shfl_sync(kAllLanes, size, 1),
                nz = __shfl_sync(kAllLanes, size, 2);
  if (lane == 0) {
    near.within = all_within;
    near.fit = nx <= NearSamples::kMostSide && ny <= NearSamples::kMostSide &&
               nz <= NearSamples::kMost && ((nx + 1) & -2) * ny * nz <= NearSamples::kMost;
  }
}

// Sixteen threads load a row, two samples each.
template <class Number>
__device__ inline void LoadNear(const SampleReader<Number>& reader, NearSamples& near) {
  const int32_t x = static_cast<int32_t>(threadIdx.x % 16) * 2,
                y = static_cast<int32_t>(threadIdx.x / 16);
  static_assert(kDrawThreads / 16 >= NearSamples::kMostSide);
  if (x >= near.size[0] || y >= near.size[1]) return;
  const auto within = [&](int a, int32_t i) {
    return static_cast<uint32_t>(
        Clamp(near.lo[a] + i, 0, static_cast<int32_t>(reader.size[a]) - 1));
  };
  const uint32_t first = within(0, x), second = within(0, x + 1), in_plane = within(1, y);
  float* to = near.samples + y * near.row() + x;
  const int32_t plane = near.row() * near.size[1];
#pragma unroll 4
  for (int32_t z = 0; z < near.size[2]; ++z, to += plane) {
    const uint32_t row = (within(2, z) * reader.size[1] + in_plane) * reader.size[0];
    *reinterpret_cast<float2*>(to) = make_float2(reader.At(first, row), reader.At(second, row));
  }
}

// A thread handles every second voxel of a column of the tile.
inline constexpr uint32_t kSampleColumns = kTileSize * kTileSize,
                          kSampleStep = kDrawThreads / kSampleColumns;
static_assert(kDrawThreads % kSampleColumns == 0);

// Draws numbers through the table, from samples in shared memory. kPlain: all voxels lie within the
// grid, and no number is NaN. Not inlined, like the functions below: one copy for all types of
// numbers.
template <bool kPlain>
static __device__ __noinline__ void DrawNear(const Solid& s, const SampleHead& head,
                                             const Box3& part) {
  uint32_t* const words = SharedRegion().words;
  const NearSamples& near = SharedBehind<SampleScratch>().near;
  const int32_t x = part.lo[0] + static_cast<int32_t>(threadIdx.x % kTileSize),
                y = part.lo[1] + static_cast<int32_t>(threadIdx.x / kTileSize % kTileSize);
  if (x >= part.hi[0] || y >= part.hi[1]) return;
  const SampleColumn column(s, x, y);
  const float low = head.low, scale = head.scale;
  const uint32_t row = static_cast<uint32_t>(near.row()),
                 plane = row * static_cast<uint32_t>(near.size[1]);
  // Added to −1 or more and rounded down, it leaves the floor in the lower bits.
  constexpr float kWhole = 12582912.0f;  // 1.5 · 2²³
  constexpr uint32_t kWholeBits = 0x4B400000u;
  const auto whole = [](int32_t i) { return kWholeBits + static_cast<uint32_t>(i); };
  const uint32_t from = whole(near.lo[2]) * plane + whole(near.lo[1]) * row + whole(near.lo[0]);
  float limit[3];
  for (int a = 0; a < 3; ++a) limit[a] = static_cast<float>(head.size[a]);
  const int32_t count = part.hi[2] - part.lo[2];
#pragma unroll 2
  for (int32_t z = static_cast<int32_t>(threadIdx.x / kSampleColumns); z < count;
       z += static_cast<int32_t>(kSampleStep)) {
    float t[3];
    uint32_t bits[3];
    bool in = true;
    const float4 step4 = *reinterpret_cast<const float4*>(near.step[z]);
    const float step[3] = {step4.x, step4.y, step4.z};
    for (int a = 0; a < 3; ++a) {
      const float q = column.base[a] + step[a];
      if (!kPlain) in = in && q >= 0 && q < limit[a];
      const float p = q - 0.5f;
      const float floor = __fadd_rd(p, kWhole);
      bits[a] = __float_as_uint(floor);
      t[a] = p - (floor - kWhole);
    }
    if (!in) continue;
    const float* const at = near.samples + (bits[2] * plane + bits[1] * row + bits[0] - from);
    const float *const beside = at + row, *const above = at + plane, *const last = above + row;
    const float corner[8] = {at[0],    at[1],    beside[0], beside[1],
                             above[0], above[1], last[0],   last[1]};
    const float value = Samples::MixCorners(corner, t);
    const float place = (value - low) * scale;
    // NaN becomes 0 here, as in Samples::EntryOf.
    const float entry = fminf(fmaxf(place, 0.0f), 255.0f);
    const uint32_t word = near.table[__float_as_uint(__fadd_rd(entry, kWhole)) & 0xFF];
    if (word == 0 || (!kPlain && implicit::IsNan(value))) continue;
    atomicMax(&words[IndexInRegion(x, y, part.lo[2] + z)], word);
  }
}

// Prepares the table's words and, for LINEAR numbers, the samples that the tile's voxels need.
// Called by the whole block.
static __device__ __noinline__ void PrepareNumbers(const TableEntry& entry, const Box3& part) {
  NearSamples& near = SharedBehind<SampleScratch>().near;
  const Source& source = entry.source;
  const SampleView view{source.indices};
  for (uint32_t i = threadIdx.x; i < SampleHead::kTableEntries; i += kDrawThreads) {
    const uint32_t color = view.table()[i];
    near.table[i] =
        (color & SampleHead::kDrawn) != 0
            ? MakeWord(entry.priority, entry.erase != 0, Tinted(color & 0x00FFFFFF, source.tint))
            : 0;
  }
  if (view.head().filter != SampleFilter::kNearest && threadIdx.x >= kDrawThreads - 32) {
    FindNear(source.solid, view.head(), part, near);
  }
  __syncthreads();
}

// Draws numbers through the table.
template <class Number, bool kNearest>
__device__ void DrawNumbers(const TableEntry& entry, const SampleView& view, const Box3& part,
                            uint32_t* words, SampleScratch& scratch) {
  const Source& source = entry.source;
  const SampleReader<Number> reader(view);
  NearSamples& near = scratch.near;
  PrepareNumbers(entry, part);
  if constexpr (!kNearest) {
    if (near.fit) {
      LoadNear(reader, near);
      __syncthreads();
      if (near.within && !std::is_same_v<Number, float>) {
        DrawNear<true>(source.solid, view.head(), part);
      } else {
        DrawNear<false>(source.solid, view.head(), part);
      }
      __syncthreads();
      return;
    }
  }
  const float low = view.head().low, scale = view.head().scale;
  const int32_t nx = part.hi[0] - part.lo[0], ny = part.hi[1] - part.lo[1];
  constexpr uint32_t kColumns = kSampleColumns, kStep = kSampleStep;
  constexpr int32_t kAtOnce = 4;  // voxels
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
            near.table[place > 0 ? (place >= 255.0f ? 255 : static_cast<uint32_t>(place)) : 0];
        if (word != 0) atomicMax(&words[IndexInRegion(x, y, at)], word);
      }
    }
  }
  __syncthreads();
}

// Computes the depths of the tile's voxels and those around it. Called by the whole block.
template <class Number, bool kNearest>
__device__ void FindDepths(const TableEntry& entry, const SampleView& view, const Box3& part,
                           SampleScratch& scratch) {
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
}

// Raises the voxels that are covered according to the depths, as Samples::IsAtLevel. Called by the
// whole block.
static __device__ __noinline__ void RaiseLevel(const TableEntry& entry, const Box3& part) {
  constexpr int32_t kRows = SampleScratch::kRows;
  uint32_t* const words = SharedRegion().words;
  const SampleScratch& scratch = SharedBehind<SampleScratch>();
  const Source& source = entry.source;
  const SampleView view{source.indices};
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
    // Tests whether a neighbour is on the other side, and not nearer to the level.
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

// Draws any grid: colours, and grids with more samples than 32 bits can count.
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
    nearest ? FindDepths<Number, true>(entry, view, part, scratch)
            : FindDepths<Number, false>(entry, view, part, scratch);
    return RaiseLevel(entry, part);
  }
  return nearest ? DrawNumbers<Number, true>(entry, view, part, words, scratch)
                 : DrawNumbers<Number, false>(entry, view, part, words, scratch);
}

static __device__ __noinline__ void DrawSamples(const TableEntry& entry, const Box3& box) {
  uint32_t* const words = SharedRegion().words;
  SampleScratch& scratch = SharedBehind<SampleScratch>();
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
