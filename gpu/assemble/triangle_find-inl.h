// How triangle_kernel.cc makes runs of small triangles (triangle_runs.h), once for each instruction set: of as many faces as
// a vector has lanes at once, whose rows (and columns) lie one behind the other, a lane each.
#if defined(VOXELD_GPU_ASSEMBLE_TRIANGLE_FIND_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef VOXELD_GPU_ASSEMBLE_TRIANGLE_FIND_INL_H_
#undef VOXELD_GPU_ASSEMBLE_TRIANGLE_FIND_INL_H_
#else
#define VOXELD_GPU_ASSEMBLE_TRIANGLE_FIND_INL_H_
#endif

#include "gpu/assemble/triangle_setup-inl.h"

HWY_BEFORE_NAMESPACE();
namespace voxeld::gpu {
namespace HWY_NAMESPACE {

constexpr int32_t kMostTiles = 5;
constexpr int32_t kMostRows = 64;
constexpr size_t kFlat = kLanes * kMostRows;
constexpr int32_t kRowGroup = 16;  // rows of faces whose hits lie in a word

// What is found of a batch, and room for it.
class FaceFinder {
 public:
  HWY_ATTR inline void Find(const SmallTriangles& triangles, size_t begin, uint32_t part,
                            const WalkGrid& grid, const uint8_t* owned, TriangleMemory& memory,
                            FoundSpans& found) {
    count_ = static_cast<int32_t>(std::min(kLanes, triangles.size - begin));
    // Long before they are read, since what is read was written in other pieces.
    row_count_ = PutKeys(triangles.voxels[1] + begin, row_keys_, row_start_.at);
    Field column_start;
    column_count_ = PutKeys(triangles.voxels[2] + begin, column_keys_, column_start.at);
    batch_.Set(triangles, begin);
    MakeRoom(triangles, begin, memory);
    FindRows();
    added_ = 0;
    if (batch_.along_u.any) FindLinesAlongRows();
    PutVertices(triangles, begin);
    AddColumns();
    PutHeaders(triangles, begin);
    FindHits();
    PutItems(static_cast<uint32_t>(memory.size), part, grid, owned, found);
    memory.size += units_;
  }

 private:
  // Which face a lane is of, and which row or column of it.
  struct Key {
    VS face, index;
    HWY_ATTR HWY_INLINE explicit Key(const int32_t* keys)
        : face(hn::And(hn::Load(DS(), keys), hn::Set(DS(), kLanes - 1))),
          index(hn::ShiftRight<8>(hn::Load(DS(), keys))) {}
  };

  // The lanes below `count`.
  HWY_ATTR HWY_INLINE static hn::Mask<DS> Before(int32_t count) {
    const DS d;
    return hn::Lt(hn::Iota(d, 0), hn::Set(d, count));
  }

  // Returns how many there are.
  HWY_ATTR HWY_INLINE int32_t PutKeys(const int32_t* counts, int32_t* keys, int32_t* start) const {
    const DS d;
    const VS first = hn::ShiftLeft<8>(hn::Iota(d, 0)), step = hn::Set(d, kLanes << 8);
    int32_t at = 0;
    for (int32_t face = 0; face < count_; ++face) {
      start[face] = at;
      VS key = hn::Or(first, hn::Set(d, face));
      const int32_t count = counts[face];
      for (int32_t i = 0; i < count; i += kLanes, key = hn::Add(key, step)) {
        hn::StoreU(key, d, keys + at + i);
      }
      at += count;
    }
    for (auto face = static_cast<size_t>(count_); face < kLanes; ++face) start[face] = 0;
    hn::StoreU(hn::Zero(d), d, keys + at);
    return at;
  }

  HWY_ATTR HWY_INLINE void MakeRoom(const SmallTriangles& triangles, size_t begin,
                                    TriangleMemory& memory) {
    constexpr size_t kExact = sizeof(ExactDepths) / sizeof(TriangleRuns);
    // A tile may read sixteen rows from any.
    plane_ = (static_cast<size_t>(row_count_) + 31) & ~size_t{15};
    two_planes_ = false;
    for (int32_t i = 0; i < count_; ++i) two_planes_ |= batch_.voxels_v.at[i] > 32;
    const auto faces = static_cast<size_t>(count_);
    units_ = faces + kExact + plane_ * (two_planes_ ? 2 : 1) / 16;
    memory.units.Reserve(memory.size, units_);
    headers_ = memory.units.data() + memory.size;
    exact_ = reinterpret_cast<ExactDepths*>(headers_ + faces);
    rows_to_ = reinterpret_cast<uint32_t*>(headers_ + faces + kExact);
    const DS d;
    hn::Store(batch_.step_u.Get(), d, exact_->step_u);
    hn::Store(batch_.step_v.Get(), d, exact_->step_v);
    hn::Store(batch_.divisor.Get(), d, exact_->divisor);
    std::copy_n(batch_.numerator, kLanes, exact_->numerator);
  }

  // Whether lines along `test`'s axis light the voxels of columns (k, low) and (k, high): all ones, or 0.
  HWY_ATTR HWY_INLINE void Lit(const LineTest& test, const Field& fall_k, const Field& fall_j,
                               const Key& key, const Faces& faces, hn::Mask<DS> there, VS low,
                               VS high, VS& lit_low, VS& lit_high) const {
    const DS d;
    const VS zero = hn::Zero(d), k = key.index;
    const VS bound = faces.Of(test.reach), room = faces.Of(batch_.err), fall = faces.Of(fall_j);
    const VS from = hn::Add(faces.Of(batch_.depth), hn::Mul(k, faces.Of(fall_k)));
    const VS at_low = hn::Add(from, hn::Mul(low, fall)),
             at_high = hn::Add(from, hn::Mul(high, fall));
    const VS i_low = hn::ShiftRight<kDepthBits>(at_low),
             i_high = hn::ShiftRight<kDepthBits>(at_high);
    VS least_low = hn::Set(d, INT32_MAX), least_high = least_low;
    for (int e = 0; e < 3; ++e) {
      const VS at_k =
          hn::Add(faces.Of(test.edges.base[e]), hn::Mul(k, faces.Of(test.edges.by_k[e])));
      const VS by_j = faces.Of(test.edges.by_j[e]);
      least_low = hn::Min(least_low, hn::Add(at_k, hn::Mul(i_low, by_j)));
      least_high = hn::Min(least_high, hn::Add(at_k, hn::Mul(i_high, by_j)));
    }
    there = hn::And(there, hn::Gt(bound, hn::Set(d, -1)));
    const VS near = hn::Add(room, hn::Set(d, 3));
    const auto judge = [&](VS at, VS least, hn::Mask<DS>& unsure) HWY_ATTR {
      const VS part = hn::And(at, hn::Set(d, (1 << kDepthBits) - 1));
      const VS off = hn::Abs(hn::Sub(part, hn::Set(d, 1 << (kDepthBits - 1))));
      const auto inside = hn::And(there, hn::Gt(least, hn::Set(d, -1)));
      const auto close = hn::Lt(hn::Abs(hn::Sub(off, bound)), near);
      unsure = hn::Or(hn::And(inside, close), hn::And(there, hn::Lt(part, room)));
      return hn::VecFromMask(d, hn::And(inside, hn::Lt(off, bound)));
    };
    hn::Mask<DS> unsure_low = hn::MaskFromVec(zero), unsure_high = unsure_low;
    lit_low = judge(at_low, least_low, unsure_low);
    lit_high = judge(at_high, least_high, unsure_high);
    if (HWY_LIKELY(hn::AllFalse(d, hn::Or(unsure_low, unsure_high)))) return;
    lit_low = LitExactly(test, key, low, unsure_low, lit_low);
    lit_high = LitExactly(test, key, high, unsure_high, lit_high);
  }

  // By the definition where `unsure`.
  HWY_ATTR HWY_NOINLINE VS LitExactly(const LineTest& test, const Key& key, VS j,
                                      hn::Mask<DS> unsure, VS lit) const {
    const DS d;
    Field faces, ks, js, lits, unsures;
    faces.Set(key.face);
    ks.Set(key.index);
    js.Set(j);
    lits.Set(lit);
    unsures.Set(hn::VecFromMask(d, unsure));
    const bool along_v = &test == &batch_.along_v;
    for (size_t lane = 0; lane < kLanes; ++lane) {
      if (unsures.at[lane] == 0) continue;
      const int32_t f = faces.at[lane];
      const int64_t row = along_v ? ks.at[lane] : js.at[lane];
      const int64_t column = along_v ? js.at[lane] : ks.at[lane];
      const int64_t divisor = batch_.divisor.at[f];
      const int64_t at = static_cast<int64_t>(batch_.numerator[f]) +
                         int64_t{256} * batch_.step_u.at[f] * row +
                         int64_t{256} * batch_.step_v.at[f] * column;
      const int64_t i = FloorDiv(at, divisor * 256);
      const int64_t n = batch_.n[along_v ? 2 : 1].at[f];
      const int64_t reach = 128 * (n < 0 ? -n : n);
      const int side = (batch_.n[0].at[f] < 0) == (n < 0) ? 1 : -1;
      const int64_t off = (at - (i * 256 + 128) * divisor) * side;
      bool is_lit = off >= -reach && off < reach;
      for (int e = 0; e < 3; ++e) {
        is_lit &= test.edges.base[e].at[f] + int64_t{test.edges.by_k[e].at[f]} * ks.at[lane] +
                      i * test.edges.by_j[e].at[f] >=
                  0;
      }
      lits.at[lane] = is_lit ? -1 : 0;
    }
    return lits.Get();
  }

  // Bits 0 to n − 1 not set; n ≥ 0.
  HWY_ATTR HWY_INLINE static VS From(VS n) {
    const DS d;
    return hn::IfThenZeroElse(hn::Gt(n, hn::Set(d, 31)),
                              hn::Shl(hn::Set(d, -1), hn::And(n, hn::Set(d, 31))));
  }

  // The columns of rows, with what lines along v light.
  HWY_ATTR HWY_INLINE void FindRows() {
    const DS d;
    const VS one = hn::Set(d, 1);
    for (int32_t row = 0; row < row_count_; row += kLanes) {
      const Key key(row_keys_ + row);
      const Faces faces(key.face);
      const auto there = Before(row_count_ - row);
      VS first, end;
      batch_.rows.Find(faces, key.index, first, end);
      if (batch_.along_v.any) {
        VS low, high;
        Lit(batch_.along_v, batch_.fall_u, batch_.fall_v, key, faces, there, hn::Sub(first, one),
            end, low, high);
        first = hn::Add(first, low);
        end = hn::Sub(end, high);
      }
      const auto put = [&](VS from, VS to, uint32_t* plane) HWY_ATTR {
        const VS bits = hn::IfThenElseZero(there, hn::AndNot(From(to), From(from)));
        hn::Store(hn::BitCast(DW(), bits), DW(), plane + row);
      };
      put(first, end, rows_);
      if (two_planes_) {
        const VS beyond = hn::Set(d, 32), zero = hn::Zero(d);
        put(hn::Max(hn::Sub(first, beyond), zero), hn::Max(hn::Sub(end, beyond), zero),
            rows_ + kFlat);
      }
    }
  }

  // A column to be added: the row of the batch, and the column.
  HWY_ATTR HWY_INLINE void Add(VS row, VS column, hn::Mask<DS> some) {
    const DS d;
    const VS entry = hn::Or(row, hn::ShiftLeft<16>(column));
    hn::StoreU(hn::Compress(entry, some), d, adding_ + added_);
    added_ += hn::CountTrue(d, some);
  }

  // The columns that lines along u light.
  HWY_ATTR HWY_INLINE void FindLinesAlongRows() {
    const DS d;
    const VS one = hn::Set(d, 1);
    for (int32_t column = 0; column < column_count_; column += kLanes) {
      const Key key(column_keys_ + column);
      const Faces faces(key.face);
      const auto there = Before(column_count_ - column);
      VS low, high;
      batch_.columns.Find(faces, key.index, low, high);
      low = hn::Sub(low, one);
      VS lit_low, lit_high;
      Lit(batch_.along_u, batch_.fall_v, batch_.fall_u, key, faces, there, low, high, lit_low,
          lit_high);
      const VS start = faces.Of(row_start_);
      Add(hn::Add(start, low), key.index, hn::MaskFromVec(lit_low));
      Add(hn::Add(start, high), key.index, hn::MaskFromVec(lit_high));
    }
  }

  // Vertices are columns, or voxels and tiles by themselves.
  HWY_ATTR HWY_INLINE void PutVertices(const SmallTriangles& triangles, size_t begin) {
    const DS d;
    const VS none = hn::Set(d, static_cast<int32_t>(TriangleRuns::kNoVertex));
    const auto there =
        hn::And(hn::MaskFromVec(hn::LoadU(d, triangles.whole + begin)), Before(count_));
    const VS depth = batch_.depth.Get(), err = batch_.err.Get();
    VS shift[3];
    for (int r = 0; r < 3; ++r) shift[r] = hn::ShiftLeft<3>(batch_.axis[r].Get());
    for (int n = 0; n < 3; ++n) {
      VS at[3], voxel = hn::Zero(d), tile = voxel;
      for (int r = 0; r < 3; ++r) {
        at[r] = hn::ShiftRight<8>(hn::LoadU(d, triangles.p[r][n] + begin));
        voxel = hn::Or(voxel, hn::Shl(at[r], shift[r]));
        const VS in_tiles = hn::ShiftRight<kTileBits>(hn::Add(at[r], batch_.off[r].Get()));
        tile = hn::Or(hn::ShiftLeft<3>(tile), in_tiles);
      }
      const VS column_depth = hn::Add(
          depth, hn::Add(hn::Mul(at[1], batch_.fall_u.Get()), hn::Mul(at[2], batch_.fall_v.Get())));
      const auto at_depth =
          hn::And(hn::Eq(hn::ShiftRight<kDepthBits>(column_depth), at[0]),
                  hn::Eq(hn::ShiftRight<kDepthBits>(hn::Sub(column_depth, err)), at[0]));
      Add(hn::Add(row_start_.Get(), at[1]), at[2], hn::And(there, at_depth));
      const auto alone = hn::AndNot(at_depth, there);
      vertices_[n].Set(hn::IfThenElse(alone, voxel, none));
      vertex_tiles_[n].Set(hn::IfThenElse(alone, tile, hn::Set(d, -1)));
    }
  }

  HWY_INLINE void AddColumns() {
    for (size_t i = 0; i < added_; ++i) {
      const auto entry = static_cast<uint32_t>(adding_[i]);
      rows_[(entry & 0xFFFF) + (entry >> 21) * kFlat] |= uint32_t{1} << (entry >> 16 & 31);
    }
  }

  // The lowest and the highest bit of what is not 0.
  HWY_ATTR HWY_INLINE static VS Exponent(VS bits) {
    const DS d;
    const VS raw = hn::BitCast(d, hn::ConvertTo(DF(), bits));
    return hn::Sub(hn::And(hn::ShiftRight<23>(raw), hn::Set(d, 0xFF)), hn::Set(d, 127));
  }
  HWY_ATTR HWY_INLINE static VS Lowest(VS bits) { return Exponent(hn::And(bits, hn::Neg(bits))); }
  HWY_ATTR HWY_INLINE static VS Highest(VS bits) {
    const DS d;
    // The bit below goes, or rounding might reach the next power of two.
    const VS exponent = Exponent(hn::AndNot(hn::ShiftRight<1>(bits), bits));
    return hn::IfThenElse(hn::Lt(bits, hn::Zero(d)), hn::Set(d, 31), exponent);
  }

  // Which rows may reach which tiles along v and a.
  HWY_ATTR HWY_INLINE void FindHits() {
    const DS d;
    const VS zero = hn::Zero(d), last_in_tile = hn::Set(d, kTileSize - 1);
    for (int32_t row = 0; row < row_count_; row += kLanes) {
      const Key key(row_keys_ + row);
      const Faces faces(key.face);
      const VW row_bits = hn::Load(DW(), rows_ + row);
      hn::Store(row_bits, DW(), rows_to_ + row);
      const VS bits = hn::BitCast(d, row_bits);
      VS least_column = Lowest(bits), most_column = Highest(bits);
      auto some = hn::Ne(bits, zero);
      if (two_planes_) {
        const VW row_more = hn::Load(DW(), rows_ + kFlat + row);
        hn::Store(row_more, DW(), rows_to_ + plane_ + row);
        const VS more = hn::BitCast(d, row_more);
        const VS beyond = hn::Set(d, 32);
        least_column = hn::IfThenElse(some, least_column, hn::Add(Lowest(more), beyond));
        const auto far = hn::Ne(more, zero);
        most_column = hn::IfThenElse(far, hn::Add(Highest(more), beyond), most_column);
        some = hn::Or(some, far);
      }
      some = hn::And(some, Before(row_count_ - row));
      const VS fall_v = faces.Of(batch_.fall_v), err = faces.Of(batch_.err);
      const VS depth = hn::Add(faces.Of(batch_.depth), hn::Mul(key.index, faces.Of(batch_.fall_u)));
      VS from_v = hn::Neg(faces.Of(batch_.off[2]));
      const VS from_a = hn::Neg(faces.Of(batch_.off[0]));
      for (int32_t tv = 0; tv < batch_.most[2]; ++tv) {
        const VS first = hn::Max(least_column, from_v),
                 last = hn::Min(most_column, hn::Add(from_v, last_in_tile));
        const auto in_v = hn::AndNot(hn::Gt(first, last), some);
        const VS p = hn::Add(depth, hn::Mul(first, fall_v)),
                 q = hn::Add(depth, hn::Mul(last, fall_v));
        const VS least = hn::ShiftRight<kDepthBits>(hn::Sub(hn::Min(p, q), err));
        const VS most = hn::ShiftRight<kDepthBits>(hn::Max(p, q));
        VS lower = from_a;
        for (int32_t ta = 0; ta < batch_.most[0]; ++ta) {
          const auto missed =
              hn::Or(hn::Gt(least, hn::Add(lower, last_in_tile)), hn::Lt(most, lower));
          PutHits(hits_[tv * kMostTiles + ta], row, BitsOf(hn::AndNot(missed, in_v)));
          lower = hn::Add(lower, hn::Set(d, kTileSize));
        }
        from_v = hn::Add(from_v, hn::Set(d, kTileSize));
      }
    }
  }

  // Bit i: lane i. What is stored is loaded in the same size, so that it need not wait for the cache.
  HWY_ATTR HWY_INLINE static uint32_t BitsOf(hn::Mask<DS> mask) {
    const DS d;
    if constexpr (kLanes > 8) {
      uint16_t bits;
      hn::StoreMaskBits(d, mask, reinterpret_cast<uint8_t*>(&bits));
      return bits;
    } else {
      uint8_t bits;
      hn::StoreMaskBits(d, mask, &bits);
      return bits & ((1u << kLanes) - 1);
    }
  }

  // Word g + 1 of `hits` has rows 16·g to 16·g + 31.
  HWY_INLINE static void PutHits(int32_t* hits, int32_t row, uint32_t bits) {
    const int32_t group = row / kRowGroup, bit = row % kRowGroup;
    const auto before = bit == 0 ? 0 : static_cast<uint32_t>(hits[group + 1]);
    hits[group + 1] = static_cast<int32_t>(before | bits << bit);
    hits[group] =
        static_cast<int32_t>(static_cast<uint32_t>(hits[group]) | bits << (bit + kRowGroup));
  }

  HWY_ATTR HWY_INLINE void PutHeaders(const SmallTriangles& triangles, size_t begin) {
    const DS d;
    const DW du;
    const VS lanes = hn::Iota(d, 0);
    const auto faces = static_cast<int32_t>(count_);
    const VS to_end = hn::Sub(hn::Set(d, faces), lanes);  // units
    const VS words_of_exact = hn::Set(d, sizeof(ExactDepths) / sizeof(uint32_t));
    const VS rows_at = hn::Add(hn::Add(hn::ShiftLeft<4>(to_end), words_of_exact), row_start_.Get());
    const VS axes = hn::Or(
        hn::Or(hn::Set(d, static_cast<int32_t>(TriangleRuns::kNoVertex)), batch_.axis[0].Get()),
        hn::Or(hn::ShiftLeft<2>(batch_.axis[1].Get()), hn::ShiftLeft<4>(batch_.axis[2].Get())));
    const auto put = [&](size_t group, VS v0, VS v1, VS v2, VS v3) HWY_ATTR {
      hn::StoreInterleaved4(hn::BitCast(du, v0), hn::BitCast(du, v1), hn::BitCast(du, v2),
                            hn::BitCast(du, v3), du, quarters_[group]);
    };
    const auto load = [&](const int32_t* field) HWY_ATTR { return hn::LoadU(d, field + begin); };
    put(0, load(triangles.origin[0]), load(triangles.origin[1]), load(triangles.origin[2]),
        hn::BitCast(d, hn::LoadU(du, triangles.word + begin)));
    put(1, batch_.depth.Get(), batch_.fall_u.Get(), batch_.fall_v.Get(), batch_.err.Get());
    put(2, vertices_[0].Get(), vertices_[1].Get(), vertices_[2].Get(), axes);
    put(3, rows_at, hn::Set(d, two_planes_ ? static_cast<int32_t>(plane_) : 0), to_end, lanes);
    for (int32_t face = 0; face < faces; ++face) {
      auto* const to = reinterpret_cast<char*>(headers_ + face);
      for (size_t group = 0; group < 4; ++group) {
        std::memcpy(to + 16 * group, quarters_[group] + 4 * face, 16);
      }
    }
  }

  // An item for each tile that is hit.
  HWY_ATTR HWY_INLINE void PutItems(uint32_t item, uint32_t part, const WalkGrid& grid,
                                    const uint8_t* owned, FoundSpans& found) {
    const DS d;
    const VS zero = hn::Zero(d), one = hn::Set(d, 1);
    // By role: the tile's place and step, and how many the volume has.
    VS place[3], step[3], tiles[3];
    VS tile = zero;
    for (int r = 0; r < 3; ++r) {
      const VS axis = batch_.axis[r].Get();
      const auto pick = [&](const int32_t* of) HWY_ATTR {
        return hn::IfThenElse(
            hn::Eq(axis, zero), hn::Set(d, of[0]),
            hn::IfThenElse(hn::Eq(axis, one), hn::Set(d, of[1]), hn::Set(d, of[2])));
      };
      place[r] = batch_.tile[r].Get();
      step[r] = pick(grid.tile_step);
      tiles[r] = hn::ShiftRight<kTileBits>(hn::Add(pick(grid.voxels), hn::Set(d, kTileSize - 1)));
      tile = hn::Add(tile, hn::Mul(place[r], step[r]));
    }
    const auto inside = [&](int r, int32_t i) HWY_ATTR {
      const VS at = hn::Add(place[r], hn::Set(d, i));
      return hn::AndNot(hn::Lt(at, zero), hn::Lt(at, tiles[r]));
    };
    const VS off_u = batch_.off[1].Get(), rows_of = batch_.voxels_u.Get(), start = row_start_.Get();
    const VS header = hn::Add(hn::Set(d, static_cast<int32_t>(item)), hn::Iota(d, 0));
    const VS of_part = hn::Set(d, static_cast<int32_t>(part << 12));
    const auto there = Before(count_);
    size_t size = 0;
    VS tile_u = tile;
    for (int32_t tu = 0; tu < batch_.most[1]; ++tu, tile_u = hn::Add(tile_u, step[1])) {
      const VS from = hn::Sub(hn::Set(d, tu * kTileSize), off_u);
      const VS first = hn::Max(from, zero);
      const VS rows = hn::Sub(hn::Min(rows_of, hn::Add(from, hn::Set(d, kTileSize))), first);
      const auto some = hn::Gt(rows, zero);
      const VS at = hn::IfThenElseZero(some, hn::Add(start, first));
      const VS group = hn::Add(hn::ShiftRight<4>(at), one), bit = hn::And(at, hn::Set(d, 15));
      const VS mask = hn::Sub(hn::Shl(one, hn::IfThenElseZero(some, rows)), one);
      const VS row_of_first = hn::Sub(first, from);
      const auto in_u = hn::And(there, inside(1, tu));
      VS tile_v = tile_u;
      for (int32_t tv = 0; tv < batch_.most[2]; ++tv, tile_v = hn::Add(tile_v, step[2])) {
        const auto in_v = hn::And(in_u, inside(2, tv));
        VS tile_a = tile_v;
        for (int32_t ta = 0; ta < batch_.most[0]; ++ta, tile_a = hn::Add(tile_a, step[0])) {
          const VS hits = hn::GatherIndex(d, hits_[tv * kMostTiles + ta], group);
          const VS bits = hn::And(hn::Shr(hits, bit), mask);
          const VS place_in = hn::Set(d, (ta << 3 | tu) << 3 | tv);
          const auto vertex = hn::Or(hn::Eq(vertex_tiles_[0].Get(), place_in),
                                     hn::Or(hn::Eq(vertex_tiles_[1].Get(), place_in),
                                            hn::Eq(vertex_tiles_[2].Get(), place_in)));
          const auto lit = hn::Ne(bits, zero);
          const auto hit = hn::And(hn::And(in_v, inside(0, ta)), hn::Or(lit, vertex));
          const VS low = Lowest(bits);
          const VS row = hn::IfThenElseZero(lit, hn::Add(low, row_of_first));
          const VS height = hn::IfThenElseZero(lit, hn::Add(hn::Sub(Highest(bits), low), one));
          const VS range = hn::Or(of_part, hn::Or(hn::ShiftLeft<8>(row), hn::Add(height, one)));
          hn::StoreU(hn::Compress(tile_a, hit), d, item_tiles_ + size);
          hn::StoreU(hn::Compress(header, hit), d, item_faces_ + size);
          hn::StoreU(hn::Compress(range, hit), d, item_ranges_ + size);
          size += hn::CountTrue(d, hit);
        }
      }
    }
    found.tiles.Reserve(found.size, size);
    found.items.Reserve(found.size, size);
    uint32_t* const to = found.tiles.data();
    BinItem* const items = found.items.data();
    size_t end = found.size;
    for (size_t i = 0; i < size; ++i) {
      to[end] = static_cast<uint32_t>(item_tiles_[i]);
      items[end] = {static_cast<uint32_t>(item_faces_[i]), static_cast<uint32_t>(item_ranges_[i])};
      end += owned[item_tiles_[i]] != 0;
    }
    found.size = end;
  }

  static constexpr size_t kMostItems = kLanes * kMostTiles * kMostTiles * kMostTiles;

  FaceBatch batch_;
  int32_t count_ = 0, row_count_ = 0, column_count_ = 0;
  bool two_planes_ = false;
  size_t plane_ = 0, units_ = 0, added_ = 0;
  TriangleRuns* headers_ = nullptr;
  ExactDepths* exact_ = nullptr;
  uint32_t* rows_to_ = nullptr;
  Field row_start_, vertices_[3], vertex_tiles_[3];
  // Rows' columns, which are not written where they stay before nobody reads them again: who reads what was just written in
  // other pieces waits for all that was written before.
  alignas(64) uint32_t rows_[2 * kFlat];
  alignas(64) int32_t row_keys_[kFlat + 2 * kLanes], column_keys_[kFlat + 2 * kLanes];
  alignas(64) int32_t adding_[2 * kFlat + 4 * kLanes];
  alignas(64) int32_t hits_[kMostTiles * kMostTiles][kFlat / kRowGroup + 3];
  alignas(64) uint32_t quarters_[4][4 * kLanes];
  int32_t item_tiles_[kMostItems + kLanes], item_faces_[kMostItems + kLanes],
      item_ranges_[kMostItems + kLanes];
};

HWY_ATTR inline void FindTrianglesIn(SmallTriangles& triangles, uint32_t part, const WalkGrid& grid,
                                     const uint8_t* owned, TriangleMemory& memory,
                                     FoundSpans& found) {
  triangles.Pad(kLanes);
  FaceFinder finder;
  for (size_t i = 0; i < triangles.size; i += kLanes) {
    finder.Find(triangles, i, part, grid, owned, memory, found);
  }
  triangles.size = 0;
}

}  // namespace HWY_NAMESPACE
}  // namespace voxeld::gpu
HWY_AFTER_NAMESPACE();

#endif
