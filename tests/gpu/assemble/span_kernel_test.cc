// Compares walks, spans and small triangles with the definitions in gpu/primitives, tile by tile.
#include "gpu/assemble/span_kernel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <map>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "gpu/assemble/small_triangle.h"
#include "gpu/assemble/triangle_kernel.h"
#include "gpu/word.h"
#include "tests/gpu/assemble/vector_targets.h"

namespace voxeld::gpu {
namespace {

const uint32_t kWord = MakeWord(3, false, 0x123456);

uint64_t Seed() {
  const char* seed = std::getenv("VOXELD_SEED");
  return seed == nullptr ? 1 : std::strtoull(seed, nullptr, 10);
}

Box3 Whole(const TileGrid& grid) {
  return {{0, 0, 0}, {grid.voxels[0], grid.voxels[1], grid.voxels[2]}};
}

struct alignas(64) Words {
  uint32_t at[kTileVoxels] = {};
  bool operator==(const Words&) const = default;
};
TileRows RowsOf(const Words& words) {
  TileRows rows;
  for (uint32_t v = 0; v < kTileVoxels; ++v) {
    if (words.at[v] != 0) rows.bits[v / 1024] |= uint64_t{1} << (v / 16 % 64);
  }
  return rows;
}

bool Holds(const TileRows& rows, const Words& words) {
  const TileRows needed = RowsOf(words);
  bool holds = true;
  for (size_t i = 0; i < TileRows::kGroups; ++i) holds &= (needed.bits[i] & ~rows.bits[i]) == 0;
  return holds;
}

using Drawn = std::map<uint32_t, Words>;  // by tile

class Random {
 public:
  explicit Random(uint64_t seed) : engine_(seed) {}
  int64_t Int(int64_t low, int64_t high) {
    return std::uniform_int_distribution<int64_t>(low, high)(engine_);
  }
  // Returns units near `voxel`: anywhere in it, or at one of its faces.
  int64_t In(int64_t voxel) {
    constexpr int64_t kPlaces[] = {0, 0, 1, 127, 128, 254, 255};
    return voxel * 256 + (Int(0, 1) == 0 ? Int(0, 255) : kPlaces[Int(0, 6)]);
  }

 private:
  std::mt19937_64 engine_;
};

// Returns what the definition draws of a line, in the whole volume.
Drawn Defined(const Line& line, const TileGrid& grid) {
  Drawn drawn;
  EmitLine(line, Whole(grid), [&](int32_t x, int32_t y, int32_t z, uint32_t) {
    drawn[grid.TileOf(x, y, z)].at[grid.IndexInTile(x, y, z)] = kWord;
  });
  return drawn;
}

Drawn BySpans(const LineWalk& walk, const TileGrid& grid) {
  FoundSpans found;
  FindSpans(&walk, 0, 1, WalkGrid(grid), nullptr, found);
  // The same from the tiles that are requested, and nothing in others.
  for (uint8_t odd : {0, 1}) {
    std::vector<uint8_t> half(grid.count());
    for (uint32_t tile = 0; tile < grid.count(); ++tile) half[tile] = (tile & 1) == odd;
    FoundSpans some;
    FindSpans(&walk, 0, 1, WalkGrid(grid), half.data(), some);
    size_t next = 0;
    for (size_t i = 0; i < found.size; ++i) {
      if ((found.tiles.data()[i] & 1) != odd) continue;
      const bool more = next < some.size;
      EXPECT_TRUE(more && some.tiles.data()[next] == found.tiles.data()[i] &&
                  some.items.data()[next] == found.items.data()[i]);
      ++next;
    }
    EXPECT_EQ(next, some.size);
  }
  Drawn drawn;
  std::map<uint32_t, TileRows> rows;
  for (size_t i = 0; i < found.size; ++i) {
    const BinItem item = found.items.data()[i];
    EXPECT_GE(item.count(), 1u);
    EXPECT_LE(item.count(), static_cast<uint32_t>(kMostInTile));
    EXPECT_LT(found.tiles.data()[i], grid.count());
    TileRows& touched = rows[found.tiles.data()[i]];
    Words& words = drawn[found.tiles.data()[i]];
    DrawSpans(&walk, {&item, 1}, words.at, touched);
    EXPECT_TRUE(Holds(touched, words));
  }
  return drawn;
}

void ExpectAsDefined(const Line& line, const TileGrid& grid, uint64_t* walks) {
  LineWalk walk;
  if (!LineWalk::Of(line, WalkGrid(grid), walk)) return;
  ++*walks;
  walk.word = kWord;
  const Drawn want = Defined(line, grid), got = BySpans(walk, grid);
  ASSERT_TRUE(got == want) << "from " << line.s[0] << ", " << line.s[1] << ", " << line.s[2]
                           << " to " << line.e[0] << ", " << line.e[1] << ", " << line.e[2];
}

TEST(Spans, LinesAnywhereEqualTheirDefinitionInAllVectors) {
  const uint64_t seed = Seed();
  std::cout << "VOXELD_SEED=" << seed << "\n";
  ForEachVectorTarget(SpanTarget, [&] {
    Random random(seed);
    uint64_t walks = 0;
    for (int i = 0; i < 4000; ++i) {
      const TileGrid grid = TileGrid::Of(70, 48, 33, i % 3);
      // Now and then far beyond the volume, or along an axis, or within a voxel.
      const int64_t beyond = i % 5 == 0 ? 300 : i % 7 == 0 ? 10 : 0;
      Line line{{}, {}, 5, 5, i % 2 == 0 ? LineSampling::kThin : LineSampling::kEuclidean};
      for (int a = 0; a < 3; ++a) {
        line.s[a] = random.In(random.Int(-beyond, grid.voxels[a] - 1 + beyond));
        line.e[a] = random.In(random.Int(-beyond, grid.voxels[a] - 1 + beyond));
        if (random.Int(0, 5) == 0) line.e[a] = line.s[a];
        if (random.Int(0, 9) == 0) line.e[a] = random.In(VoxelOf(line.s[a]));
      }
      ExpectAsDefined(line, grid, &walks);
      if (testing::Test::HasFatalFailure()) return;
    }
    EXPECT_GT(walks, 3900u);  // lines shorter than a step that lie in two voxels are not walks
  });
}

// Every N, downwards and upwards, with ends where positions are as close to faces as possible.
TEST(Spans, LinesOfEveryLengthEqualTheirDefinition) {
  Random random(Seed());
  uint64_t walks = 0;
  for (int64_t n = 1; n <= kMostWalkSteps + 2; ++n) {
    for (int turn = 0; turn < (n < 100 ? 20 : 1); ++turn) {
      const int major = static_cast<int>(n + turn) % 3;
      int32_t size[3] = {32, 32, 32};
      size[major] = 3200;
      const TileGrid grid =
          TileGrid::Of(size[0], size[1], size[2], (static_cast<int>(n) / 3 + turn) % 3);
      Line line{{}, {}, 5, 5, LineSampling::kThin};
      for (int a = 0; a < 3; ++a) {
        const int64_t most = std::min<int64_t>(n, 31);
        const int64_t from = random.Int(0, a == major ? 3199 - n : 31 - most);
        const int64_t to = from + (a == major ? n : random.Int(0, most));
        line.s[a] = random.In(from);
        line.e[a] = random.In(to);
        if (random.Int(0, 1) == 0) std::swap(line.s[a], line.e[a]);
      }
      ExpectAsDefined(line, grid, &walks);
      if (testing::Test::HasFatalFailure()) return;
    }
  }
  EXPECT_EQ(walks, 99u * 20 + kMostWalkSteps - 99);
}

// The walk's own positions, far beyond what is drawn above: all k of the longest lines.
TEST(Spans, WalksStayInTheirVoxels) {
  Random random(Seed() + 1);
  const WalkGrid grid(TileGrid::Of(16, 16, 16));
  for (int i = 0; i < 3000; ++i) {
    const int64_t n = random.Int(kMostWalkSteps - 200, kMostWalkSteps);
    Line line;
    for (int a = 0; a < 3; ++a) {
      const int64_t from = random.Int(-100000, 100000);
      line.s[a] = random.In(from);
      line.e[a] = random.In(from + (a == i % 3 ? (i % 2 == 0 ? n : -n) : random.Int(-n, n)));
    }
    LineWalk walk;
    ASSERT_TRUE(LineWalk::Of(line, grid, walk));
    ASSERT_EQ(walk.steps(), n);
    for (int r = 0; r < 3; ++r) {
      const int64_t s = line.s[grid.axis[r]], d = line.e[grid.axis[r]] - s;
      for (int64_t k = 0; k <= n; ++k) {
        ASSERT_EQ((walk.at(r) + k * walk.step(r)) >> 32, FloorDiv(s * n + d * k, 256 * n))
            << s << " + " << d << "·" << k << "/" << n;
      }
    }
  }
}

TEST(Spans, OtherLinesAreNoWalks) {
  const WalkGrid grid(TileGrid::Of(64, 64, 64));
  LineWalk walk;
  const Int3 s{{100, 100, 100}}, e{{9000, 100, 100}};
  EXPECT_TRUE(LineWalk::Of({s, e, 1, 1, LineSampling::kThin}, grid, walk));
  EXPECT_FALSE(LineWalk::Of({s, e, 1, 2, LineSampling::kThin}, grid, walk));
  EXPECT_FALSE(LineWalk::Of({s, e, 1, 1, LineSampling::kCover}, grid, walk));
  EXPECT_FALSE(LineWalk::Of({s, {{3074 * 256, 0, 0}}, 1, 1, LineSampling::kThin}, grid, walk));
  EXPECT_FALSE(LineWalk::Of({{{kMaxUnits, 0, 0}}, {{kMaxUnits, 300, 0}}, 1, 1}, grid, walk));
  // Shorter than a step, in two voxels.
  EXPECT_FALSE(
      LineWalk::Of({{{250, 0, 0}}, {{260, 0, 0}}, 1, 1, LineSampling::kEuclidean}, grid, walk));
}

// Compares small triangles with what the definition draws of a triangle.
void ExpectAsDefined(const Triangle& t, const TileGrid& grid, uint64_t* small, uint64_t* lit) {
  SmallTriangles fast;
  const WalkGrid axes(grid);
  if (!fast.Add(t, axes, kWord)) return;
  ++*small;
  const std::vector<uint8_t> owned(grid.count(), 1);
  TriangleMemory memory;
  FoundSpans found;
  FindTriangles(fast, 0, axes, owned.data(), memory, found);
  Drawn want, got;
  EmitTriangle(t, Whole(grid), [&](int32_t x, int32_t y, int32_t z, uint32_t) {
    want[grid.TileOf(x, y, z)].at[grid.IndexInTile(x, y, z)] = kWord;
  });
  *lit += want.size();
  std::map<uint32_t, TileRows> rows;
  for (size_t i = 0; i < found.size; ++i) {
    const uint32_t tile = found.tiles.data()[i];
    ASSERT_LT(tile, grid.count());
    const Box3 box = grid.VoxelsOf(tile);
    int32_t lo[3], hi[3];
    for (int r = 0; r < 3; ++r) lo[r] = box.lo[axes.axis[r]], hi[r] = box.hi[axes.axis[r]];
    TileRows& touched = rows[tile];
    Words& words = got[tile];
    DrawTriangles({&memory, 1}, {found.items.data() + i, 1}, lo, hi, words.at, touched);
    ASSERT_TRUE(Holds(touched, words)) << "tile " << tile;
  }
  std::erase_if(got, [](const auto& drawn) { return drawn.second == Words(); });
  ASSERT_TRUE(got == want);
}

TEST(SmallTriangles, EqualTheirDefinitionInAllVectors) {
  const uint64_t seed = Seed();
  std::cout << "VOXELD_SEED=" << seed << "\n";
  ForEachVectorTarget(TriangleTarget, [&] {
    Random random(seed);
    uint64_t small = 0, lit = 0;
    for (int i = 0; i < 6000; ++i) {
      const TileGrid grid = TileGrid::Of(37, 48, 33, i % 3);
      const int64_t extent = i % 4 == 0 ? 62 : i % 4 == 1 ? 3 : 20;
      Triangle t;
      for (int a = 0; a < 3; ++a) {
        const int64_t from = random.Int(-extent, grid.voxels[a]);
        for (Int3& v : t.v) {
          v[a] = random.In(from + random.Int(0, extent));
          if (random.Int(0, 7) == 0) v[a] = t.v[0][a];  // in a plane of voxels, or on a line
        }
      }
      ExpectAsDefined(t, grid, &small, &lit);
      if (testing::Test::HasFatalFailure()) {
        ADD_FAILURE() << "triangle " << i;
        return;
      }
    }
    EXPECT_GT(small, 5000u);
    EXPECT_GT(lit, 3000u);
  });
}

// Corners on corners, centres and quarters of voxels, where depths are integers and edges run
// through centres; and planes that rise equally along two axes or three.
TEST(SmallTriangles, OfRoundPlacesEqualTheirDefinition) {
  const uint64_t seed = Seed();
  ForEachVectorTarget(TriangleTarget, [&] {
    Random random(seed);
    uint64_t small = 0, lit = 0;
    for (int i = 0; i < 9000; ++i) {
      const TileGrid grid = TileGrid::Of(40, 40, 40, i % 3);
      const int64_t unit = i % 5 == 0 ? 64 : 128, offset = i % 2 == 0 ? 0 : 128;
      const int64_t extent = (i % 3 == 0 ? 4 : i % 3 == 1 ? 12 : 30) * 256 / unit;
      Triangle t;
      for (int a = 0; a < 3; ++a) {
        for (Int3& v : t.v) v[a] = 5 * 256 + offset + random.Int(0, extent) * unit;
      }
      if (i % 7 < 3) {
        // Edges of the same length along two axes, up or down.
        const int64_t p = random.Int(-extent, extent) / 2 * unit,
                      q = random.Int(-extent, extent) / 2 * unit;
        const Int3 c{{20 * 256 + offset, 20 * 256 + offset, 20 * 256 + offset}};
        t.v[0] = t.v[1] = t.v[2] = c;
        t.v[1][i % 3] += p;
        t.v[1][(i + 1) % 3] += random.Int(0, 1) == 0 ? p : -p;
        t.v[2][(i + 1 + i % 2) % 3] += q;
        t.v[2][(i + 2) % 3] += random.Int(0, 1) == 0 ? q : -q;
      }
      ExpectAsDefined(t, grid, &small, &lit);
      if (testing::Test::HasFatalFailure()) {
        ADD_FAILURE() << "triangle " << i;
        return;
      }
    }
    EXPECT_GT(small, 7000u);
    EXPECT_GT(lit, 7000u);
  });
}

// Some triangles that cover more, among many with only their vertices, whose words wait together.
TEST(SmallTriangles, ManyInATileEqualTheirDefinitions) {
  const uint64_t seed = Seed();
  ForEachVectorTarget(TriangleTarget, [&] {
    Random random(seed);
    const TileGrid grid = TileGrid::Of(16, 16, 16);
    const Box3 box = grid.VoxelsOf(0);
    const uint8_t owned = 1;
    TriangleMemory memory;
    FoundSpans found;
    uint64_t small = 0;
    Words want, got;
    for (uint32_t i = 0; i < 3000; ++i) {
      Triangle t;
      const int64_t extent = i % 500 == 499 ? 2000 : 20;  // in units
      for (int a = 0; a < 3; ++a) {
        const int64_t from = random.Int(0, 16 * 256 - extent - 1);
        for (Int3& v : t.v) v[a] = from + random.Int(0, extent);
      }
      SmallTriangles fast;
      const uint32_t word = kWord + i;
      if (!fast.Add(t, WalkGrid(grid), word)) continue;
      ++small;
      FindTriangles(fast, 0, WalkGrid(grid), &owned, memory, found);
      EmitTriangle(t, box, [&](int32_t x, int32_t y, int32_t z, uint32_t) {
        uint32_t& at = want.at[grid.IndexInTile(x, y, z)];
        at = std::max(at, word);
      });
    }
    ASSERT_GT(small, 2000u);
    TileRows touched;
    DrawTriangles({&memory, 1}, {found.items.data(), found.size}, box.lo, box.hi, got.at, touched);
    EXPECT_TRUE(Holds(touched, got));
    EXPECT_TRUE(got == want);
  });
}

// Large and small ones made at once, some with two or three faces, in all tiles of a volume.
TEST(SmallTriangles, SeveralAtOnceEqualTheirDefinitions) {
  const uint64_t seed = Seed();
  ForEachVectorTarget(TriangleTarget, [&] {
    Random random(seed);
    for (int i = 0; i < 40; ++i) {
      const TileGrid grid = TileGrid::Of(70, 48, 33, i % 3);
      const WalkGrid axes(grid);
      const std::vector<uint8_t> owned(grid.count(), 1);
      SmallTriangles fast;
      TriangleMemory memory;
      FoundSpans found;
      std::vector<Words> want(grid.count()), got(grid.count());
      const auto wanted = static_cast<size_t>(random.Int(1, SmallTriangles::kRun));
      for (uint32_t n = 0; fast.size < wanted; ++n) {
        Triangle t;
        const int64_t extent = n % 5 == 0 ? 62 : n % 5 == 1 ? 20 : 2;
        const bool diagonal = random.Int(0, 7) == 0;
        for (int a = 0; a < 3; ++a) {
          const int64_t from = random.Int(-extent, grid.voxels[a]);
          for (Int3& v : t.v) {
            v[a] = diagonal && a == 2 ? v[1] : random.In(from + random.Int(0, extent));
          }
        }
        const uint32_t word = kWord + static_cast<uint32_t>(random.Int(0, 1000));
        if (!fast.Add(t, axes, word)) continue;
        EmitTriangle(t, Whole(grid), [&](int32_t x, int32_t y, int32_t z, uint32_t) {
          uint32_t& at = want[grid.TileOf(x, y, z)].at[grid.IndexInTile(x, y, z)];
          at = std::max(at, word);
        });
      }
      FindTriangles(fast, 0, axes, owned.data(), memory, found);
      EXPECT_EQ(fast.size, 0u);
      for (uint32_t tile = 0; tile < grid.count(); ++tile) {
        std::vector<BinItem> items;
        for (size_t n = 0; n < found.size; ++n) {
          if (found.tiles.data()[n] == tile) items.push_back(found.items.data()[n]);
        }
        const Box3 box = grid.VoxelsOf(tile);
        int32_t lo[3], hi[3];
        for (int r = 0; r < 3; ++r) lo[r] = box.lo[axes.axis[r]], hi[r] = box.hi[axes.axis[r]];
        TileRows touched;
        DrawTriangles({&memory, 1}, items, lo, hi, got[tile].at, touched);
        ASSERT_TRUE(Holds(touched, got[tile])) << "tile " << tile << " of volume " << i;
        ASSERT_TRUE(got[tile] == want[tile]) << "tile " << tile << " of volume " << i;
      }
    }
  });
}

TEST(SmallTriangles, OthersAreNone) {
  const WalkGrid grid(TileGrid::Of(64, 64, 64));
  SmallTriangles small;
  const Triangle t{{{{0, 0, 0}}, {{900, 0, 0}}, {{0, 900, 0}}}, {1, 1, 1}, SurfaceRule::kThin};
  EXPECT_TRUE(small.Add(t, grid, kWord));
  Triangle other = t;
  other.color[1] = 2;
  EXPECT_FALSE(small.Add(other, grid, kWord));
  other = t;
  other.rule = SurfaceRule::kCover;
  EXPECT_FALSE(small.Add(other, grid, kWord));
  other = t;
  other.v[1][0] = 64 * 256;
  EXPECT_FALSE(small.Add(other, grid, kWord));
  other = t;
  other.v[2] = {{1800, 0, 0}};
  EXPECT_FALSE(small.Add(other, grid, kWord));  // without area
}

TEST(TileWords, AreShownAndMovedAlikeInAllVectors) {
  ForEachVectorTarget(SpanTarget, [&] {
    Random random(Seed());
    for (int density : {0, 1, 50, 100}) {
      Words words, want;
      uint32_t lit = 0;
      for (int v = 0; v < kTileVoxels; ++v) {
        if (random.Int(0, 99) >= density) continue;
        const bool erase = random.Int(0, 3) == 0;
        const auto rgb = static_cast<uint32_t>(random.Int(0, 3) * 0x10203);  // black, too
        words.at[v] = MakeWord(static_cast<uint32_t>(random.Int(0, 126)), erase, rgb);
        want.at[v] = erase ? 0 : Interleave(rgb);
        lit += want.at[v] != 0;
      }
      const Words drawn = words;
      TileRows rows, again;
      const TileRows want_rows = RowsOf(want);
      Words copy = words;
      EXPECT_EQ(ShowWords(copy.at, TileRows::All(), rows), lit);
      ASSERT_TRUE(copy == want && rows == want_rows);
      EXPECT_EQ(ShowWords(words.at, RowsOf(words), rows), lit);
      ASSERT_TRUE(words == want);
      EXPECT_EQ(LitColors(words.at, again), lit);
      EXPECT_TRUE(rows == want_rows && again == want_rows);
      for (bool past_caches : {false, true}) {
        for (int differs : {-1, 0, 63, 64, 2000, kTileVoxels - 1}) {
          auto held = std::make_unique<Words>(want);
          TileRows held_rows = want_rows;
          if (differs >= 0) {
            held->at[differs] ^= 1;
            held_rows.bits[differs / 1024] |= uint64_t{1} << (differs / 16 % 64);
          }
          Words moved = want;
          auto held_too = std::make_unique<Words>(*held);
          EXPECT_EQ(MoveColors(moved.at, rows, past_caches, held->at, held_rows), differs >= 0);
          FinishMoves();
          ASSERT_TRUE(*held == want);
          ASSERT_TRUE(moved == Words());
          const bool whole = differs % 2 == 0;
          moved = drawn;
          const MovedWords at_once = MoveWords(moved.at, whole ? TileRows::All() : RowsOf(drawn),
                                               past_caches, held_too->at, held_rows);
          FinishMoves();
          EXPECT_EQ(at_once.lit, lit);
          EXPECT_EQ(at_once.differ, differs >= 0);
          ASSERT_TRUE(*held_too == want && held_rows == want_rows);
          ASSERT_TRUE(moved == Words());
        }
      }
    }
  });
}

}  // namespace
}  // namespace voxeld::gpu
