// Sets of lines whose voxels are counted as they are made. Ends lie on multiples of 2⁻⁸ voxel, where the engine
// snaps them to, so the count is exact.
#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "tools/bench/frame/scene.h"

namespace voxeld::bench::frame {

// Voxels [lo, hi).
struct Extent {
  int32_t lo[3] = {0, 0, 0};
  int32_t hi[3];
};

// THIN lines, vertices two by two, in one geometry: the ends of each have its colour.
class LineSet {
 public:
  explicit LineSet(uint64_t seed) : random_(seed) {}

  // Ends uniform in `extent`.
  void AddUniform(const Extent& extent);
  // Of `voxels` voxels exactly, in `extent`, which must be that long on some axis.
  void AddOfLength(const Extent& extent, int32_t voxels);

  size_t lines() const { return content_.colors.size() / 2; }
  uint64_t voxels() const { return voxels_; }
  Content Take();  // and it is empty

 private:
  using Units = int64_t;  // 2⁻⁸ voxel
  Units Between(Units lo, Units hi);
  void Add(const Units (&ends)[2][3]);

  std::mt19937_64 random_;
  Content content_;
  uint64_t voxels_ = 0;
};

// A colour that is not black.
uint32_t RandomColor(std::mt19937_64& random);

}  // namespace voxeld::bench::frame
