// Decides where a layer is drawn, from the definition: the centre of a voxel is mapped back into
// the scene by elimination, in extended precision, and compared there. Only where a centre is so
// near to a plane that rounding may decide is the published rounding used (gpu/clip.h), in a second
// implementation; so any further rounding in the engines shows.
#pragma once

#include <cstdint>
#include <vector>

#include "gpu/delta.h"
#include "gpu/engine.h"

namespace voxeld::gpu::conformance {

class OracleClip {
 public:
  OracleClip(const LayerRecord& layer, const Target& target);

  bool Has(int64_t x, int64_t y, int64_t z) const;

  // Returns how many verdicts were decided by the rounding.
  uint64_t near() const { return near_; }

 private:
  struct Plane {
    long double scene[4];   // a, b, c, d
    long double per_voxel;  // the greatest change of its value from one voxel to the next
    __int128 rounded[4];    // in half voxels
    bool exists = false;    // whether it has a place in voxel space
  };

  struct Cylinder {
    long double inverse[3][4];  // from the scene to the space in which the cylinder is x² + y² ≤ 1
    double rounded[2][4];       // in half voxels
    bool exists = false;        // whether it has a place in voxel space
  };

  static Cylinder CylinderOf(const ClipCylinder& cylinder, const Affine& view);
  bool IsInside(const Cylinder& cylinder, const long double scene[3], int64_t x, int64_t y,
                int64_t z) const;
  bool IsInside(const Plane& plane, const long double scene[3], int64_t x, int64_t y,
                int64_t z) const;

  bool invertible_ = false;
  long double inverse_[3][4] = {};  // voxel space → scene
  long double least_distance_ = 0;  // in voxels: at smaller distances, rounding may decide
  std::vector<Plane> planes_;
  std::vector<Cylinder> cylinders_;
  mutable uint64_t near_ = 0;
};

}  // namespace voxeld::gpu::conformance
