#include "gpu/assemble/inside.h"

#include <algorithm>
#include <atomic>

namespace voxeld::gpu {
namespace {

constexpr uint64_t kTriangleRun = 1024, kRowRun = 256;

// f(begin, end) for runs of so many.
template <class F>
void ForRuns(uint64_t count, uint64_t run, Executor& executor, F&& f) {
  executor.For(static_cast<size_t>((count + run - 1) / run), 1,
               [&](size_t i, int) { f(i * run, std::min(count, (i + 1) * run)); });
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

}  // namespace voxeld::gpu
