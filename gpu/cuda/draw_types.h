// What the drawing of regions gets and where its voxels go. Plain data, as host and device see it.
#pragma once

#include <cstdint>

#include "gpu/clip.h"
#include "gpu/cuda/point_types.h"
#include "gpu/cuda/triangle_types.h"

namespace voxeld::gpu::cuda {

// Where pixels are voxels: pixel (u, v) of slice s stands for voxel (u, y0 ± v, z) alone, and each z
// belongs to one slice at most. Then tiles are packed as they are drawn, and their colours need not
// be kept.
struct PackedView {
  const int32_t* slice_of_z = nullptr;  // −first of the owned; −1: none
  int32_t y0 = 0, y_step = 1;           // y = y0 + y_step·v
  SliceView slices;
  uint32_t* slice_dirty = nullptr;  // by slice − first
  // By sub-frame, v % 8, u % 8: the least level of a channel that a bit plane shows, spread as
  // colours are interleaved (gpu/word.h) and not shifted; 2²⁴: none.
  const uint32_t* least = nullptr;
};

// Voxels asked for: of a box, x fastest, 0x00RRGGBB.
struct ReadView {
  Box3 box;
  uint32_t* out = nullptr;
};

// Drawables whose items have no pairs where they are drawn: who draws looks through all of them.
struct UnlistedItems {
  const uint32_t* slots = nullptr;
  const uint64_t* firsts = nullptr;  // as ItemList has them
  const uint32_t* layers = nullptr;  // all that they are of
  uint32_t count = 0, layer_count = 0;
  uint64_t items = 0;

  VOXELD_HD uint32_t slot(uint32_t i) const { return slots[i]; }
  VOXELD_HD uint64_t first(uint32_t i) const { return firsts[i]; }
};

// Blocks of threads that draw, of each multiprocessor.
inline constexpr uint32_t kDrawBlocks = 2;

// Everything about drawing dirty regions.
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
  bool clipped = true;  // of one layer alone: it has half-spaces or cylinders
  // Where several layers are drawn: for each block of threads, colours of a region's voxels. Null: of one.
  uint32_t* below = nullptr;
};
static_assert(sizeof(DrawView) <= 32764, "arguments have 32 KB");

// Regions that were picked from a list: how many, and the box of their blocks.
struct PickedRegions {
  uint32_t count = 0;
  uint32_t taken = 0;  // by those who draw
  int32_t lo[3] = {0x7FFFFFFF, 0x7FFFFFFF, 0x7FFFFFFF}, hi[3] = {};
};

// Where drawn colours go: into the tiles kept for slicing, straight into pictures, or to who asks.
enum class DrawTo : uint8_t { kTiles, kPictures, kReader };

}  // namespace voxeld::gpu::cuda
