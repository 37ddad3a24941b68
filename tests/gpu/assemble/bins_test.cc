#include "gpu/assemble/bins.h"

#include <gtest/gtest.h>

#include <numeric>

namespace voxeld::gpu {
namespace {

// Both ways of sorting give rows in order that hold every item that the primitive names.
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

}  // namespace
}  // namespace voxeld::gpu
