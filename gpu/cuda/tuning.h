// What only speed depends on. Tests choose otherwise, so that small scenes come by all ways.
#pragma once

#include <cstdint>

namespace voxeld::gpu::cuda {

// When the programs of implicit shapes are compiled for the device, where there is a compiler.
enum class CompileFormulas : uint8_t {
  kNever,
  kLater,   // beside the engine's work; until then they are interpreted
  kAtOnce,  // frames wait for it
};

struct Tuning {
  // What has fewer items, about, where something is dirty is drawn as one group: copying its pictures
  // while others are drawn is not worth the launches.
  double few_items = 100'000;
  // Pictures whose pixels are voxels are packed as these are drawn, and no tiles are kept.
  bool pack_as_drawn = true;
  // Bytes of pictures that make it worth while to draw what follows as a group of its own: so long a
  // copy takes some launches.
  uint64_t group_bytes = uint64_t{24} << 20;
  // As many thin lines at most, of those that come together, are sorted by one block of threads.
  uint32_t few_lines = 1024;
  // As many points that come together at most are made and sorted by one, too.
  uint32_t few_points = 1024;
  // A block of threads sorts so many points a thread at once, where there is the shared memory: 16,
  // 4 or 1.
  uint32_t points_each = 16;
  // As many boxes, spheres and cylinders at least, if they are all that a layer has, move together with it on the device.
  uint32_t least_crowd = 256;
  // What all lists of what lies where (of thin lines and small triangles by region, of other items by
  // tile) may take together, with their making; 0: 16 GiB, or a quarter of the device's memory if that
  // is less. What goes beyond it is drawn in passes.
  uint64_t index_bytes = 0;
  // Of these, what lists may take that stay from frame to frame: the rest is for making them, and for
  // the passes.
  double index_share_kept = 0.5;
  CompileFormulas compile_formulas = CompileFormulas::kLater;
};

}  // namespace voxeld::gpu::cuda
