// The oracle of geometries that are no products: where a place lies in the solid that all pixels sweep, in double precision and closed
// form, by other means than the footprints' (polar angles, equations solved, no tables, no fixed point).
#pragma once

#include <cstdint>
#include <vector>

#include "display/api/geometry.h"
#include "display/geometry/homography.h"
#include "tests/display/geometry/swept_solid.h"

namespace voxeld::display {

class SweptFlat {
 public:
  explicit SweptFlat(const Geometry& geometry);

  SweptSolid::Where Locate(const Vec3& place) const;
  // Whether a pixel's rectangle passes a place, give or take the margin; with `reach` 2 it sweeps to the neighbouring slices' middles.
  bool MayPass(int32_t slice, int32_t u, int32_t v, const Vec3& place, int reach) const;
  // So near to where it cannot be told that nothing is asserted.
  bool Doubtful(const Vec3& place) const;

 private:
  // A place is passed: at (u, v), pixels from the picture's corner, by slice `slice`, at so many slices from its middle, where
  // a half is its end; and so many voxels within the ends of the way (below 0: beyond).
  struct Pass {
    int32_t slice;
    double u, v, offset, inside;
  };
  std::vector<Pass> PassesOf(const Vec3& place) const;
  void AddStack(const PlanarStack& stack, const Vec3& nominal, std::vector<Pass>& out) const;
  void AddRotor(const Rotor& rotor, const Vec3& nominal, std::vector<Pass>& out) const;
  void AddHelix(const Helix& helix, const Vec3& nominal, std::vector<Pass>& out) const;
  Vec3 NominalOf(const Vec3& place) const;
  PicturePlace NominalPicture(int32_t slice, double x, double y) const;

  const Geometry& geometry_;
  double pitch_ = 1;  // the least
  int32_t width_ = 0, height_ = 0;
};

}  // namespace voxeld::display
