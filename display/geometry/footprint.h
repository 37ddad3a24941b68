// Footprints: for every slice pixel the voxels that it stands for, with weights, as tables that an engine on
// any machine reads alike.
//
// A footprint is a product: pixel (u, v) of slice s stands for all voxels o + i with o from the list of
// (s, u) and i from the list of v, each with weight (wo·wi + 127) / 255. Coordinates add component-wise. A
// planar stack's lists are (x, z) by y; a rotor's are columns (x, y) by z. So a table of a 192-slice
// projector display with 200 million pixels has 175,000 outer entries.
//
// What every geometry guarantees, and tests prove: each voxel whose centre lies in the solid swept by the
// pixels' rectangles is in at least one footprint with weight ≥ 128; each pixel whose centre lies in the
// grid has that voxel in its footprint, so no pixel stays dark inside a lit solid.
//
// Decisions are in integers (positions in 2⁻¹⁶ voxel, directions in 2⁻³⁰), sines and cosines by integer
// CORDIC: the same table on every machine.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "display/api/geometry.h"
#include "display/api/slice_frame.h"

namespace voxeld::display {

struct FootprintEntry {
  uint16_t x = 0, y = 0, z = 0;
  uint16_t weight = 255;  // 1 to 255
  bool operator==(const FootprintEntry&) const = default;
};

// Compressed rows: list r is entries[begin[r] .. begin[r+1]).
struct FootprintLists {
  std::vector<uint32_t> begin;
  std::vector<FootprintEntry> entries;
  std::span<const FootprintEntry> list(size_t r) const {
    return std::span(entries).subspan(begin[r], begin[r + 1] - begin[r]);
  }
};

struct FootprintTable {
  int32_t slices = 0, width = 0, height = 0;
  FootprintLists outer;  // slices·width lists; list (s, u) = s·width + u
  FootprintLists inner;  // height lists
};

// A Geometry's slices, as FrameLayout counts them.
int32_t SliceCount(const Geometry& geometry);

// InvalidArgument with the field, its value and what would be right.
absl::Status ValidateGeometry(const Geometry& geometry);

// The grid that suits a shape when none is stated: cubic or panel-pitch cells just around the swept solid.
VoxelGrid DefaultGrid(const Geometry& geometry);

// `geometry` must be valid. With kMax all weights are 255.
FootprintTable BuildFootprints(const Geometry& geometry, Sampling sampling);

// The centre of pixel (u, v) of `slice` in display millimetres (a rotor's at the middle of its sweep).
Vec3 PixelPosition(const Geometry& geometry, int32_t slice, int32_t u, int32_t v);

// Which slices look at which tiles: conservative, proved by test. Tiles are boxes of tx·ty·tz voxels.
class TileToSlices {
 public:
  TileToSlices(const FootprintTable& table, const VoxelGrid& grid, int32_t tx, int32_t ty, int32_t tz);
  // Slices, ascending, that may show a voxel of tile (i, j, k).
  std::vector<int32_t> Slices(int32_t i, int32_t j, int32_t k) const;
  // True if some slice of [begin, end) may show a voxel of tile (i, j, k).
  bool Visible(int32_t i, int32_t j, int32_t k, int32_t begin, int32_t end) const;

 private:
  // Distinct parts of tile coordinates seen from the outer lists (with their slices) and the inner lists.
  struct OuterPart {
    int32_t i, j, k;
    std::vector<int32_t> slices;
  };
  int32_t tiles_x_, tiles_y_, tiles_z_;
  std::vector<OuterPart> outer_;
  std::vector<std::vector<uint32_t>> by_tile_;  // a tile → indices into outer_
};

}  // namespace voxeld::display
