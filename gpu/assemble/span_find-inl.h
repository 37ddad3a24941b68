// Which spans a walk has in which tiles. One instruction set's share of the kernels.
#if defined(VOXELD_GPU_ASSEMBLE_SPAN_FIND_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef VOXELD_GPU_ASSEMBLE_SPAN_FIND_INL_H_
#undef VOXELD_GPU_ASSEMBLE_SPAN_FIND_INL_H_
#else
#define VOXELD_GPU_ASSEMBLE_SPAN_FIND_INL_H_
#endif

HWY_BEFORE_NAMESPACE();
namespace voxeld::gpu {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// The smallest whole number at or above q, a crossing's (line_walk.h): q > −2⁵².
HWY_INLINE int64_t CeilCrossing(double q) {
  q -= 0x1p-36;
  const auto k = static_cast<int64_t>(q);
  return k + static_cast<int64_t>(static_cast<double>(k) < q);
}

// An axis of a walk, reflected if it goes down: then it goes up.
struct UpwardAxis {
  int64_t at, step;
  bool down;
  HWY_INLINE UpwardAxis(int64_t walk_at, int64_t walk_step)
      : at(walk_step < 0 ? ~walk_at : walk_at),
        step(walk_step < 0 ? -walk_step : walk_step),
        down(walk_step < 0) {}
  // The first k whose coordinate is `voxel` (reflected) or beyond; at most `most`.
  HWY_INLINE int64_t FirstAt(int64_t voxel, int64_t most) const {
    const int64_t way = voxel * (int64_t{1} << 32) - at;
    if (way <= 0) return 0;
    if (step == 0) return most;
    const double q = static_cast<double>(way) / static_cast<double>(step);
    return q >= static_cast<double>(most) ? most : std::min(most, CeilCrossing(q));
  }
};

// The k inside the volume.
HWY_NOINLINE inline void ClipToVolume(const LineWalk& walk, const WalkGrid& grid, int64_t* begin,
                                      int64_t* end) {
  const int64_t most = *end;
  for (int r = 0; r < 3; ++r) {
    const UpwardAxis up(walk.at(r), walk.step(r));
    const int64_t lo = up.down ? -int64_t{grid.voxels[r]} : 0;
    *begin = std::max(*begin, up.FirstAt(lo, most));
    *end = std::min(*end, up.FirstAt(lo + grid.voxels[r], most));
  }
}

// The faces that a walk crosses inside the volume, in tiles: along axis r it begins `way` before the first one, crosses one
// in 1/`inverse` of steps, and `count` in all. In units of a tile: from where it begins, P(k) is offset + k·slope there, both
// exact. Where none is crossed the walk stays below the face, whatever its step is.
struct Crossings {
  int32_t begin, end;  // k
  int32_t tile;        // at `begin`
  size_t count[3];
  int32_t tile_step[3];
  double way[3], inverse[3], slope[3], offset[3];
};

// False if it does not come into the volume.
HWY_ATTR HWY_INLINE bool CrossingsOf(const LineWalk& walk, const WalkGrid& grid, Crossings& c) {
  int64_t begin = 0, end = walk.steps() + 1;
  int64_t at[3], step[3], first[3], last[3], outside = 0;
  for (int r = 0; r < 3; ++r) {
    at[r] = walk.at(r);
    step[r] = walk.step(r);
    first[r] = at[r] >> 32;
    last[r] = (at[r] + step[r] * (end - 1)) >> 32;
    outside |=
        first[r] | (grid.voxels[r] - 1 - first[r]) | last[r] | (grid.voxels[r] - 1 - last[r]);
  }
  if (outside < 0) {
    ClipToVolume(walk, grid, &begin, &end);
    if (begin >= end) return false;
    for (int r = 0; r < 3; ++r) {
      first[r] = (at[r] + step[r] * begin) >> 32;
      last[r] = (at[r] + step[r] * (end - 1)) >> 32;
    }
  }
  c.begin = static_cast<int32_t>(begin);
  c.end = static_cast<int32_t>(end);
  c.tile = 0;
  for (int r = 0; r < 3; ++r) {
    const int64_t from = first[r] >> kTileBits, to = last[r] >> kTileBits;
    c.tile += static_cast<int32_t>(from) * grid.tile_step[r];
    // −1 if it goes down, for a reflection without a branch: nobody could foresee which way it goes.
    const int64_t down = -static_cast<int64_t>(to < from);
    const auto down32 = static_cast<int32_t>(down);
    c.tile_step[r] = (grid.tile_step[r] ^ down32) - down32;
    c.count[r] = static_cast<size_t>(((to - from) ^ down) - down);
    const int64_t face = (from ^ down) + 1;  // of tiles
    // Where none is crossed the step may be 0 or go the other way.
    const bool any = to != from;
    const auto upward = static_cast<double>(any ? (step[r] ^ down) - down : 1);
    c.way[r] =
        any ? 0x1p-36 * static_cast<double>(face * (int64_t{1} << 36) - (at[r] ^ down)) : 1.0;
    c.inverse[r] = 0x1p36 / upward;
    c.slope[r] = any ? 0x1p-36 * upward : 0.0;
    c.offset[r] = 1.0 - c.way[r];
  }
  return true;
}

// Few of them: in turns, the nearest one next, without branches.
HWY_ATTR HWY_INLINE void FollowShort(const Crossings& c, uint32_t item, FoundSpans& found) {
  int32_t crossings[3][4];
  for (int r = 0; r < 3; ++r) {
    for (size_t j = 0; j < 3; ++j) {
      const int64_t k = CeilCrossing((c.way[r] + static_cast<double>(j)) * c.inverse[r]);
      crossings[r][j] = j < c.count[r] ? static_cast<int32_t>(k) : c.end;
    }
    crossings[r][3] = c.end;
  }
  const size_t most = c.count[0] + c.count[1] + c.count[2] + 1;
  found.tiles.Reserve(found.size, most);
  found.items.Reserve(found.size, most);
  uint32_t* const tiles = found.tiles.data();
  BinItem* const items = found.items.data();
  size_t size = found.size;
  const int32_t *x = crossings[0], *y = crossings[1], *z = crossings[2];
  int32_t k = c.begin, tile = c.tile;
  for (;;) {
    const int32_t next = std::min(*x, std::min(*y, *z));
    tiles[size] = static_cast<uint32_t>(tile);
    items[size++] = BinItem::Span(item, static_cast<uint32_t>(k), static_cast<uint32_t>(next - k));
    if (next == c.end) break;
    const bool in_x = *x == next, in_y = *y == next, in_z = *z == next;
    x += in_x;
    y += in_y;
    z += in_z;
    tile += (in_x ? c.tile_step[0] : 0) + (in_y ? c.tile_step[1] : 0) + (in_z ? c.tile_step[2] : 0);
    k = next;
  }
  found.size = size;
}

// Many: each crossing by itself. A span begins at k = `begin` and at every crossing; by then ⌊offset + k·slope⌋ faces have
// been crossed along an axis, and it ends at the nearest of the three that are next.
HWY_ATTR HWY_INLINE void FollowLong(const Crossings& c, uint32_t item, FoundSpans& found) {
  constexpr size_t kMostCrossings = 3 * (kMostWalkSteps / kTileSize + 3);
  const hn::CappedTag<double, 8> d;
  using V = hn::Vec<decltype(d)>;
  const hn::Rebind<uint64_t, decltype(d)> du64;
  const hn::Rebind<uint32_t, decltype(d)> du32;
  const hn::Rebind<int32_t, decltype(d)> di32;
  const size_t lanes = hn::Lanes(d);
  const auto items_of = hn::Set(du64, item);
  const V room = hn::Set(d, 0x1p-36), iota = hn::Iota(d, 0),
          all = hn::Set(d, static_cast<double>(lanes));
  HWY_ALIGN double begins[kMostCrossings + 8];
  begins[0] = c.begin;
  size_t size = 1, of_axis[3];
  for (int r = 0; r < 3; ++r) {
    of_axis[r] = size;
    const V inverse = hn::Set(d, c.inverse[r]);
    V ways = hn::Add(hn::Set(d, c.way[r]), iota);
    for (size_t j = 0; j < c.count[r]; j += lanes) {
      hn::StoreU(hn::Ceil(hn::Sub(hn::Mul(ways, inverse), room)), d, begins + size + j);
      ways = hn::Add(ways, all);
    }
    size += c.count[r];
  }
  found.tiles.Reserve(found.size, size + lanes);
  found.items.Reserve(found.size, size + lanes);
  auto* const tiles = reinterpret_cast<int32_t*>(found.tiles.data());
  BinItem* const items = found.items.data();
  const V end = hn::Set(d, c.end), first_tile = hn::Set(d, c.tile);
  const V y_first = hn::Set(d, static_cast<double>(of_axis[1])),
          z_first = hn::Set(d, static_cast<double>(of_axis[2])),
          behind = hn::Set(d, static_cast<double>(size));
  V way[3], inverse[3], slope[3], offset[3], tile_step[3];
  for (int r = 0; r < 3; ++r) {
    way[r] = hn::Set(d, c.way[r]);
    inverse[r] = hn::Set(d, c.inverse[r]);
    slope[r] = hn::Set(d, c.slope[r]);
    offset[r] = hn::Set(d, c.offset[r]);
    tile_step[r] = hn::Set(d, c.tile_step[r]);
  }
  V index = iota;
  for (size_t i = 0; i < size; i += lanes) {
    const V k = hn::Load(d, begins + i);
    V next = end, tile = first_tile;
    auto wanted = hn::Lt(index, behind);
    for (int r = 0; r < 3; ++r) {
      const V at = hn::Add(hn::Mul(k, slope[r]), offset[r]);
      const V crossed = hn::Floor(at);
      tile = hn::Add(tile, hn::Mul(crossed, tile_step[r]));
      const V one_more = hn::Mul(hn::Add(way[r], crossed), inverse[r]);
      next = hn::Min(next, hn::Ceil(hn::Sub(one_more, room)));
      if (r == 2) continue;
      // Faces of several axes crossed at once are one beginning, that of the first of these axes.
      const auto later = hn::Ge(index, r == 0 ? y_first : z_first);
      const auto just_now = hn::Lt(hn::Sub(at, slope[r]), crossed);
      wanted = hn::AndNot(hn::And(later, just_now), wanted);
    }
    // A span has a voxel, so 0 is none. Compressed as 32 bits, which this library does faster than 64.
    const V range = hn::Add(hn::Mul(k, hn::Set(d, 256.0)), hn::Sub(next, k));
    const auto ranges = hn::DemoteTo(di32, hn::IfThenElseZero(wanted, range));
    const auto some = hn::Ne(ranges, hn::Zero(di32));
    const auto packed = hn::PromoteTo(du64, hn::BitCast(du32, hn::Compress(ranges, some)));
    hn::StoreU(hn::Or(hn::ShiftLeft<32>(packed), items_of), du64,
               reinterpret_cast<uint64_t*>(items + found.size));
    hn::StoreU(hn::Compress(hn::DemoteTo(di32, tile), some), di32, tiles + found.size);
    found.size += hn::CountTrue(di32, some);
    index = hn::Add(index, all);
  }
}

// Takes out those of tiles that are not owned, from the `first` on.
inline void LeaveOwned(const uint8_t* owned, size_t first, FoundSpans& found) {
  uint32_t* const tiles = found.tiles.data();
  BinItem* const items = found.items.data();
  size_t size = first;
  for (size_t i = first; i < found.size; ++i) {
    tiles[size] = tiles[i];
    items[size] = items[i];
    size += owned[tiles[i]] != 0;
  }
  found.size = size;
}

HWY_ATTR inline void FindSpansIn(const LineWalk* walks, uint32_t first, uint32_t last,
                                 const WalkGrid& grid, const uint8_t* owned, FoundSpans& found) {
  const size_t before = found.size;
  for (uint32_t i = first; i < last; ++i) {
    Crossings c;
    if (!CrossingsOf(walks[i], grid, c)) continue;
    if ((c.count[0] | c.count[1] | c.count[2]) <= 3) {
      FollowShort(c, i, found);
    } else {
      FollowLong(c, i, found);
    }
  }
  if (owned != nullptr) LeaveOwned(owned, before, found);
}

}  // namespace HWY_NAMESPACE
}  // namespace voxeld::gpu
HWY_AFTER_NAMESPACE();

#endif
