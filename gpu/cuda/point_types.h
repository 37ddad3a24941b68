// Points without thickness on the device (gpu/primitives/compact_point.h), sorted by the regions of
// the volume that they lie in. Plain data, used by host and device.
#pragma once

#include <cstdint>

#include "gpu/cuda/line_types.h"
#include "gpu/primitives/compact_point.h"

namespace voxeld::gpu::cuda {

// A voxel and the word to which it is raised; 0: none.
struct alignas(8) PlacedPoint {
  // The voxel's place in its region, as it is drawn; for an item, but not in a list, the upper bits
  // are the region.
  uint32_t at = 0;
  uint32_t word = 0;

  static constexpr int kRegionShift = 14;
  VOXELD_HD static PlacedPoint Of(uint32_t region, const int32_t voxel[3], uint32_t word) {
    const uint32_t x = static_cast<uint32_t>(voxel[0]), y = static_cast<uint32_t>(voxel[1]),
                   z = static_cast<uint32_t>(voxel[2]);
    return {region << kRegionShift | (z & 15) << 10 | (y & 31) << 5 | (x & 31), word};
  }
  VOXELD_HD uint32_t region() const { return at >> kRegionShift; }
  VOXELD_HD uint32_t voxel() const { return at & (kRegionVoxels - 1); }
};
static_assert(kRegionVoxels == 1u << PlacedPoint::kRegionShift);

// Points are sorted in chunks, each by a block of this many threads, which have 1, 4 or 16 points
// each.
inline constexpr uint32_t kPointThreads = 1024;
inline constexpr uint32_t kMostPointsEach = 16;
static_assert(kPointThreads * kMostPointsEach < 1u << 16, "places in a chunk have 16 bits");

// Points of one layer. Those of a chunk c in region r, where r is the l-th region that `within`
// draws, are records[base[c] + offsets[c][l]] to records[base[c] + offsets[c][l + 1]]. Without
// records (null), the only list is `regions`, and the drawing threads test all points.
struct PointBatchView {
  const PlacedPoint* points = nullptr;
  const PlacedPoint* records = nullptr;
  const uint32_t* base = nullptr;
  const uint16_t* offsets = nullptr;
  const uint64_t* regions = nullptr;  // by block, bits: the regions that have any
  RegionGrid within;
  uint32_t layer = 0;  // the slot of the layer
  uint32_t count = 0;  // points
  uint32_t chunks = 0;

  template <bool>
  VOXELD_HD bool Has(uint32_t region) const {
    return regions[region / kRegionsInBlock] >> region % kRegionsInBlock & 1;
  }
};
// Returns the stride of chunks' offsets, so that each chunk's offsets begin at a multiple of 16
// bytes.
VOXELD_HD constexpr uint32_t PointStride(uint32_t regions) { return regions + 8; }

struct PointBatchList {
  PointBatchView batches[kMaxRegionBatches];
  uint32_t count = 0;
};

// The sorting of a batch.
struct PointSort {
  RegionGrid within;
  uint32_t each = 1;  // points of each thread in a chunk
  // The number of records, initially 0: chunks take their places one after the other. Null: a
  // chunk's records begin where its points do.
  uint32_t* taken = nullptr;
  uint32_t capacity = 0;  // of `records`
  // The resulting lists.
  uint32_t* base = nullptr;
  uint16_t* offsets = nullptr;
  uint64_t* regions = nullptr;  // initially 0
  PlacedPoint* records = nullptr;
  // By chunk: not 0 if it has to be sorted again. The sorting resets it to 0.
  uint32_t* touched = nullptr;
  bool again = false;        // sort only those chunks, at their existing places
  uint8_t* dirty = nullptr;  // by region: marks regions that have any; or null
};

}  // namespace voxeld::gpu::cuda
