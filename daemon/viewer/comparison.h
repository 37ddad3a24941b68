// What a display shows, held against the scene that it was sent: where light is missing, where there is light that nothing
// asked for, and how far colours are off.
//
// A voxel and a pixel are near one another if the cell in which the pixel's light lies is within reach of the voxel's:
// no display has its light where the voxels are.
// - A lit voxel that no lit pixel is near is missing.
// - A pixel is held against the voxels near it, what their colours are by the display's own curves; the one that it differs
//   from least counts. A display that is made even dims pixels where they crowd, and depth anti-aliasing those between two
//   slices: there their colour alone counts, at the light that they have. A pixel that no lit voxel is near is stray.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "daemon/viewer/near_pixels.h"
#include "daemon/viewer/pixel_places.h"
#include "display/api/geometry.h"
#include "display/api/slice_frame.h"

namespace voxeld::daemon::viewer {

// Planes [z0, z1) of the scene's voxels, x fastest, as 0x00RRGGBB: `out` has room for them and no more.
using ReadPlanes = std::function<absl::Status(int32_t z0, int32_t z1, std::span<uint32_t> out)>;

struct Comparison {
  // Of more than this every second, fourth … is among the points; figures count all.
  static constexpr size_t kMostPoints = 1'000'000;
  // Differences, of a channel's 255, up to this or to a level of the display, whichever is more, are not looked at: a pixel
  // is bound to make them, and dither evens them out.
  static constexpr int kSmall = 16;

  PlaceBox box;         // of all points here
  double pitch_mm = 1;  // the voxels' least
  Points sent;          // lit voxels, as light by the display's curves
  // What is missing in blue, at voxels; what is too much in orange, at pixels: as bright as it differs.
  Points difference;

  uint64_t voxels = 0;   // lit in the scene
  uint64_t missing = 0;  // of them
  uint64_t pixels = 0;   // lit on the display
  uint64_t stray = 0;    // of them
  uint64_t off = 0;      // neither stray, nor within a level or kSmall
  double mean =
      0;  // difference of pixels that are not stray, of 255: the mean of their greatest channel's
  int most = 0;  // and the greatest
};

inline constexpr int64_t kMostCells = int64_t{1} << 28;
inline constexpr size_t kMostPixels = size_t{16} << 20;
// InvalidArgument for a grid of more voxels than kMostCells, and for more lit pixels than kMostPixels.
absl::Status CheckComparable(const display::VoxelGrid& grid, size_t lit_pixels = 0);

// `shown`: the display's lit pixels, places in `box`. An error of `read` is the answer. `grid` is comparable.
absl::StatusOr<Comparison> Compare(const display::VoxelGrid& grid,
                                   const display::FrameLayout& layout, const display::Tone& tone,
                                   const Reach& reach, const PlaceBox& box, const Points& shown,
                                   const ReadPlanes& read);

}  // namespace voxeld::daemon::viewer
