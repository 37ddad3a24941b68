// What finding the voxels of implicit shapes (implicit/field.h) gets and leaves, tile by tile, in device
// memory. Plain data; knows nothing of the engine, as formulas compiled at run time (compiled_formulas.h) are
// made with it.
#pragma once

#include <cstdint>

#include "gpu/portable.h"

namespace voxeld::gpu::cuda {

inline constexpr int32_t kCoveredEdge = 16;  // a tile's
inline constexpr uint32_t kCoveredRows = kCoveredEdge * kCoveredEdge;

// A value with its gradient in voxel space.
struct alignas(16) CoveredDual {
  float value, d[3];
};

// What P is made of along one axis of voxel space, at the centres of its voxels from one before the bounds
// on: `places` of them, kCoveredSpare more than the bounds have, which tiles that stand over and what is read
// at once may ask for.
struct CoveredAxis {
  float* distance = nullptr;  // from the shape's origin, voxels
  // By hoisted value of the axis, then place: its value; the same with its gradient.
  float* value = nullptr;
  CoveredDual* dual = nullptr;
  uint32_t places = 0;
  uint32_t first = 0, end = 0;  // hoisted values, [first, end)
};
inline constexpr uint32_t kCoveredSpare = 2 + kCoveredEdge + 6;

// A shape in its bounds, cut into tiles, its items.
struct CoveredView {
  float* reach = nullptr;  // of each item what is known of it (Implicit::ReachOf)
  // Of each item that has anything its rows of 16 voxels, y first, then z: bit x of the tile. Null: they are not looked for, nor what is
  // along the axes.
  uint16_t* rows = nullptr;
  const uint32_t* hoisted = nullptr;  // implicit/hoisted.h
  CoveredAxis axis[3];
  float inverse[3][3] = {};  // Solid's
  float voxel = 0, half = 0;
  int32_t lo[3] = {}, hi[3] = {};         // bounds, voxels
  int32_t first[3] = {}, blocks[3] = {};  // tiles
  uint32_t items = 0;
  uint32_t slot = 0;  // in the table
  bool solid = false, cover = false;
  bool bounded = false;  // by Φ, or rings
};

// Several of them. A few are there themselves, as a kernel's argument.
inline constexpr uint32_t kFewCovered = 4;
struct CoveredViews {
  const CoveredView* views = nullptr;  // null: a few
  uint32_t count = 0;
  uint32_t most_items = 0, most_places = 0;  // of any of them; places of all axes
  CoveredView few[kFewCovered];

  VOXELD_HD const CoveredView& at(uint32_t i) const { return views != nullptr ? views[i] : few[i]; }
};
static_assert(sizeof(CoveredViews) <= 4000, "arguments have 4 KB");

}  // namespace voxeld::gpu::cuda
