// The output that every engine must produce, drawn plainly: dense volumes, direct loops, none of
// the engine's code.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "gpu/engine.h"
#include "tests/conformance/scene_model.h"

namespace voxeld::gpu::conformance {

struct DenseVolume {
  int32_t nx = 0, ny = 0, nz = 0;
  std::vector<uint32_t> rgb;  // 0x00RRGGBB, x fastest

  size_t Index(int64_t x, int64_t y, int64_t z) const {
    return (static_cast<size_t>(z) * static_cast<size_t>(ny) + static_cast<size_t>(y)) *
               static_cast<size_t>(nx) +
           static_cast<size_t>(x);
  }
  bool Has(int64_t x, int64_t y, int64_t z) const {
    return x >= 0 && x < nx && y >= 0 && y < ny && z >= 0 && z < nz;
  }
};

// Returns the blended voxels of a scene.
DenseVolume OracleVoxels(const SceneModel& scene, const Target& target);

// Returns, for each voxel, 1 if it is in some pixel's footprint. An engine may leave out voxels
// that no slice looks at.
std::vector<uint8_t> OracleSeen(const DenseVolume& volume, const Target& target);

// Interleaves the bits of green, red and blue, from the top.
uint32_t Interleaved(uint32_t rgb);

// Returns all pictures of the volume in the layout of target.layout.
std::vector<std::byte> OraclePictures(const DenseVolume& volume, const Target& target);

}  // namespace voxeld::gpu::conformance
