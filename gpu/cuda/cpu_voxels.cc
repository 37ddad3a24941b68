#include "gpu/cuda/cpu_voxels.h"

#include "gpu/assemble/draw.h"

namespace voxeld::gpu::cuda {

CpuVoxels DrawOnCpu(const Drawable& drawable, const Affine& view, const TileGrid& grid,
                    std::span<const uint8_t> owned, Executor& executor) {
  Drawable mine;
  mine.record = drawable.record;
  mine.geometry = drawable.geometry;
  mine.layer = drawable.layer;
  PrepareDrawable(mine, view, grid, owned, executor);
  CpuVoxels drawn;
  drawn.singular = IsSingular(mine);
  std::vector<std::vector<uint64_t>> rows(mine.bins.tiles.size());
  std::vector<std::vector<uint32_t>> words(static_cast<size_t>(executor.concurrency()));
  executor.For(rows.size(), 1, [&](size_t row, int worker) {
    std::vector<uint32_t>& scratch = words[static_cast<size_t>(worker)];
    scratch.assign(kTileVoxels, 0);
    DrawItems(mine, mine.bins.row(row), grid, grid.VoxelsOf(mine.bins.tiles[row]), scratch.data());
    for (uint64_t v = 0; v < kTileVoxels; ++v) {
      if (scratch[v] != 0) rows[row].push_back(v << 32 | scratch[v]);
    }
  });
  drawn.tiles = std::move(mine.bins.tiles);
  for (const std::vector<uint64_t>& row : rows) {
    drawn.voxels.insert(drawn.voxels.end(), row.begin(), row.end());
    drawn.begin.push_back(drawn.voxels.size());
  }
  return drawn;
}

}  // namespace voxeld::gpu::cuda
