// The inputs and results of finding the voxels of implicit shapes (implicit/field.h), tile by tile,
// in device memory. Plain data, independent of the engine, because formulas compiled at run time
// (compiled_formulas.h) include it.
#pragma once

#include <cstdint>

#include "gpu/portable.h"

namespace voxeld::gpu::cuda {

inline constexpr int32_t kCoveredEdge = 16;  // of a tile
inline constexpr uint32_t kCoveredRows = kCoveredEdge * kCoveredEdge;

// A value with its gradient in voxel space.
struct alignas(16) CoveredDual {
  float value, d[3];
};

// The values along one axis of voxel space from which P is computed, at the centres of its voxels,
// from one before the bounds on. There are `places` of them, kCoveredSpare more than the bounds
// have, for tiles that extend beyond the bounds and for reads of several places at once.
struct CoveredAxis {
  float* distance = nullptr;  // from the shape's origin, voxels
  // Indexed by the axis's hoisted value, then by place: the value, and the same with its gradient.
  float* value = nullptr;
  CoveredDual* dual = nullptr;
  uint32_t places = 0;
  uint32_t first = 0, end = 0;  // hoisted values, [first, end)
};
inline constexpr uint32_t kCoveredSpare = 2 + kCoveredEdge + 6;

// A shape in its bounds, divided into tiles, which are its items.
struct CoveredView {
  float* reach = nullptr;  // for each item, what is known about it (Implicit::ReachOf)
  // For each item with anything in it, its rows of 16 voxels, y first, then z: bit x of the tile.
  // Null: neither the rows nor the values along the axes are computed.
  uint16_t* rows = nullptr;
  const uint32_t* hoisted = nullptr;  // implicit/hoisted.h
  CoveredAxis axis[3];
  float inverse[3][3] = {};  // from Solid
  float voxel = 0, half = 0;
  int32_t lo[3] = {}, hi[3] = {};         // bounds, voxels
  int32_t first[3] = {}, blocks[3] = {};  // tiles
  uint32_t items = 0;
  uint32_t slot = 0;  // in the table
  bool solid = false, cover = false;
  bool bounded = false;  // by Φ, or by rings
};

// Several views. A few are stored in the struct itself, which is a kernel's argument.
inline constexpr uint32_t kFewCovered = 4;
struct CoveredViews {
  const CoveredView* views = nullptr;  // null: use `few`
  uint32_t count = 0;
  uint32_t most_items = 0, most_places = 0;  // the maximum over all views; places of all axes
  CoveredView few[kFewCovered];

  VOXELD_HD const CoveredView& at(uint32_t i) const { return views != nullptr ? views[i] : few[i]; }
};
static_assert(sizeof(CoveredViews) <= 4000, "arguments have 4 KB");

}  // namespace voxeld::gpu::cuda
