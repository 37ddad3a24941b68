// Parameters that affect only speed. Tests choose other values, so that small scenes use all code
// paths.
#pragma once

#include <cstdint>

namespace voxeld::gpu::cuda {

// When the programs of implicit shapes are compiled for the device, if a compiler is available.
enum class CompileFormulas : uint8_t {
  kNever,
  kLater,   // in parallel with the engine's work; until then they are interpreted
  kAtOnce,  // frames wait for it
};

struct Tuning {
  // If fewer items, approximately, are in dirty regions, they are drawn as one group: copying its
  // slice images while others are drawn is not worth the launches.
  double few_items = 100'000;
  // Slice images whose pixels are voxels are packed as these are drawn, and no tiles are stored.
  bool pack_as_drawn = true;
  // The bytes of slice images for which it pays off to draw the rest as a group of its own: their
  // copy takes as long as several launches.
  uint64_t group_bytes = uint64_t{24} << 20;
  // Up to this many thin lines that are added together are sorted by one block of threads.
  uint32_t few_lines = 1024;
  // Up to this many points that are added together are made and sorted by one block of threads.
  uint32_t few_points = 1024;
  // The number of points per thread that a block of threads sorts at once, if there is enough
  // shared memory: 16, 4 or 1.
  uint32_t points_each = 16;
  // At least this many boxes, spheres and cylinders, if they are all that a layer has, are moved
  // together with it on the device.
  uint32_t least_crowd = 256;
  // The memory that all lists together (of thin lines and small triangles by region, of other items
  // by tile) may take, including their making; 0: 16 GiB, or a quarter of the device's memory if
  // that is less. Items beyond it are drawn in passes.
  uint64_t index_bytes = 0;
  // The share of it for lists that are kept from frame to frame: the rest is for making them, and
  // for passes.
  double index_share_kept = 0.5;
  CompileFormulas compile_formulas = CompileFormulas::kLater;
};

}  // namespace voxeld::gpu::cuda
