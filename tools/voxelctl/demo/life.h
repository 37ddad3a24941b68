// Life in three dimensions, a cellular automaton.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace voxeld::voxelctl {

// Cells in a cube whose opposite faces are neighbours. The rule, with the 26 cells around each:
//   a cell that lives stays if exactly 4 of those around it live, and else begins to fade;
//   an empty cell comes to life if exactly 4 of those around it live;
//   a cell that fades is empty three steps later, and until then counts as neither.
class Life {
 public:
  static constexpr uint8_t kEmpty = 0, kAlive = 4;  // 3, 2, 1: fading

  // `side` from 4 on; all empty.
  explicit Life(int side);

  int side() const { return side_; }
  // By x + side · (y + side · z).
  std::span<const uint8_t> cells() const { return cells_; }
  uint8_t At(int x, int y, int z) const { return cells_[Index(x, y, z)]; }
  void Set(int x, int y, int z, uint8_t state) { cells_[Index(x, y, z)] = state; }

  // Empties it, and fills a cube in the middle, about half as wide as all, by chance: a fifth of its cells live, mirrored in
  // its three middle planes, and so is all that comes of it. The same for the same seed, on every machine.
  void Sow(uint64_t seed);
  void Step();
  uint32_t living() const;

 private:
  // Any whole numbers, around the cube's ends.
  size_t Index(int x, int y, int z) const;

  int side_;
  std::vector<uint8_t> cells_, next_;
};

// Says when a life has come to its end: nothing lives, or all is as it was a few steps ago, or it has been long enough.
class LifeWatch {
 public:
  bool IsOver(const Life& life);

 private:
  std::vector<uint64_t> hashes_;  // of all steps
};

}  // namespace voxeld::voxelctl
