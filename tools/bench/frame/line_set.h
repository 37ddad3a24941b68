// Sets of lines whose voxels are counted while they are made. Ends are multiples of 2⁻⁸ voxel, to
// which the engine snaps them, so the count is exact.
#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "tools/bench/frame/scene.h"

namespace voxeld::bench::frame {

// The voxels [lo, hi).
struct Extent {
  int32_t lo[3] = {0, 0, 0};
  int32_t hi[3];
};

// THIN lines in one geometry, as pairs of vertices; both ends of a line have its colour.
class LineSet {
 public:
  explicit LineSet(uint64_t seed) : random_(seed) {}

  // Adds a line whose ends are uniform in `extent`.
  void AddUniform(const Extent& extent);
  // Adds a line of exactly `voxels` voxels in `extent`, which must be at least that long on some
  // axis.
  void AddOfLength(const Extent& extent, int32_t voxels);

  size_t lines() const { return content_.colors.size() / 2; }
  uint64_t voxels() const { return voxels_; }
  Content Take();  // empties the set

 private:
  using Units = int64_t;  // 2⁻⁸ voxel
  Units Between(Units lo, Units hi);
  void Add(const Units (&ends)[2][3]);

  std::mt19937_64 random_;
  Content content_;
  uint64_t voxels_ = 0;
};

// Returns a colour that is not black.
uint32_t RandomColor(std::mt19937_64& random);

}  // namespace voxeld::bench::frame
