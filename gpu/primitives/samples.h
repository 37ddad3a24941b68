// Numbers, or colours, on a grid, under any transform: drawn as a volume through a table of
// colours, or as the surface at a level.
//
// The geometry's coordinates count samples: sample i of an axis has its centre at i + ½, and the
// grid fills 0 to n. A voxel has the grid's value at its centre (solid.h's coordinates, in single
// precision): for LINEAR grids the mean of the eight samples around it, weighted by distance, for
// NEAREST grids the sample whose cell holds it. Beyond the outermost centres these values continue.
// Outside the grid there is nothing.
//
//   volume   a value v is the entry ⌊(v − low)·scale⌋ of the table, 0 to 255. Entries without the
//            bit kDrawn cover nothing, and neither does NaN. Colours stand for themselves:
//            c·a/255, nothing if a is 0.
//   level    a voxel is inside if v ≥ level. SOLID covers the inside; SURFACE is defined by
//            |level − v| ≤ h·|∇v|, and by the neighbours on either side, as in
//            gpu/implicit/field.h, where nothing counts as outside and infinite. It has the
//            geometry's colour; or the colour of the place of the voxel's centre q: the entry
//            ⌊((p0·qx + p1·qy) + p2·qz) + p3⌋ of the table, 0 to 255, where p are the record's
//            params.
//
// Guarantee: numbers at voxels' centres are within 10⁻⁴ of double precision, and a colour is within
// one of the 256 steps of its table. Isosurfaces have the guarantees of surfaces in
// gpu/implicit/field.h, and their volumes are right within 1 % at a radius of 20 voxels.
#pragma once

#include "gpu/implicit/number.h"
#include "gpu/primitives/blocks.h"
#include "gpu/primitives/grid.h"
#include "gpu/primitives/source.h"

namespace voxeld::gpu {

enum class SampleFormat : uint32_t { kU8 = 0, kU16 = 1, kF32 = 2, kRgba8 = 3 };
enum class SampleFilter : uint32_t { kLinear = 0, kNearest = 1 };

// The contents of the indices of a kSamples: this head, the table, the bricks, then the samples, x
// fastest.
struct SampleHead {
  static constexpr uint32_t kTableEntries = 256;
  static constexpr uint32_t kDrawn = 1u << 24;  // in an entry, together with 0xRRGGBB
  static constexpr uint32_t kBrick = 8;         // samples along an edge
  static constexpr uint32_t kMostAlong = 1u << 16;

  // Returns the number of words that this many samples fill.
  static constexpr uint64_t WordsOf(SampleFormat format, uint64_t samples) {
    const uint64_t each = format == SampleFormat::kU8 ? 4 : format == SampleFormat::kU16 ? 2 : 1;
    return (samples + each - 1) / each;
  }

  uint32_t size[3];  // samples, 1 or more each
  SampleFormat format;
  SampleFilter filter;
  uint32_t by_level;  // the surface, or the solid, at `level`; 2: coloured by the place
  float low, scale;   // of the table
  float level;
  uint32_t
      bricks;  // words of bricks: a bit each, x fastest, 1 if anything in the brick may be covered
  uint32_t reserved[2];
};
inline constexpr uint32_t kSampleHeadWords = sizeof(SampleHead) / sizeof(uint32_t);

// The indices of a kSamples.
struct SampleView {
  const uint32_t* words;

  VOXELD_HD const SampleHead& head() const { return *reinterpret_cast<const SampleHead*>(words); }
  VOXELD_HD const uint32_t* table() const { return words + kSampleHeadWords; }
  VOXELD_HD const uint32_t* bricks() const { return table() + SampleHead::kTableEntries; }
  VOXELD_HD const uint32_t* samples() const { return bricks() + head().bricks; }

  VOXELD_HD uint64_t IndexOf(int32_t x, int32_t y, int32_t z) const {
    const uint32_t* n = head().size;
    return (static_cast<uint64_t>(z) * n[1] + static_cast<uint64_t>(y)) * n[0] +
           static_cast<uint64_t>(x);
  }
  VOXELD_HD uint32_t Word(uint64_t i) const { return samples()[i]; }
  VOXELD_HD float Number(uint64_t i) const {
    switch (head().format) {
      case SampleFormat::kU8:
        return static_cast<float>(reinterpret_cast<const uint8_t*>(samples())[i]);
      case SampleFormat::kU16:
        return static_cast<float>(reinterpret_cast<const uint16_t*>(samples())[i]);
      default:
        return reinterpret_cast<const float*>(samples())[i];
    }
  }
  VOXELD_HD bool BrickIsSet(int32_t x, int32_t y, int32_t z) const {
    constexpr uint32_t kBrick = SampleHead::kBrick;
    const uint32_t nx = (head().size[0] + kBrick - 1) / kBrick,
                   ny = (head().size[1] + kBrick - 1) / kBrick;
    const uint64_t i =
        (static_cast<uint64_t>(z) * ny + static_cast<uint64_t>(y)) * nx + static_cast<uint64_t>(x);
    return (bricks()[i / 32] >> (i % 32) & 1) != 0;
  }
};

struct Samples {
  static constexpr PrimitiveKind kKind = PrimitiveKind::kSamples;

  // Sets the place of the shape, as Implicit::Place does.
  static void Place(const GeometryRecord& g, const uint32_t* words, const Affine& map,
                    const TileGrid& grid, int32_t tiles, Solid& solid, ImplicitPlace& place) {
    solid = Solid::Of(map, /*keep_thin=*/false);
    place.half = static_cast<float>(RadiusOf(g, map)) * 0.00390625f;
    const uint32_t* const size = SampleView{words}.head().size;
    const double low[3] = {0, 0, 0};
    const double high[3] = {static_cast<double>(size[0]), static_cast<double>(size[1]),
                            static_cast<double>(size[2])};
    SetBlocks(VoxelsAround(low, high, map, grid, 0), tiles, solid, place);
  }

  VOXELD_HD static uint32_t Count(const Source& source) { return CountBlocks(source); }

  template <class Emit>
  VOXELD_HD static void EmitTiles(const Source& source, uint32_t i, const TileGrid& grid,
                                  Emit&& emit) {
    const Box3 block = BlockOf(source, i);
    if (IsEmpty(block)) return;
    EmitTilesOfBox(block, grid, [&](uint32_t tile) {
      if (MayHave(source, Intersect(block, grid.VoxelsOf(tile)))) emit(tile);
    });
  }

  template <class Emit>
  VOXELD_HD static void EmitVoxels(const Source& source, uint32_t, const Box3& box, Emit&& emit) {
    const Box3 part = Intersect(box, source.solid.bounds);
    for (int32_t z = part.lo[2]; z < part.hi[2]; ++z) {
      for (int32_t y = part.lo[1]; y < part.hi[1]; ++y) {
        for (int32_t x = part.lo[0]; x < part.hi[0]; ++x) {
          uint32_t rgb;
          if (Covers(source, x, y, z, &rgb)) emit(x, y, z, rgb);
        }
      }
    }
  }

  // Returns whether a voxel is covered, and its colour.
  VOXELD_HD static bool Covers(const Source& source, int32_t x, int32_t y, int32_t z,
                               uint32_t* rgb) {
    const SampleView view{source.indices};
    if (view.head().by_level != 0) {
      if (!IsAtLevel(source, view, x, y, z)) return false;
      *rgb = ColorAtLevel(source, view, x, y, z);
      return true;
    }
    Cell cell;
    if (!Find(source, view, x, y, z, &cell)) return false;
    if (view.head().format == SampleFormat::kRgba8) {
      *rgb = ColorIn(view, cell);
      if (*rgb >> 24 == 0) return false;
      *rgb = Tinted(Tinted(*rgb, (*rgb >> 24) * 0x010101u), source.tint);
      return true;
    }
    const float value = ValueIn(view, cell);
    if (implicit::IsNan(value)) return false;
    const uint32_t entry = view.table()[EntryOf(view.head(), value)];
    *rgb = Tinted(entry, source.tint);
    return (entry & SampleHead::kDrawn) != 0;
  }

  // Returns the entry of the table for a value.
  VOXELD_HD static uint32_t EntryOf(const SampleHead& head, float value) {
    return EntryAt((value - head.low) * head.scale);
  }

  // Returns the colour of a voxel that a level covers.
  VOXELD_HD static uint32_t ColorAtLevel(const Source& source, const SampleView& view, int32_t x,
                                         int32_t y, int32_t z) {
    if (view.head().by_level == 1) return source.UniformColor();
    const Solid& s = source.solid;
    float q[3];
    s.Canonical(s.Distance(0, x), s.Distance(1, y), s.Distance(2, z), q);
    const float(&p)[8] = source.record->params;
    const float place = ((p[0] * q[0] + p[1] * q[1]) + p[2] * q[2]) + p[3];
    return Tinted(view.table()[EntryAt(place)], source.tint);
  }

  // Returns whether, according to the bricks around it, some voxel of a box may be covered. An
  // empty box has none.
  VOXELD_HD static bool MayHave(const Source& source, const Box3& box) {
    if (IsEmpty(box)) return false;
    const SampleView view{source.indices};
    const SampleHead& head = view.head();
    int32_t first[3], last[3];
    for (int r = 0; r < 3; ++r) {
      // The range of the centres of these voxels and of their neighbours, in double, with a margin
      // for the rounding in single precision.
      double low = 0, high = 0, terms = 0;
      for (int c = 0; c < 3; ++c) {
        const double row = static_cast<double>(source.solid.inverse[r][c]);
        const double from = static_cast<double>(source.solid.Distance(c, box.lo[c])) - 1,
                     to = static_cast<double>(source.solid.Distance(c, int64_t{box.hi[c]} - 1)) + 1;
        low += row < 0 ? row * to : row * from;
        high += row < 0 ? row * from : row * to;
        terms += Abs(row) * Max(Abs(from), Abs(to));
      }
      const double room = 1 + 1e-5 * terms;
      low -= room;
      high += room;
      if (!(high >= 0) || !(low < head.size[r])) return false;
      const int32_t most = static_cast<int32_t>((head.size[r] - 1) / SampleHead::kBrick);
      first[r] = low > 0 ? static_cast<int32_t>(low) / static_cast<int32_t>(SampleHead::kBrick) : 0;
      last[r] =
          high < head.size[r]
              ? Min(most, static_cast<int32_t>(high) / static_cast<int32_t>(SampleHead::kBrick))
              : most;
    }
    for (int32_t z = first[2]; z <= last[2]; ++z) {
      for (int32_t y = first[1]; y <= last[1]; ++y) {
        for (int32_t x = first[0]; x <= last[0]; ++x) {
          if (view.BrickIsSet(x, y, z)) return true;
        }
      }
    }
    return false;
  }

  VOXELD_HD static float Mix(float a, float b, float t) { return a + (b - a) * t; }

  // Interpolates between corners, x fastest.
  VOXELD_HD static float MixCorners(const float corner[8], const float t[3]) {
    const float a = Mix(Mix(corner[0], corner[1], t[0]), Mix(corner[2], corner[3], t[0]), t[1]);
    const float b = Mix(Mix(corner[4], corner[5], t[0]), Mix(corner[6], corner[7], t[0]), t[1]);
    return Mix(a, b, t[2]);
  }

  // Returns, for a voxel with a depth, whether |P| ≤ h·|∇P|, the gradient in voxel space. NEAREST
  // grids have no gradient.
  VOXELD_HD VOXELD_DEVICE_NOINLINE static bool IsWithinShell(const Source& source,
                                                             const SampleView& view, int32_t x,
                                                             int32_t y, int32_t z, float depth) {
    Cell cell;
    if (view.head().filter == SampleFilter::kNearest || !Find(source, view, x, y, z, &cell)) {
      return false;
    }
    float corner[8], slope[3];
    CornersOf(view, cell, corner);
    for (int a = 0; a < 3; ++a) {
      // If the two samples of an axis are the same, nothing changes along it.
      float t[3] = {cell.t[0], cell.t[1], cell.t[2]};
      t[a] = 0;
      const float from = MixCorners(corner, t);
      t[a] = 1;
      slope[a] = MixCorners(corner, t) - from;
    }
    float square = 0;
    for (int c = 0; c < 3; ++c) {
      const float(&m)[3][3] = source.solid.inverse;
      const float d = (slope[0] * m[0][c] + slope[1] * m[1][c]) + slope[2] * m[2][c];
      square = square + d * d;
    }
    return Abs(depth) <= source.implicit.half * implicit::Sqrt(square);
  }

 private:
  VOXELD_HD static uint32_t EntryAt(float place) {
    if (!(place > 0)) return 0;
    return place >= 255.0f ? 255 : static_cast<uint32_t>(place);
  }

  // The position of a voxel's centre: the samples around it, and how far it is from the first to
  // the last.
  struct Cell {
    int32_t at[3][2];
    float t[3];
  };

  // Returns false outside the grid.
  VOXELD_HD static bool Find(const Source& source, const SampleView& view, int32_t x, int32_t y,
                             int32_t z, Cell* cell) {
    const Solid& s = source.solid;
    float q[3];
    s.Canonical(s.Distance(0, x), s.Distance(1, y), s.Distance(2, z), q);
    const SampleHead& head = view.head();
    for (int a = 0; a < 3; ++a) {
      const int32_t last = static_cast<int32_t>(head.size[a]) - 1;
      if (!(q[a] >= 0) || !(q[a] < static_cast<float>(head.size[a]))) return false;
      if (head.filter == SampleFilter::kNearest) {
        cell->at[a][0] = cell->at[a][1] = Min(static_cast<int32_t>(q[a]), last);
        cell->t[a] = 0;
        continue;
      }
      const float p = q[a] - 0.5f;
      const int32_t first = p < 0 ? -1 : static_cast<int32_t>(p);
      cell->at[a][0] = Max(first, 0);
      cell->at[a][1] = Min(first + 1, last);
      cell->t[a] = p - static_cast<float>(first);
    }
    return true;
  }

  VOXELD_HD static void CornersOf(const SampleView& view, const Cell& cell, float corner[8]) {
    for (uint32_t i = 0; i < 8; ++i) {
      corner[i] =
          view.Number(view.IndexOf(cell.at[0][i & 1], cell.at[1][i >> 1 & 1], cell.at[2][i >> 2]));
    }
  }
  VOXELD_HD static float ValueIn(const SampleView& view, const Cell& cell) {
    if (view.head().filter == SampleFilter::kNearest) {
      return view.Number(view.IndexOf(cell.at[0][0], cell.at[1][0], cell.at[2][0]));
    }
    float corner[8];
    CornersOf(view, cell, corner);
    return MixCorners(corner, cell.t);
  }

  // Returns 0xAARRGGBB.
  VOXELD_HD static uint32_t ColorIn(const SampleView& view, const Cell& cell) {
    if (view.head().filter == SampleFilter::kNearest) {
      return view.Word(view.IndexOf(cell.at[0][0], cell.at[1][0], cell.at[2][0]));
    }
    uint32_t corner[8], color = 0;
    for (uint32_t i = 0; i < 8; ++i) {
      corner[i] =
          view.Word(view.IndexOf(cell.at[0][i & 1], cell.at[1][i >> 1 & 1], cell.at[2][i >> 2]));
    }
    for (uint32_t shift = 0; shift < 32; shift += 8) {
      float channel[8];
      for (int i = 0; i < 8; ++i) channel[i] = static_cast<float>(corner[i] >> shift & 255);
      color |= static_cast<uint32_t>(MixCorners(channel, cell.t) + 0.5f) << shift;  // NOLINT
    }
    return color;
  }

  // Returns level − v; infinite outside the grid and for NaN.
  VOXELD_HD VOXELD_DEVICE_NOINLINE static float Depth(const Source& source, const SampleView& view,
                                                      int32_t x, int32_t y, int32_t z) {
    Cell cell;
    if (!Find(source, view, x, y, z, &cell)) return implicit::Infinity();
    const float depth = view.head().level - ValueIn(view, cell);
    return implicit::IsNan(depth) ? implicit::Infinity() : depth;
  }

  VOXELD_HD static bool IsAtLevel(const Source& source, const SampleView& view, int32_t x,
                                  int32_t y, int32_t z) {
    const float depth = Depth(source, view, x, y, z);
    const bool inside = depth <= 0;
    if (source.record->fill == Fill::kSolid) return inside;
    if (source.implicit.half > 0 && depth < implicit::Infinity() &&
        IsWithinShell(source, view, x, y, z, depth)) {
      return true;
    }
    const bool cover = source.record->rule == SurfaceRule::kCover;
    for (int32_t dz = -1; dz <= 1; ++dz) {
      for (int32_t dy = -1; dy <= 1; ++dy) {
        for (int32_t dx = -1; dx <= 1; ++dx) {
          const int32_t steps = Abs(dx) + Abs(dy) + Abs(dz);
          if (steps == 0 || (!cover && steps > 1)) continue;
          const float other = Depth(source, view, x + dx, y + dy, z + dz);
          if ((other <= 0) != inside && Abs(depth) <= Abs(other)) return true;
        }
      }
    }
    return false;
  }
};

}  // namespace voxeld::gpu
