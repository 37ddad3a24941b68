// What every engine must produce, drawn plainly: dense volumes,
// direct loops, no code of the engine's.
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

// The blended voxels of a scene.
DenseVolume OracleVoxels(const SceneModel& scene, const Target& target);

// For each voxel, 1 if it is in some pixel's footprint.
// An engine may leave out what no slice looks at.
std::vector<uint8_t> OracleSeen(const DenseVolume& volume, const Target& target);

// Bits of green, red, blue from the top, bit by bit.
uint32_t Interleaved(uint32_t rgb);

// All pictures of the volume, as target.layout has them.
std::vector<std::byte> OraclePictures(const DenseVolume& volume, const Target& target);

}  // namespace voxeld::gpu::conformance
