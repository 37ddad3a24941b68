// The oracle: which voxels a display's pixels sweep, in closed form and double precision, by other
// means than the footprints' (polar angles, no tables, no fixed point).
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "display/api/geometry.h"
#include "display/geometry/footprint.h"

namespace voxeld::display {

// Within this many voxels of a boundary, the oracle does not decide.
inline constexpr double kMargin = 1e-4;

struct PixelId {
  int32_t slice, u, v;
};

class SweptSolid {
 public:
  enum class Where { kOutside, kNearBoundary, kInside };

  virtual ~SweptSolid() = default;

  // Returns where `point` is relative to the solid that all pixels' rectangles (for a lattice, the
  // lights' boxes) sweep together.
  virtual Where Locate(const Vec3& point) const = 0;

  // Returns the pixels whose rectangle passes `point`, except those for which it is within the
  // margin of a boundary.
  virtual std::vector<PixelId> Passing(const Vec3& point) const = 0;

  // Returns the middle of a pixel; NaN: a lattice has no light there.
  virtual Vec3 Centre(const PixelId& pixel) const = 0;

  // Returns whether an entry may be in the outer list of (slice, u), or in the inner list of
  // (slice, v): the pixel's rectangle passes its voxel's centre, or the voxel contains the pixel's
  // centre, within the margin. With `reach` 2 the rectangle sweeps to the middles of the
  // neighbouring slices.
  virtual bool MayShowOuter(int32_t slice, int32_t u, const FootprintEntry& entry,
                            int reach) const = 0;
  virtual bool MayShowInner(int32_t slice, int32_t v, const FootprintEntry& entry) const = 0;
};

std::unique_ptr<SweptSolid> MakeSweptStack(const PlanarStack& stack, const VoxelGrid& grid);
std::unique_ptr<SweptSolid> MakeSweptRotor(const Rotor& rotor, const VoxelGrid& grid);
std::unique_ptr<SweptSolid> MakeSweptLattice(const Lattice& lattice, const VoxelGrid& grid);
std::unique_ptr<SweptSolid> MakeSweptSolid(const Geometry& geometry);

inline Vec3 VoxelCentre(const VoxelGrid& grid, int32_t i, int32_t j, int32_t k) {
  return {grid.origin_mm.x + (i + 0.5) * grid.pitch_mm.x,
          grid.origin_mm.y + (j + 0.5) * grid.pitch_mm.y,
          grid.origin_mm.z + (k + 0.5) * grid.pitch_mm.z};
}

}  // namespace voxeld::display
