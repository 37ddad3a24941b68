// Compares what a display shows with the scene that it was sent: missing light, unwanted light, and
// differences of colour.
//
// A voxel and a pixel are near one another if the cell that contains the pixel's light is within
// reach of the voxel's cell, because no display has its light exactly where the voxels are.
// - A lit voxel without a near lit pixel is missing.
// - A pixel is compared with the near voxels' colours after the display's own curves; the smallest
//   difference counts. Even density dims pixels where they crowd, and depth anti-aliasing dims
//   those between two slices; there only the colour counts, at the pixel's brightness. A pixel
//   without a near lit voxel is stray.
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

// Reads the planes [z0, z1) of the scene's voxels, x fastest, as 0x00RRGGBB. `out` has exactly
// their size.
using ReadPlanes = std::function<absl::Status(int32_t z0, int32_t z1, std::span<uint32_t> out)>;

struct Comparison {
  // Beyond this number only every second, fourth, … point is included; the counts include all.
  static constexpr size_t kMostPoints = 1'000'000;
  // Differences of a channel (of 255) up to this, or up to one level of the display if that is
  // more, are ignored: pixels cannot avoid them, and dither compensates them.
  static constexpr int kSmall = 16;

  PlaceBox box;         // of all points here
  double pitch_mm = 1;  // smallest pitch of the voxels
  Points sent;          // lit voxels, as light after the display's curves
  // Missing light in blue, at voxels; excess light in orange, at pixels. The brightness is the
  // difference.
  Points difference;

  uint64_t voxels = 0;   // lit in the scene
  uint64_t missing = 0;  // missing ones of these
  uint64_t pixels = 0;   // lit on the display
  uint64_t stray = 0;    // stray ones of these
  uint64_t off = 0;      // not stray, and differing by more than a level or kSmall
  // Mean difference of the pixels that are not stray, of 255; each counts with its greatest
  // channel.
  double mean = 0;
  int most = 0;  // greatest such difference
};

inline constexpr int64_t kMostCells = int64_t{1} << 28;
inline constexpr size_t kMostPixels = size_t{16} << 20;
// Errors: InvalidArgument for a grid of more than kMostCells voxels, or for more than kMostPixels
// lit pixels.
absl::Status CheckComparable(const display::VoxelGrid& grid, size_t lit_pixels = 0);

// `shown` are the display's lit pixels, with places in `box`. Requires: CheckComparable accepts
// `grid`. Errors: those of `read`.
absl::StatusOr<Comparison> Compare(const display::VoxelGrid& grid,
                                   const display::FrameLayout& layout, const display::Tone& tone,
                                   const Reach& reach, const PlaceBox& box, const Points& shown,
                                   const ReadPlanes& read);

}  // namespace voxeld::daemon::viewer
