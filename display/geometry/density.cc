#include "display/geometry/density.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <span>

namespace voxeld::display {
namespace {

constexpr int kRounds = 24;
constexpr int kRoundsBeforeKeepers = 6;
constexpr int32_t kCube = kDensityCube;
constexpr uint32_t kNoRow = UINT32_MAX;
constexpr size_t kSparseShare = 50;  // one in this many cubes may be darker than the rest
constexpr float kNearlyFull = 0.995F;

// The outer voxels of footprints (the inner axis, along which all is alike, is one voxel here),
// with a margin so that cubes may extend over the edges.
class Field {
 public:
  Field(const FootprintTable& table, const VoxelGrid& grid) {
    const bool product = table.flat_row == 0 && HasInner(table);
    const std::array<int32_t, 3> n = {grid.nx, grid.ny, grid.nz};
    for (size_t a = 0; a < 3; ++a) {
      const bool along = !(product && a == static_cast<size_t>(table.inner_axis)) && n[a] > 1;
      margin_[a] = along ? kCube - 1 : 0;
      size_[a] = static_cast<size_t>(along ? n[a] : 1) + 2 * static_cast<size_t>(margin_[a]);
      cube_ *= along ? static_cast<float>(std::min(kCube, n[a])) : 1.0F;
    }
  }

  size_t count() const { return size_[0] * size_[1] * size_[2]; }
  float cube() const { return cube_; }  // voxels in a cube
  size_t At(const FootprintEntry& e) const {
    const auto along = [&](size_t a, uint16_t i) {
      return margin_[a] == 0 ? 0 : static_cast<size_t>(i + margin_[a]);
    };
    return (along(2, e.z) * size_[1] + along(1, e.y)) * size_[0] + along(0, e.x);
  }

  // Computes sums over the cubes that begin (forward) or end at each voxel, as far as they lie in
  // the field.
  void Sum(std::vector<float>& of, bool forward) const {
    size_t step = 1;
    for (size_t a = 0; a < 3; step *= size_[a], ++a) {
      if (margin_[a] == 0) continue;
      for (size_t block = 0; block < of.size(); block += step * size_[a]) {
        const std::span<float> lines = std::span(of).subspan(block, step * size_[a]);
        for (size_t d = step; d < step * static_cast<size_t>(kCube); d *= 2) {
          if (forward) {
            for (size_t i = 0; i + d < lines.size(); ++i) lines[i] += lines[i + d];
          } else {
            for (size_t i = lines.size(); i-- > d;) lines[i] += lines[i - d];
          }
        }
      }
    }
  }

 private:
  static_assert(std::has_single_bit(static_cast<unsigned>(kCube)), "sums double");
  static bool HasInner(const FootprintTable& table) {
    return std::any_of(table.inner.entries.begin(), table.inner.entries.end(),
                       [](const FootprintEntry& e) { return e.x != 0 || e.y != 0 || e.z != 0; }) ||
           table.height > 1;
  }

  std::array<size_t, 3> size_{};
  std::array<int32_t, 3> margin_{};
  float cube_ = 1;
};

class Evener {
 public:
  Evener(const FootprintTable& table, const VoxelGrid& grid)
      : table_(table),
        field_(table, grid),
        factors_(table.outer.begin.size() - 1, 1.0F),
        floors_(factors_.size(), 0.0F) {
    entries_.reserve(table.outer.entries.size());
    for (size_t row = 0; row < factors_.size(); ++row) {
      const std::span<const FootprintEntry> list = table.outer.list(row);
      float all = 0;
      for (const FootprintEntry& e : list) all += static_cast<float>(e.weight);
      for (const FootprintEntry& e : list) {
        entries_.push_back(
            {static_cast<uint32_t>(field_.At(e)), static_cast<float>(e.weight) / all});
      }
    }
    reach_.assign(field_.count(), 0);
    for (const Entry& e : entries_) reach_[e.at] = 1;
    field_.Sum(reach_, true);
    about_ = reach_;
    field_.Sum(about_, false);
    light_ = LightOfCubes();
    std::vector<float> whole;
    for (size_t i = 0; i < light_.size(); ++i) {
      if (reach_[i] >= field_.cube()) whole.push_back(light_[i]);
    }
    if (whole.empty()) return;
    const auto sparse = whole.begin() + static_cast<ptrdiff_t>(whole.size() / kSparseShare);
    std::nth_element(whole.begin(), sparse, whole.end());
    target_ = *sparse / field_.cube();
  }

  // Returns whether any cube lies completely within reach.
  bool has_target() const { return target_ > 0; }
  const std::vector<float>& factors() const { return factors_; }
  bool kept(size_t row) const { return floors_[row] > 0; }

  // Moves each row towards the light of the sparsest cube, by the surplus or deficit of the cubes
  // of its voxels.
  void Round() {
    for (size_t i = 0; i < light_.size(); ++i) {
      light_[i] = light_[i] > 0 ? target_ * reach_[i] / light_[i] * reach_[i] : 0;
    }
    field_.Sum(light_, false);
    for (size_t row = 0; row < factors_.size(); ++row) {
      if (list(row).empty()) continue;
      float want = 0;
      for (const Entry& e : list(row)) want += e.share * light_[e.at] / about_[e.at];
      factors_[row] = std::clamp(factors_[row] * want, floors_[row], 1.0F);
    }
    light_ = LightOfCubes();
  }

  // Chooses few rows that together contain every voxel, in each set of inner lists: a voxel that no
  // chosen row has takes the one of its rows that has most such voxels, and among these the
  // brightest.
  void Keep(float least) {
    for (int32_t set = 0; set < table_.inner_sets; ++set) KeepOf(set, least);
    light_ = LightOfCubes();
  }

 private:
  void KeepOf(int32_t set, float least) {
    // Index rows by voxel.
    std::vector<uint32_t> begin(field_.count() + 1);
    const auto each = [&](auto call) {
      for (int32_t slice = set; slice < table_.slices; slice += table_.inner_sets) {
        for (int32_t u = 0; u < table_.width; ++u) {
          const auto row = static_cast<uint32_t>(slice) * static_cast<uint32_t>(table_.width) +
                           static_cast<uint32_t>(u);
          for (const FootprintEntry& e : table_.outer.list(row)) {
            if (e.weight == kFullWeight) call(row, field_.At(e));
          }
        }
      }
    };
    each([&](uint32_t, size_t voxel) { ++begin[voxel + 1]; });
    for (size_t i = 1; i < begin.size(); ++i) begin[i] += begin[i - 1];
    std::vector<uint32_t> rows(begin.back()), next(begin.begin(), begin.end() - 1);
    each([&](uint32_t row, size_t voxel) { rows[next[voxel]++] = row; });

    std::vector<uint8_t> kept(field_.count());
    const auto wants = [&](uint32_t row) {
      return std::count_if(table_.outer.list(row).begin(), table_.outer.list(row).end(),
                           [&](const FootprintEntry& e) {
                             return e.weight == kFullWeight && kept[field_.At(e)] == 0;
                           });
    };
    for (size_t voxel = 0; voxel < field_.count(); ++voxel) {
      if (kept[voxel] != 0 || begin[voxel] == begin[voxel + 1]) continue;
      uint32_t best = kNoRow;
      ptrdiff_t most = 0;
      for (uint32_t i = begin[voxel]; i < begin[voxel + 1]; ++i) {
        const ptrdiff_t count = wants(rows[i]);
        if (count < most) continue;
        if (count == most && factors_[rows[i]] <= factors_[best]) continue;
        best = rows[i];
        most = count;
      }
      floors_[best] = least;
      factors_[best] = std::max(factors_[best], least);
      for (const FootprintEntry& e : table_.outer.list(best)) {
        if (e.weight == kFullWeight) kept[field_.At(e)] = 1;
      }
    }
  }

  std::vector<float> LightOfCubes() const {
    std::vector<float> light(field_.count());
    for (size_t row = 0; row < factors_.size(); ++row) {
      for (const Entry& e : list(row)) light[e.at] += factors_[row] * e.share;
    }
    field_.Sum(light, true);
    return light;
  }

  // A voxel of a row, and its share of the row's light.
  struct Entry {
    uint32_t at;
    float share;
  };
  std::span<const Entry> list(size_t row) const {
    const std::vector<uint32_t>& begin = table_.outer.begin;
    return std::span(entries_).subspan(begin[row], begin[row + 1] - begin[row]);
  }

  const FootprintTable& table_;
  const Field field_;
  std::vector<Entry> entries_;  // corresponds to the table's outer entries
  std::vector<float> factors_, floors_;
  std::vector<float> reach_;  // voxels within reach of the cube that begins at each voxel
  std::vector<float> about_;  // sums of reach_ over the cubes that contain a voxel
  std::vector<float> light_;  // light of these cubes
  float target_ = 0;          // target light per voxel
};

}  // namespace

std::vector<uint16_t> EvenFactors(const FootprintTable& table, const VoxelGrid& grid,
                                  uint16_t least) {
  Evener evener(table, grid);
  if (!evener.has_target()) return {};
  for (int round = 0; round < kRounds; ++round) {
    if (round == kRoundsBeforeKeepers) evener.Keep(static_cast<float>(least) / 65535);
    evener.Round();
  }
  const std::vector<float>& factors = evener.factors();
  if (std::all_of(factors.begin(), factors.end(), [](float f) { return f >= kNearlyFull; })) {
    return {};
  }
  std::vector<uint16_t> out(factors.size());
  for (size_t row = 0; row < out.size(); ++row) {
    const auto factor = static_cast<int32_t>(std::lround(factors[row] * 65535.0F));
    out[row] = static_cast<uint16_t>(
        std::clamp(factor, evener.kept(row) ? int32_t{least} : 1, int32_t{65535}));
  }
  return out;
}

}  // namespace voxeld::display
