#include "gpu/assemble/inside.h"

#include <algorithm>
#include <atomic>
#include <bit>

namespace voxeld::gpu {
namespace {

constexpr uint64_t kTriangleRun = 1024, kRowRun = 256;

// f(begin, end) for runs of so many.
template <class F>
void ForRuns(uint64_t count, uint64_t run, Executor& executor, F&& f) {
  executor.For(static_cast<size_t>((count + run - 1) / run), 1,
               [&](size_t i, int) { f(i * run, std::min(count, (i + 1) * run)); });
}

// Of voxels side by side in memory.
void RaisePlane(uint32_t word, uint32_t* words) {
  for (int i = 0; i < kTileSize * kTileSize; ++i) words[i] = std::max(words[i], word);
}

}  // namespace

Box3 BoundsOfVertices(const Source& source, const TileGrid& grid) {
  const uint32_t count = source.record->vertex_count;
  Box3 box;
  if (count == 0) return box;
  for (int a = 0; a < 3; ++a) {
    int64_t least = source.vertices[0][a], most = least;
    for (uint32_t i = 1; i < count; ++i) {
      least = std::min(least, source.vertices[i][a]);
      most = std::max(most, source.vertices[i][a]);
    }
    box.lo[a] = ToVoxel32(VoxelOf(least));
    box.hi[a] = ToVoxel32(VoxelOf(most) + 1);
  }
  return Intersect({{0, 0, 0}, {grid.voxels[0], grid.voxels[1], grid.voxels[2]}}, box);
}

std::vector<uint32_t> FindInside(const Source& source, Executor& executor) {
  const InsideRows rows{source.solid.bounds};
  std::vector<uint32_t> bits(rows.size());
  if (bits.empty()) return bits;
  const bool alone = executor.concurrency() == 1;
  ForRuns(Filled::CountTriangles(source), kTriangleRun, executor,
          [&](uint64_t begin, uint64_t end) {
            for (uint64_t i = begin; i < end; ++i) {
              Int3 v[3];
              Filled::TriangleOf(source, static_cast<uint32_t>(i), v);
              EmitCrossings(v, rows.box, 0, 1, [&](int32_t y, int32_t z, int32_t x) {
                uint32_t& word = bits[rows.PlaceOf(x, y, z)];
                const uint32_t bit = 1u << (x & 31);
                if (alone) {
                  word ^= bit;
                } else {
                  std::atomic_ref(word).fetch_xor(bit, std::memory_order_relaxed);
                }
              });
            }
          });
  const size_t words = static_cast<size_t>(rows.words());
  ForRuns(rows.rows(), kRowRun, executor, [&](uint64_t begin, uint64_t end) {
    for (uint64_t row = begin; row < end; ++row) {
      uint32_t before = 0;  // all ones where the row goes on inside
      for (uint32_t* word = &bits[row * words]; word != &bits[row * words] + words; ++word) {
        *word = ParityUntil(*word) ^ before;
        before = 0u - (*word >> 31);
      }
      if (before != 0) std::fill_n(&bits[row * words], words, 0u);  // it is open
    }
  });
  return bits;
}

void DrawInside(const Source& source, const Box3& box, const TileGrid& grid, uint32_t word,
                uint32_t* words) {
  const Box3 part = Intersect(box, source.solid.bounds);
  if (IsEmpty(part)) return;
  for (int32_t z = part.lo[2]; z < part.hi[2]; ++z) {
    uint32_t rows[kTileSize], all = ~0u;
    const int32_t count = part.hi[1] - part.lo[1];
    for (int32_t i = 0; i < count; ++i) {
      rows[i] = Filled::RowIn(source, part, part.lo[1] + i, z) << (part.lo[0] - box.lo[0]);
      all &= rows[i];
    }
    constexpr uint32_t kWholeRow = (1u << kTileSize) - 1;
    if (all == kWholeRow && count == kTileSize && grid.shift[2] == 2 * kTileBits) {
      RaisePlane(word, words + grid.IndexInTile(box.lo[0], box.lo[1], z));
      continue;
    }
    for (int32_t i = 0; i < count; ++i) {
      uint32_t* const row = words + grid.IndexInTile(box.lo[0], part.lo[1] + i, z);
      for (uint32_t left = rows[i]; left != 0; left &= left - 1) {
        uint32_t& at = row[static_cast<uint32_t>(std::countr_zero(left)) << grid.shift[0]];
        at = std::max(at, word);
      }
    }
  }
}

}  // namespace voxeld::gpu
