// The oracle for geometries that are not products: where a place is in the solid that all pixels
// sweep, in double precision and closed form, by other means than the footprints' (polar angles,
// equations solved, no tables, no fixed point).
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
  // Returns whether a pixel's rectangle passes a place, within the margin; with `reach` 2 it sweeps
  // to the middles of the neighbouring slices.
  bool MayPass(int32_t slice, int32_t u, int32_t v, const Vec3& place, int reach) const;
  // Returns whether the place is too near to a boundary to assert anything.
  bool Doubtful(const Vec3& place) const;

 private:
  // The pass of a place: at (u, v), in pixels from the picture's corner, by slice `slice`, at that
  // many slices from its middle, where a half is its end; and that many voxels within the ends of
  // the way (below 0: beyond).
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
