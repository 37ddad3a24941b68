#include "gpu/assemble/bins.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace voxeld::gpu {
namespace {

// Both ways of sorting give ordered rows that contain every item that the primitive names.
TEST(Bins, RowsHoldEachItemOfEachTileInOrder) {
  const TileGrid grid = TileGrid::Of(64, 48, 32);
  for (uint32_t count : {3u, 20000u}) {
    GeometryRecord record;
    record.vertex_count = count;
    std::vector<Int3> vertices(count);
    for (uint32_t i = 0; i < count; ++i) {
      vertices[i] = {{(i * 37 % 64) * 256, (i * 11 % 48) * 256, (i * 5 % 32) * 256}};
    }
    Source source;
    source.record = &record;
    source.vertices = vertices.data();
    std::vector<uint8_t> owned(grid.count(), 1);
    owned[0] = 0;
    const std::unique_ptr<Executor> executor = MakeThreadExecutor(3);
    BinScratch scratch;
    Bins bins;
    BinItems(source, grid, owned, 0, false, *executor, scratch, bins);
    ASSERT_EQ(bins.begin.size(), bins.tiles.size() + 1);
    std::vector<std::vector<BinItem>> want(grid.count());
    for (uint32_t i = 0; i < count; ++i) {
      Points::EmitTiles(source, i, grid, [&](uint32_t tile) {
        if (tile != 0) want[tile].push_back({i, 0});
      });
    }
    size_t rows = 0;
    for (uint32_t tile = 0; tile < grid.count(); ++tile) {
      if (want[tile].empty()) continue;
      ASSERT_LT(rows, bins.tiles.size());
      EXPECT_EQ(bins.tiles[rows], tile);
      const std::span<const BinItem> row = bins.row(rows++);
      EXPECT_EQ(std::vector<BinItem>(row.begin(), row.end()), want[tile]);
    }
    EXPECT_EQ(rows, bins.tiles.size());
  }
}

// Walks, and lines that are not walks, some of them because they are too long: the rows are the
// same from any number of threads, sorted or counted, and contain each item where the definition
// has voxels of it.
TEST(Bins, SpansAreTheSameFromAnyNumberOfThreads) {
  const TileGrid grid = TileGrid::Of(64, 48, 32, 1);
  for (uint32_t count : {20u, 9001u}) {
    GeometryRecord record;
    record.kind = PrimitiveKind::kSegments;
    record.vertex_count = 2 * count;
    std::vector<Int3> vertices(2 * size_t{count});
    for (uint32_t i = 0; i < 2 * count; ++i) {
      vertices[i] = {{(i * 3701) % (64 * 256), (i * 1103) % (48 * 256), (i * 509) % (32 * 256)}};
      if (i % 100 == 0) vertices[i][0] = 5000 * 256;
    }
    Source source;
    source.record = &record;
    source.vertices = vertices.data();
    std::vector<uint8_t> owned(grid.count(), 1);
    owned[3] = 0;
    BinScratch scratch;
    Bins one, three;
    BinItems(source, grid, owned, 2, false, *MakeSerialExecutor(), scratch, one);
    BinItems(source, grid, owned, 2, false, *MakeThreadExecutor(3), scratch, three);
    ASSERT_EQ(one.tiles, three.tiles);
    ASSERT_EQ(one.begin, three.begin);
    EXPECT_FALSE(one.all_fast);
    for (size_t r = 0; r < one.tiles.size(); ++r) {
      EXPECT_NE(one.tiles[r], 3u);
      const std::span<const BinItem> a = one.row(r), b = three.row(r);
      ASSERT_TRUE(std::equal(a.begin(), a.end(), b.begin(), b.end())) << "tile " << one.tiles[r];
      // The voxels of walks are counted by their spans.
      std::vector<uint32_t> voxels(count), spanned(count);
      for (const BinItem& item : a) {
        spanned[item.item] += item.count();
        if (item.count() == 0) continue;
        Segments::EmitVoxels(source, item.item, grid.VoxelsOf(one.tiles[r]),
                             [&](int32_t, int32_t, int32_t, uint32_t) { ++voxels[item.item]; });
      }
      ASSERT_EQ(spanned, voxels) << "tile " << one.tiles[r];
    }
  }
}

}  // namespace
}  // namespace voxeld::gpu
