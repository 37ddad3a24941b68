// Where a layer is drawn, from the definition: the centre of a voxel is taken back into the scene by
// elimination, in extended precision, and looked at there. Only where a centre lies so near to a
// plane that rounding may decide does the published rounding speak (gpu/clip.h), written a second
// time; so whatever the engines round further than that shows.
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

  // How many verdicts the rounding has given.
  uint64_t near() const { return near_; }

 private:
  struct Plane {
    long double scene[4];   // a, b, c, d
    long double per_voxel;  // the greatest change of its value from one voxel to the next
    __int128 rounded[4];    // of half voxels
    bool exists = false;    // in voxel space
  };

  struct Cylinder {
    long double inverse[3][4];  // scene → where it is x² + y² ≤ 1
    double rounded[2][4];       // of half voxels
    bool exists = false;        // in voxel space
  };

  static Cylinder CylinderOf(const ClipCylinder& cylinder, const Affine& view);
  bool IsInside(const Cylinder& cylinder, const long double scene[3], int64_t x, int64_t y,
                int64_t z) const;
  bool IsInside(const Plane& plane, const long double scene[3], int64_t x, int64_t y,
                int64_t z) const;

  bool invertible_ = false;
  long double inverse_[3][4] = {};  // voxel space → scene
  long double least_distance_ = 0;  // in voxels: nearer, rounding may decide
  std::vector<Plane> planes_;
  std::vector<Cylinder> cylinders_;
  mutable uint64_t near_ = 0;
};

}  // namespace voxeld::gpu::conformance
