// Samples the colours of a slice's pixels from the voxels of their footprints.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "display/api/slice_frame.h"
#include "display/geometry/footprint.h"
#include "gpu/assemble/volume.h"

namespace voxeld::gpu {

// The pixels of a slice that are not black, each once.
struct SlicePixels {
  struct Pixel {
    uint32_t rgb, u, v;  // 0x00RRGGBB
  };
  std::vector<Pixel> lit;
  std::vector<uint32_t> lines,
      column;  // scratch memory of the sampler: kColumns lines, a column of pixels
};

// Immutable; used by any number of threads.
class Sampler {
 public:
  static constexpr uint32_t kColumns = 8;  // sampled together, so that pixels are written in runs

  // Returns the axis along which inner lists run: tiles should be laid out with it first.
  static int FastestAxis(const display::FootprintTable& table);

  // Errors: Internal if the table names a voxel outside `grid`.
  static absl::StatusOr<Sampler> Create(display::FootprintTable table, const TileGrid& grid,
                                        display::Sampling sampling);

  const display::FootprintTable& table() const { return table_; }
  const TileGrid& grid() const { return grid_; }

  // Returns z by slice, if slices are planes of the grid, pixel column u is x = u, the next row is
  // y + 1, and sampling is by the maximum; otherwise empty.
  std::span<const int32_t> planes() const {
    return sampling_ == display::Sampling::kMax ? plane_of_ : std::span<const int32_t>();
  }
  // Returns the y of pixel row 0, if slices are planes.
  int32_t first_row() const { return runs_[0].at[1]; }

  // Requires: `out` is already cleared.
  void Sample(const TileStore& tiles, int32_t slice, SlicePixels& out) const;

 private:
  // Distinct voxels of the inner lists that follow each other along an axis; they have consecutive
  // places in a line.
  struct Run {
    int32_t at[3];
    int axis;
    int32_t length;
    uint32_t place;
  };
  struct InnerEntry {
    uint32_t place;
    uint32_t weight;
  };

  // Neighbouring pixels of a row, one voxel each, whose voxels are adjacent in a tile's memory.
  struct Strip {
    uint32_t u, count;
    uint32_t tile, index;  // of the first voxel
  };

  Sampler() = default;
  void BuildInner();
  bool Gather(const TileStore& tiles, const display::FootprintEntry& outer, uint32_t* line) const;
  std::span<const InnerEntry> Inner(int32_t slice, uint32_t v) const;
  void SampleMax(const TileStore& tiles, int32_t slice, uint32_t u0, SlicePixels& out) const;
  void SampleSingle(const TileStore& tiles, int32_t slice, SlicePixels& out) const;
  void SamplePlane(const TileStore& tiles, int32_t z, SlicePixels& out) const;
  void SampleStrips(const TileStore& tiles, int32_t slice, SlicePixels& out) const;
  void FindPlanes(const TileGrid& grid);
  void FindStrips(const TileGrid& grid);
  void SampleWeighted(const TileStore& tiles, int32_t slice, uint32_t u, SlicePixels& out) const;

  display::FootprintTable table_;
  TileGrid grid_;
  display::Sampling sampling_ = display::Sampling::kMax;
  std::vector<Run> runs_;
  std::vector<InnerEntry> inner_;  // rows in the order of table_.inner.begin
  size_t places_ = 0;
  bool single_ =
      false;  // one voxel per pixel, a column's in a row: a stack at the lattice's own resolution
  std::vector<int32_t>
      plane_of_;  // z by slice, if pixel u is x and slices are planes; otherwise empty
  // If single_ is true and a slice is one row, as in lattices, the strips of slice s are
  // strips_[strip_begin_[s] .. strip_begin_[s + 1]). Otherwise empty.
  std::vector<uint32_t> strip_begin_;
  std::vector<Strip> strips_;
};

}  // namespace voxeld::gpu
