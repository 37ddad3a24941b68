// The inputs of the drawing of regions, and the destinations of its voxels. Plain data, used by
// host and device.
#pragma once

#include <cstdint>

#include "gpu/clip.h"
#include "gpu/cuda/point_types.h"
#include "gpu/cuda/triangle_types.h"

namespace voxeld::gpu::cuda {

// If pixels are voxels, pixel (u, v) of slice s stands for voxel (u, y0 ± v, z) alone, and each z
// belongs to at most one slice. Then tiles are packed as they are drawn, and their colours need not
// be stored.
struct PackedView {
  const int32_t* slice_of_z = nullptr;  // −first of the owned slices; −1: none
  int32_t y0 = 0, y_step = 1;           // y = y0 + y_step·v
  SliceView slices;
  uint32_t* slice_dirty = nullptr;  // by slice − first
  // By sub-frame, v % 8, u % 8: the least level of a channel that a bit plane shows, with its bits
  // spread as in interleaved colours (gpu/word.h) but not shifted; 2²⁴: none.
  const uint32_t* least = nullptr;
};

// The voxels that ReadVoxels requests: of a box, x fastest, 0x00RRGGBB.
struct ReadView {
  Box3 box;
  uint32_t* out = nullptr;
};

// Drawables whose items have no pairs in the drawn regions: the drawing threads test all of them.
struct UnlistedItems {
  const uint32_t* slots = nullptr;
  const uint64_t* firsts = nullptr;  // in the format of ItemList
  const uint32_t* layers = nullptr;  // the layers of all of them
  uint32_t count = 0, layer_count = 0;
  uint64_t items = 0;

  VOXELD_HD uint32_t slot(uint32_t i) const { return slots[i]; }
  VOXELD_HD uint64_t first(uint32_t i) const { return firsts[i]; }
};

// Blocks of threads that draw, per multiprocessor.
inline constexpr uint32_t kDrawBlocks = 2;

// All data for drawing dirty regions.
struct DrawView {
  const TableEntry* table = nullptr;
  const LayerLook* layers = nullptr;
  const VoxelHalfSpace* half_spaces = nullptr;
  const VoxelCylinder* cylinders = nullptr;
  BatchList pairs;
  UnlistedItems unlisted;
  LineBatchList lines;
  PointBatchList points;
  TriangleBatchList triangles;
  VolumeView volume;
  RegionGrid regions;
  const uint32_t* list = nullptr;    // the regions to be drawn
  const uint32_t* listed = nullptr;  // how many
  uint32_t* taken = nullptr;         // 0 at first
  SliceIndexView slices;
  PackedView packed;
  ReadView read;
  bool clipped = true;  // for a single layer: it has half-spaces or cylinders
  // If several layers are drawn: the colours of a region's voxels, for each block of threads. Null:
  // a single layer.
  uint32_t* below = nullptr;
};
static_assert(sizeof(DrawView) <= 32764, "arguments have 32 KB");

// Regions that were picked from a list: how many, and the box of their blocks.
struct PickedRegions {
  uint32_t count = 0;
  uint32_t taken = 0;  // by drawing blocks
  int32_t lo[3] = {0x7FFFFFFF, 0x7FFFFFFF, 0x7FFFFFFF}, hi[3] = {};
};

// The destination of drawn colours: the tiles stored for slicing, slice images, or the caller of
// ReadVoxels.
enum class DrawTo : uint8_t { kTiles, kPictures, kReader };

}  // namespace voxeld::gpu::cuda
