// Small triangles on the device (gpu/primitives/compact_triangle.h), sorted by the regions of the
// volume that they touch. Plain data, used by host and device.
#pragma once

#include <cstdint>

#include "gpu/cuda/line_types.h"
#include "gpu/primitives/compact_triangle.h"

namespace voxeld::gpu::cuda {

// Triangles of one layer. Those of region r are triangles[places[begin[r]]] to
// triangles[places[begin[r + 1] − 1]]. Without such lists `begin` is null, and `places` are bits by
// region, for the regions that have any: the drawing threads test all triangles.
struct TriangleBatchView {
  const CompactTriangle* triangles = nullptr;
  const uint32_t* colors = nullptr;  // 0x00RRGGBB, three each, if they differ; else null
  const uint32_t* begin = nullptr;
  const uint32_t* places = nullptr;
  uint32_t layer = 0;  // the slot of the layer
  uint32_t count = 0;  // triangles

  // Returns whether it has any in a region; kListed: it has lists.
  template <bool kListed>
  VOXELD_HD bool Has(uint32_t region) const {
    if (!kListed && begin == nullptr) return (places[region / 32] >> region % 32 & 1) != 0;
    return begin[region] != begin[region + 1];
  }
};

inline constexpr uint32_t kMaxTriangleBatches = kMaxRegionBatches;
struct TriangleBatchList {
  TriangleBatchView batches[kMaxTriangleBatches];
  uint32_t count = 0;
};

// Returns the greatest number of regions that something of that extent, in voxels along the axes,
// touches.
VOXELD_HD constexpr uint32_t RegionsOfExtent(const int32_t voxels[3]) {
  uint32_t regions = 1;
  for (int a = 0; a < 3; ++a) {
    regions *= (static_cast<uint32_t>(voxels[a] > 1 ? voxels[a] - 1 : 0) >> RegionBits(a)) + 2;
  }
  return regions;
}

// The sorting of a batch: counted by region, summed, and written.
struct TriangleSort {
  RegionGrid grid;
  uint32_t* counts = nullptr;  // by region; 0 initially, and again at the end
  uint32_t* begin = nullptr;   // by region, and the end
  uint32_t* places = nullptr;
  uint32_t capacity = 0;     // of `places`
  uint8_t* dirty = nullptr;  // by region: marks regions that have any; or null
};

}  // namespace voxeld::gpu::cuda
