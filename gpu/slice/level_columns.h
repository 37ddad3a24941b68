// Columns of pixels that many slices share, stored as levels before dithering.
//
// A column of a slice's pixels takes its colours from an outer list of the footprint table, row by
// row along the inner axis. In a rotor the same list serves several slices (those in which a panel
// sweeps the same voxels), and the result depends on the slice only through the column's dither. So
// the tone, the levels and the maximum over the list are computed once per list and change, and
// drawing a slice image takes one comparison per pixel.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "display/api/slice_frame.h"
#include "display/geometry/footprint.h"
#include "gpu/assemble/volume.h"
#include "gpu/cpu/executor.h"
#include "gpu/slice/column_kernel.h"
#include "gpu/slice/levels.h"

namespace voxeld::gpu {

// Thread-bound, except for Draw.
class LevelColumns {
 public:
  // Returns nullopt if this method does not apply. It requires RGB332; sampling by the maximum; one
  // voxel per row along the axis that comes first in a tile's memory, with the first one at the
  // beginning of a tile; and lists that serve two slices or more on average. [begin, end): the
  // owned slices.
  static std::optional<LevelColumns> Create(const display::FootprintTable& table,
                                            const TileGrid& grid,
                                            const display::FrameLayout& layout,
                                            const display::Tone& tone, int32_t begin, int32_t end);

  // Recomputes the columns that look at `changed` tiles. In the first call, these must include all
  // lit tiles.
  void Update(const TileStore& tiles, std::span<const uint32_t> changed, Executor& executor);

  // Memory that Draw uses, one per thread.
  struct Scratch {
    std::vector<const uint8_t*> levels;
    std::vector<uint8_t> pixels;
  };
  // Draws sub-frame `sub` of some owned slices, preferably neighbours. Any number of threads.
  static constexpr size_t kSlicesTogether = 8;
  void Draw(std::span<const int32_t> slices, uint32_t sub, Scratch& scratch) const;
  // Returns the i-th slice image last drawn with this scratch, row-major.
  std::span<const uint8_t> picture(size_t i, const Scratch& scratch) const {
    return std::span(scratch.pixels).subspan(i * picture_bytes(), height_ * width_);
  }

  uint64_t memory_bytes() const { return level_bytes_; }

 private:
  struct Voxel {
    uint32_t tile;   // the first tile along the inner axis
    uint32_t index;  // of the first voxel along the inner axis, in the tile's memory
  };
  // A column of one voxel per row, and the index in a tile's memory at which its voxels begin.
  struct Single {
    uint32_t column, index;
  };
  // The tiles along the inner axis, and the columns that look at them: ranges of singles_ and
  // others_.
  struct Pillar {
    uint32_t first_tile = UINT32_MAX;
    uint32_t singles = 0, singles_end = 0;
    uint32_t others = 0, others_end = 0;
  };
  class Waiting;
  static constexpr uint32_t kDark = 0;  // the column of lists without voxels

  LevelColumns() = default;
  size_t picture_bytes() const { return chunks_ * kChunkRows * columns_; }
  void AddColumn(const TileGrid& grid, std::span<const display::FootprintEntry> list);
  void SortColumns(const TileGrid& grid);
  void IndexPillars(const TileGrid& grid);
  size_t PillarOf(const TileGrid& grid, uint32_t tile) const;
  void LevelSingles(const TileStore& tiles, const Pillar& pillar);
  void LevelOthers(const TileStore& tiles, std::span<const uint32_t> columns);
  const uint32_t* ColorsAt(const TileStore& tiles, uint32_t first_tile, size_t chunk,
                           size_t block) const;
  std::span<const Voxel> VoxelsOf(uint32_t column) const {
    return std::span(voxels_).subspan(voxel_begin_[column],
                                      voxel_begin_[column + 1] - voxel_begin_[column]);
  }
  uint8_t* levels(uint32_t column, size_t chunk) const {
    return levels_[column * chunks_ + chunk].bytes;
  }

  LevelTables tables_;
  std::vector<uint64_t> dither_;  // eight for each sub-frame
  size_t width_ = 0, height_ = 0;
  size_t columns_ = 0;  // of a slice image, including those that fill the last block
  size_t chunks_ = 0;   // per column
  int32_t begin_ = 0;   // the first owned slice
  int axis_ = 0;        // the inner axis
  int32_t first_ = 0;   // the voxel of the first row along that axis
  uint32_t tile_step_ = 0;
  int32_t tiles_along_ = 0;
  std::vector<uint32_t> column_of_;  // (slice − begin_) · width_ + u
  // The voxels of column c are voxels_[voxel_begin_[c] .. voxel_begin_[c + 1]).
  std::vector<uint32_t> voxel_begin_;
  std::vector<Voxel> voxels_;
  std::vector<Pillar> pillars_;
  std::vector<Single> singles_;
  std::vector<uint32_t> others_;
  // chunks_ for each column. Memory is used only for lit chunks. Aligned, so that a vector lies in
  // one cache line.
  struct alignas(kChunkRows) ChunkLevels {
    uint8_t bytes[kChunkBytes];
  };
  std::unique_ptr<ChunkLevels[]> levels_;
  uint64_t level_bytes_ = 0;
  std::vector<uint64_t> lit_;  // for each column, bit c: its chunk c is lit
};

}  // namespace voxeld::gpu
