// Footprints: for every slice pixel the voxels that it represents, with weights, as tables that
// engines on any machine read alike.
//
// A footprint is a product: pixel (u, v) of slice s represents all voxels o + i with o from the
// list of (s, u) and i from the list of v, each with weight (wo·wi + 127) / 255. Coordinates add
// component-wise. A planar stack's lists are (x, z) by y or (x, y) by z; a rotor's are columns (x,
// y) by z; a lattice's are (x, y, z) by nothing. So the table of a 192-slice projector display with
// 200 million pixels has 175,000 outer entries.
//
// Every geometry guarantees the following, and tests prove it: each voxel whose centre lies in the
// solid swept by the pixels' rectangles (for a lattice: in a light's box) is in at least one
// footprint with weight 255, so that a lit voxel of full white lights a pixel in every format,
// under any tone and dither, in a single sub-frame; each pixel whose centre lies in the grid has
// that voxel in its footprint, with weight ≥ 128, so no pixel stays dark inside a lit solid.
//
// Voxels of a footprint. Planar stack: those whose centre lies in the pixel's half-open rectangle
// and in the half-open slab that the slice represents. Rotor: those whose centre the pixel's
// rectangle passes while the rotor turns through the slice's half-open interval; a panel never
// passes a voxel nearer to the axis than its plane, passes one on the axis (when its plane contains
// the axis) in every slice, and any other twice a turn. Also, on each axis, the voxel that contains
// the pixel's centre, at the slice's own position or at the middle of its interval. Lattice: those
// whose centre lies in the light's half-open box, and the one that contains the light; a pixel
// without a light has none (docs/adr/0010-lattice-footprints.md). Helix: those whose centre a blade
// passes under the pixel's rectangle in the slice's part of a turn; one on the axis in every slice.
// With a correction: the same, for the nominal places of voxels' centres
// (docs/adr/0024-flat-footprints.md); but a lattice's lights are at their true places, and their
// boxes are as large and as straight as without one.
//
// Weights. kMax: 255. kWeighted: a voxel between the positions (or middle angles) of two
// neighbouring slices is in the footprints of both: 255 in the nearer one's, at distance d, and
// ⌊255·d/(spacing − d) + ½⌋ in the farther one's, 0 left out (docs/adr/0006-full-weights.md);
// outside the outer positions of a stack 255, the slab's own voxels only. The voxel that contains
// the pixel's centre has at least 128. A lattice's slices are not neighbours in space: 255.
//
// Decisions are in integers (positions in 2⁻¹⁶ voxel, angles in 2⁻³² turn, directions in 2⁻³⁰),
// sines, cosines and arc tangents by integer CORDIC: the same table on every machine.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "display/api/geometry.h"
#include "display/api/slice_frame.h"
#include "display/geometry/footprint_entry.h"

namespace voxeld::display {

class Corrector;  // display/geometry/corrector.h

// Compressed rows: list r is entries[begin[r] .. begin[r+1]),
// ascending by (z, y, x), each voxel once.
struct FootprintLists {
  std::vector<uint32_t> begin;
  std::vector<FootprintEntry> entries;
  std::span<const FootprintEntry> list(size_t r) const {
    return std::span(entries).subspan(begin[r], begin[r + 1] - begin[r]);
  }
  bool operator==(const FootprintLists&) const = default;
};

enum class Axis : uint8_t { kX, kY, kZ };

struct FootprintTable {
  int32_t slices = 0, width = 0, height = 0;
  // Used when footprints are not products (helix, tilted panel, correction): each pixel has a list
  // of its own. Rows have flat_row entries, a multiple of 8 that holds a row of the slice image;
  // `width` is all of them and `height` 1: pixel (u, v) is column v·flat_row + u here. 0:
  // footprints are products.
  int32_t flat_row = 0;
  // Slices take the sets of inner lists in turn: slice s uses set s % inner_sets. There is one set,
  // or one per panel for a rotor whose panels differ along v.
  int32_t inner_sets = 1;
  // The axis along which inner entries lie; their other coordinates are 0, and outer entries' is 0
  // here. But if (0, 0, 0) is the only inner entry, outer entries lie along all three.
  Axis inner_axis = Axis::kZ;
  FootprintLists outer;  // slices·width lists; list (s, u) = s·width + u
  FootprintLists inner;  // inner_sets·height lists; list (set, v) = set·height + v

  std::span<const FootprintEntry> Outer(int32_t s, int32_t u) const {
    return outer.list(static_cast<size_t>(s) * static_cast<size_t>(width) + static_cast<size_t>(u));
  }
  std::span<const FootprintEntry> Inner(int32_t s, int32_t v) const {
    return inner.list(static_cast<size_t>(s % inner_sets) * static_cast<size_t>(height) +
                      static_cast<size_t>(v));
  }
  bool operator==(const FootprintTable&) const = default;
};

// Errors: InvalidArgument with the first wrong field, its value and what is expected. ValidateShape
// checks the shape alone, which is what DefaultGrid needs; ValidateGeometry checks shape and grid.
// The limits are in display/geometry/limits.h.
absl::Status ValidateShape(const Geometry& geometry);
absl::Status ValidateGeometry(const Geometry& geometry);
// Checks that a layout's format, bits and height are consistent; else InvalidArgument as above.
absl::Status ValidateFormat(const FrameLayout& layout);

// Returns a geometry's number of slices, as FrameLayout counts them. Requires a valid shape.
int32_t SliceCount(const Geometry& geometry);

// Returns the default grid for a shape, just around the swept solid. Requires a valid shape; the
// grid may still be too large for ValidateGeometry.
// - Planar: cells of the pixels' pitch, so across the slices a pixel is a voxel. Along the normal,
//   over the depth of all slabs: as many as slices if these are evenly spaced (within 10⁻⁶), else
//   as many as the least spacing goes into the depth, 4096 at the most.
// - Rotor: cells of the first panel's pitches (u for x and y, v for z); nx = ny even, over the
//   circle that the farthest corner describes; nz over the height of all panels.
// - Helix: cells of the pitches along x and y, over the circle of the blades as far as the picture
//   reaches; along z as many as slices a blade takes to rise, 4096 at the most.
// A correction is ignored.
// - Lattice: cells of cell_mm, from the lowest corner of all lights' boxes to their highest; so of
//   a regular lattice whose cell is its pitch a light is a voxel.
VoxelGrid DefaultGrid(const Geometry& geometry);

// Requires: `geometry` is valid.
FootprintTable BuildFootprints(const Geometry& geometry, Sampling sampling);

// Returns the true place of the centre of pixel (u, v) of `slice` in display millimetres (for a
// rotor and a helix, at the middle of its sweep; NaN for a lattice's pixel without a light and a
// helix's pixel without a blade). Requires: `geometry` is valid and has the pixel. The grid is not
// used.
Vec3 PixelPosition(const Geometry& geometry, int32_t slice, int32_t u, int32_t v);
// The same for many pixels: `corrector` is that of the geometry's correction.
Vec3 PixelPosition(const Geometry& geometry, const Corrector& corrector, int32_t slice, int32_t u,
                   int32_t v);

// Which slices see which tiles: a slice is listed if and only if some pixel of it has a voxel of
// the tile in its footprint. Tiles are boxes of tx·ty·tz voxels (each ≥ 1), tile (i, j, k) from
// voxel (i·tx, j·ty, k·tz). Immutable, so thread-safe.
class TileToSlices {
 public:
  // Keeps no reference to its arguments.
  TileToSlices(const FootprintTable& table, const VoxelGrid& grid, int32_t tx, int32_t ty,
               int32_t tz);
  // Returns the slices, ascending, that may show a voxel of tile (i, j, k), which must lie in the
  // grid.
  std::vector<int32_t> Slices(int32_t i, int32_t j, int32_t k) const;
  // Returns true if some slice of [begin, end) may show a voxel of tile (i, j, k).
  bool Visible(int32_t i, int32_t j, int32_t k, int32_t begin, int32_t end) const;

  // The same as flat tables, for GPU kernels: slice s of slices[begin[p] .. begin[p+1]) sees tile t
  // if p = Σ stride·t and seen[(s % inner_sets)·inner_tiles + t along the inner axis] ≠ 0. The
  // stride along the inner axis is 0, unless outer entries lie along all three.
  struct Tables {
    int32_t stride[3];
    Axis inner_axis;
    int32_t inner_sets;
    int32_t inner_tiles;
    std::span<const uint32_t> begin;
    std::span<const int32_t> slices;
    std::span<const uint8_t> seen;
  };
  Tables tables() const;

 private:
  // A tile's place on the outer axes, two or all three, and along the inner one.
  struct Place {
    size_t outer, inner;
  };
  Place PlaceOf(int32_t i, int32_t j, int32_t k) const;
  bool SeenInner(int32_t slice, size_t inner) const;
  std::span<const int32_t> OuterSlices(size_t outer) const;

  int32_t tiles_x_, tiles_y_, tiles_z_;
  Axis inner_axis_;
  int32_t inner_sets_;
  int32_t stride_[3];
  std::vector<uint32_t> begin_;      // a place on the outer axes → its range of slices_
  std::vector<int32_t> slices_;      // ascending within a place
  std::vector<uint8_t> inner_seen_;  // set · tiles on the inner axis + place along it
};

}  // namespace voxeld::display
