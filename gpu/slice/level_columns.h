// Columns of pixels that many slices share, kept as levels before their dither.
//
// A column of a slice's pixels takes its colours from an outer list of the footprint table, row by row along the inner
// axis. In a rotor the same list serves several slices (those in which a panel sweeps the same voxels), and what
// becomes of its colours depends on the slice by the column's dither alone. So tone, levels and the greatest of the
// list are worked out once a list and change, and a slice's picture is a comparison a pixel.
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

// Thread-bound, but for Draw.
class LevelColumns {
 public:
  // Nothing where it does not apply: RGB332, sampled by the greatest, a row a voxel along the axis that comes first in
  // a tile's memory, the first at a tile's beginning, and lists that serve two slices or more on average. [begin, end): the slices owned.
  static std::optional<LevelColumns> Create(const display::FootprintTable& table,
                                            const TileGrid& grid,
                                            const display::FrameLayout& layout,
                                            const display::Tone& tone, int32_t begin, int32_t end);

  // Works out anew what looks at `changed`; the first time all that is lit must be among them.
  void Update(const TileStore& tiles, std::span<const uint32_t> changed, Executor& executor);

  // Room that Draw takes, one a thread.
  struct Scratch {
    std::vector<const uint8_t*> levels;
    std::vector<uint8_t> pixels;
  };
  // Picture `sub` of each of some owned slices, neighbours at best. Any number of threads.
  static constexpr size_t kSlicesTogether = 8;
  void Draw(std::span<const int32_t> slices, uint32_t sub, Scratch& scratch) const;
  // The i-th of those last drawn with this scratch, row-major.
  std::span<const uint8_t> picture(size_t i, const Scratch& scratch) const {
    return std::span(scratch.pixels).subspan(i * picture_bytes(), height_ * width_);
  }

  uint64_t memory_bytes() const { return level_bytes_; }

 private:
  struct Voxel {
    uint32_t tile;   // the first along the inner axis
    uint32_t index;  // in its memory, of the first voxel along the inner axis
  };
  // A column of one voxel a row, and where in a tile's memory its voxels begin.
  struct Single {
    uint32_t column, index;
  };
  // Tiles along the inner axis, and the columns that look at them: ranges of singles_ and others_.
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
  std::vector<uint64_t> dither_;  // eight of each sub-frame
  size_t width_ = 0, height_ = 0;
  size_t columns_ = 0;  // of a picture, with those that fill the last block
  size_t chunks_ = 0;   // of a column
  int32_t begin_ = 0;   // the first slice owned
  int axis_ = 0;        // inner
  int32_t first_ = 0;   // voxel along it of the first row
  uint32_t tile_step_ = 0;
  int32_t tiles_along_ = 0;
  std::vector<uint32_t> column_of_;  // (slice − begin_) · width_ + u
  // Columns: voxels_[voxel_begin_[c] .. voxel_begin_[c + 1]).
  std::vector<uint32_t> voxel_begin_;
  std::vector<Voxel> voxels_;
  std::vector<Pillar> pillars_;
  std::vector<Single> singles_;
  std::vector<uint32_t> others_;
  // chunks_ of each column. Memory is had where there is light; aligned, so that a vector lies in one cache line.
  struct alignas(kChunkRows) ChunkLevels {
    uint8_t bytes[kChunkBytes];
  };
  std::unique_ptr<ChunkLevels[]> levels_;
  uint64_t level_bytes_ = 0;
  std::vector<uint64_t> lit_;  // of each column, bit c: its chunk c is lit
};

}  // namespace voxeld::gpu
