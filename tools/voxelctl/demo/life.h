// Life in three dimensions, a cellular automaton.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace voxeld::voxelctl {

// Cells in a cube whose opposite faces are neighbours. The rule, for each cell with 26 cells around
// it:
//   a live cell stays alive if exactly 4 cells around it are alive, and otherwise begins to fade;
//   an empty cell comes to life if exactly 4 cells around it are alive;
//   a fading cell is empty three steps later, and until then counts as neither.
class Life {
 public:
  static constexpr uint8_t kEmpty = 0, kAlive = 4;  // 3, 2, 1: fading

  // Makes an empty cube. Requires: `side` is at least 4.
  explicit Life(int side);

  int side() const { return side_; }
  // The cells are indexed by x + side · (y + side · z).
  std::span<const uint8_t> cells() const { return cells_; }
  uint8_t At(int x, int y, int z) const { return cells_[Index(x, y, z)]; }
  void Set(int x, int y, int z, uint8_t state) { cells_[Index(x, y, z)] = state; }

  // Empties the cube, and fills a cube in its middle, about half as wide, at random: a fifth of its
  // cells live, mirrored in its three middle planes; later steps keep the symmetry. The same seed
  // gives the same cells on every machine.
  void Sow(uint64_t seed);
  void Step();
  uint32_t living() const;

 private:
  // Accepts any integers; they wrap around.
  size_t Index(int x, int y, int z) const;

  int side_;
  std::vector<uint8_t> cells_, next_;
};

// Detects the end of a life: nothing lives, or the state repeats one of a few steps ago, or it has
// lasted long enough.
class LifeWatch {
 public:
  bool IsOver(const Life& life);

 private:
  std::vector<uint64_t> hashes_;  // of all steps
};

}  // namespace voxeld::voxelctl
