// Points without thickness on the device (gpu/primitives/compact_point.h), sorted by the regions of
// the volume that they lie in. Plain data, as host and device see it.
#pragma once

#include <cstdint>

#include "gpu/cuda/line_types.h"
#include "gpu/primitives/compact_point.h"

namespace voxeld::gpu::cuda {

// A voxel and the word that it is raised to; 0: none.
struct alignas(8) PlacedPoint {
  // The voxel's place in its region, as it is drawn; of an item, not of a list, above it the
  // region.
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

// Points are sorted in chunks, each by a block of so many threads, of which each has 1, 4 or 16.
inline constexpr uint32_t kPointThreads = 1024;
inline constexpr uint32_t kMostPointsEach = 16;
static_assert(kPointThreads * kMostPointsEach < 1u << 16, "places in a chunk have 16 bits");

// Points of one layer. Those of a chunk c in region r, r being the l-th of those that `within`
// draws, are records[base[c] + offsets[c][l]] to records[base[c] + offsets[c][l + 1]]. Without
// records (null), of the lists there is `regions` alone, and who draws looks through all points.
struct PointBatchView {
  const PlacedPoint* points = nullptr;
  const PlacedPoint* records = nullptr;
  const uint32_t* base = nullptr;
  const uint16_t* offsets = nullptr;
  const uint64_t* regions = nullptr;  // by block, bits: which have any
  RegionGrid within;
  uint32_t layer = 0;  // its slot
  uint32_t count = 0;  // points
  uint32_t chunks = 0;

  template <bool>
  VOXELD_HD bool Has(uint32_t region) const {
    return regions[region / kRegionsInBlock] >> region % kRegionsInBlock & 1;
  }
};
// Of a chunk's offsets, so that each chunk's begin at 16 bytes.
VOXELD_HD constexpr uint32_t PointStride(uint32_t regions) { return regions + 8; }

struct PointBatchList {
  PointBatchView batches[kMaxRegionBatches];
  uint32_t count = 0;
};

// The sorting of a batch.
struct PointSort {
  RegionGrid within;
  uint32_t each = 1;  // points of a thread in a chunk
  // Records that there are, 0 at first: chunks take their places one behind the other. Null: a
  // chunk's begin where its points do.
  uint32_t* taken = nullptr;
  uint32_t capacity = 0;  // of `records`
  // What the lists are to have.
  uint32_t* base = nullptr;
  uint16_t* offsets = nullptr;
  uint64_t* regions = nullptr;  // 0 at first
  PlacedPoint* records = nullptr;
  // By chunk: not 0, if it is to be sorted anew. The sorting leaves it 0.
  uint32_t* touched = nullptr;
  bool again = false;        // only those are, at the places that they have
  uint8_t* dirty = nullptr;  // by region: those that have any are marked; or null
};

}  // namespace voxeld::gpu::cuda
