// The footprints of the oracle's pixels. Those of a stack and of a rotor come from
// display/geometry, which has an oracle of its own; those of a lattice are computed here again,
// voxel by voxel.
#pragma once

#include <cstdint>
#include <vector>

#include "display/geometry/footprint.h"
#include "gpu/engine.h"

namespace voxeld::gpu::conformance {

struct OracleVoxel {
  int32_t x, y, z;
  uint32_t weight;
};

class OracleFootprints {
 public:
  explicit OracleFootprints(const Target& target);
  std::vector<OracleVoxel> Of(int32_t slice, int32_t u, int32_t v) const;

 private:
  std::vector<OracleVoxel> OfLight(int32_t slice, int32_t u) const;

  const Target& target_;
  display::FootprintTable table_;  // empty for a lattice
};

}  // namespace voxeld::gpu::conformance
