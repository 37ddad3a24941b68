// Compares volumes and isosurfaces, skewed and turned, with the values of their samples at every
// voxel's centre in double precision.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "tests/daemon/drawn/drawn.h"

namespace voxeld::daemon::drawn {
namespace grids_test {

using gpu::implicit::Cross;
using gpu::implicit::Dot;
using Color = std::array<double, 3>;

constexpr int32_t kSize = 48;
constexpr int kSamples[3] = {9, 8, 7};
constexpr double kDoubt =
    1e-4;  // the error of single precision in a coordinate, in samples; and in a number of about 1

// A grid, and the channels of its samples.
struct Reference {
  Vector corner = {-4, -3.5, -3}, edges[3] = {{7.5, 1, 0.4}, {-0.6, 6.5, 1}, {0.5, -1, 6}};
  bool nearest = false;
  int channels = 1;
  std::vector<double> samples;

  // Maps a voxel's centre to sample coordinates.
  Vector Place(const Vector& p) const {
    const Vector d = p - corner;
    const double volume = Dot(edges[0], Cross(edges[1], edges[2]));
    return {kSamples[0] * Dot(d, Cross(edges[1], edges[2])) / volume,
            kSamples[1] * Dot(edges[0], Cross(d, edges[2])) / volume,
            kSamples[2] * Dot(edges[0], Cross(edges[1], d)) / volume};
  }
  static bool Holds(const Vector& q) {
    for (int a = 0; a < 3; ++a) {
      if (q[a] < 0 || q[a] >= kSamples[a]) return false;
    }
    return true;
  }
  // Returns whether a place is so near to a face of the grid, or of a sample's cell, that single
  // precision may put it on the other side.
  bool IsDoubtful(const Vector& q) const {
    for (int a = 0; a < 3; ++a) {
      const double face = std::round(q[a]);
      const bool counts = nearest || face == 0 || face == kSamples[a];
      if (counts && std::fabs(q[a] - face) < kDoubt) return true;
    }
    return false;
  }
  double Sample(int x, int y, int z, int channel) const {
    const int at[3] = {std::clamp(x, 0, kSamples[0] - 1), std::clamp(y, 0, kSamples[1] - 1),
                       std::clamp(z, 0, kSamples[2] - 1)};
    const int index = (at[2] * kSamples[1] + at[1]) * kSamples[0] + at[0];
    return samples[static_cast<size_t>(index * channels + channel)];
  }
  double At(const Vector& q, int channel = 0) const {
    if (nearest) {
      return Sample(static_cast<int>(q.x), static_cast<int>(q.y), static_cast<int>(q.z), channel);
    }
    double sum = 0;
    int first[3];
    double t[3];
    for (int a = 0; a < 3; ++a) {
      first[a] = static_cast<int>(std::floor(q[a] - 0.5));
      t[a] = q[a] - 0.5 - first[a];
    }
    for (int i = 0; i < 8; ++i) {
      const int d[3] = {i & 1, i >> 1 & 1, i >> 2};
      double weight = 1;
      for (int a = 0; a < 3; ++a) weight *= d[a] == 1 ? t[a] : 1 - t[a];
      sum += weight * Sample(first[0] + d[0], first[1] + d[1], first[2] + d[2], channel);
    }
    return sum;
  }
  void Write(v1::Grid* out) const {
    Set(out->mutable_corner(), corner);
    Set(out->mutable_edge_a(), edges[0]);
    Set(out->mutable_edge_b(), edges[1]);
    Set(out->mutable_edge_c(), edges[2]);
    out->set_size_a(kSamples[0]);
    out->set_size_b(kSamples[1]);
    out->set_size_c(kSamples[2]);
    out->set_filter(nearest ? v1::Grid::NEAREST : v1::Grid::LINEAR);
    for (const double sample : samples) {
      const auto number = static_cast<float>(sample);
      if (channels == 1) {
        out->mutable_samples()->append(reinterpret_cast<const char*>(&number), sizeof(number));
      } else {
        out->mutable_samples()->push_back(static_cast<char>(std::lround(sample)));
      }
    }
    if (channels == 4) out->set_type(v1::ELEMENT_TYPE_RGBA8);
  }
};

// Waves from −1 to 1, rounded as they are sent.
Reference Waves(bool nearest) {
  Reference grid;
  grid.nearest = nearest;
  for (int i = 0; i < kSamples[0] * kSamples[1] * kSamples[2]; ++i)
    grid.samples.push_back(static_cast<float>(std::sin(i * 0.7) * std::cos(i * i * 0.01)));
  return grid;
}

constexpr double kValues[] = {-0.8, -0.1, 0.35, 0.9};
constexpr uint32_t kColors[] = {0x102030, 0xFF4020, 0x20FF90, 0xF0E0FF};
constexpr double kOpacities[] = {0, 0, 1, 0.6};

Color Channels(uint32_t rgb) {
  return {static_cast<double>(rgb >> 16), static_cast<double>(rgb >> 8 & 255),
          static_cast<double>(rgb & 255)};
}

// Interpolated linearly between the values.
Color Transferred(double value) {
  const double v = std::clamp(value, kValues[0], kValues[3]);
  size_t i = 0;
  while (i < 2 && v > kValues[i + 1]) ++i;
  const double t = (v - kValues[i]) / (kValues[i + 1] - kValues[i]);
  const Color from = Channels(kColors[i]), to = Channels(kColors[i + 1]);
  const double opacity = kOpacities[i] + t * (kOpacities[i + 1] - kOpacities[i]);
  Color color;
  for (size_t c = 0; c < 3; ++c) color[c] = opacity * (from[c] + t * (to[c] - from[c]));
  return color;
}

// The grid's corner is at a multiple of 2⁻⁸ voxel, to which origins are snapped.
Placement PlacedGrid() {
  Placement placed = Placed(0.8, 4.5, kSize / 2, 0.2);
  const Vector corner = placed.Forth(Reference().corner);
  for (int a = 0; a < 3; ++a)
    placed.map.m[a * 4 + 3] += std::round(corner[a] * 256) / 256 - corner[a];
  return placed;
}

class DrawnGrids : public DrawnPrimitives {
 protected:
  DrawnGrids() : DrawnPrimitives(kSize) {}
  Vector PlaceOf(const Reference& grid, int32_t x, int32_t y, int32_t z) const {
    return grid.Place(placed_.Back(x, y, z));
  }
  const Placement placed_ = PlacedGrid();
};

TEST_F(DrawnGrids, VolumesHaveTheColoursOfTheirNumbers) {
  constexpr double kStep = (0.9 + 0.8) / 256;
  for (const bool nearest : {false, true}) {
    const Reference grid = Waves(nearest);
    P p;
    grid.Write(p.mutable_volume()->mutable_grid());
    for (size_t i = 0; i < 4; ++i) {
      p.mutable_volume()->mutable_transfer()->add_values(kValues[i]);
      p.mutable_volume()->mutable_transfer()->add_colors(kColors[i]);
      p.mutable_volume()->mutable_transfer()->add_opacities(kOpacities[i]);
    }
    const Drawn drawn = Draw(p, placed_.map);
    uint64_t judged = 0, lit = 0, wrong = 0;
    drawn.ForEach([&](int32_t x, int32_t y, int32_t z) {
      const Vector q = PlaceOf(grid, x, y, z);
      if (grid.IsDoubtful(q)) return;
      const Color got = Channels(drawn.At(x, y, z));
      Color least = {}, most = {};
      if (Reference::Holds(q)) {
        // One of 256 steps to either side, and the rounding of colours.
        const double value = grid.At(q);
        for (int i = -8; i <= 8; ++i) {
          const Color color = Transferred(value + i / 8.0 * (kStep + kDoubt));
          for (size_t c = 0; c < 3; ++c) {
            least[c] = i == -8 ? color[c] - 1 : std::min(least[c], color[c] - 1);
            most[c] = i == -8 ? color[c] + 1 : std::max(most[c], color[c] + 1);
          }
        }
      }
      ++judged;
      lit += drawn.Lit(x, y, z);
      for (size_t c = 0; c < 3; ++c) wrong += got[c] < least[c] || got[c] > most[c];
    });
    EXPECT_GT(judged, 100'000u);
    EXPECT_GT(lit, 5000u);
    EXPECT_EQ(wrong, 0u) << (nearest ? "nearest" : "linear");
  }
}

TEST_F(DrawnGrids, VolumesHaveTheirOwnColours) {
  for (const bool nearest : {false, true}) {
    Reference grid;
    grid.nearest = nearest;
    grid.channels = 4;
    for (int i = 0; i < 4 * kSamples[0] * kSamples[1] * kSamples[2]; ++i)
      grid.samples.push_back(std::lround(127.5 + 127.5 * std::sin(i * i * 0.37)));
    P p;
    grid.Write(p.mutable_volume()->mutable_grid());
    const Drawn drawn = Draw(p, placed_.map);
    uint64_t lit = 0, wrong = 0;
    drawn.ForEach([&](int32_t x, int32_t y, int32_t z) {
      const Vector q = PlaceOf(grid, x, y, z);
      if (grid.IsDoubtful(q)) return;
      const bool holds = Reference::Holds(q);
      const double alpha = holds ? grid.At(q, 3) / 255 : 0;
      const Color got = Channels(drawn.At(x, y, z));
      lit += drawn.Lit(x, y, z);
      for (int c = 0; c < 3; ++c) {
        const double want = holds ? grid.At(q, c) * alpha : 0;
        wrong += std::fabs(got[static_cast<size_t>(c)] - want) > 1.5;
      }
    });
    EXPECT_GT(lit, 10'000u);
    EXPECT_EQ(wrong, 0u) << (nearest ? "nearest" : "linear");
  }
}

TEST_F(DrawnGrids, IsosurfacesHoldWhatIsNoLessThanTheirLevel) {
  for (const bool nearest : {false, true}) {
    const Reference grid = Waves(nearest);
    P p;
    grid.Write(p.mutable_isosurface()->mutable_grid());
    p.mutable_isosurface()->set_level(0.1);
    p.mutable_isosurface()->set_fill(v1::FILL_SOLID);
    const Drawn drawn = Draw(p, placed_.map);
    uint64_t lit = 0, judged = 0, wrong = 0;
    drawn.ForEach([&](int32_t x, int32_t y, int32_t z) {
      const Vector q = PlaceOf(grid, x, y, z);
      if (grid.IsDoubtful(q)) return;
      const double depth = Reference::Holds(q) ? grid.At(q) - 0.1 : -1;
      if (std::fabs(depth) < kDoubt) return;
      ++judged;
      lit += drawn.Lit(x, y, z);
      wrong += drawn.Lit(x, y, z) != (depth > 0);
    });
    EXPECT_GT(judged, 100'000u);
    EXPECT_GT(lit, 5000u);
    EXPECT_EQ(wrong, 0u) << (nearest ? "nearest" : "linear");
  }
}

// Decides whether a voxel is lit according to the rule; nullopt where single precision may decide
// otherwise.
class Shell {
 public:
  Shell(const Reference& grid, const Placement& placed, double level, double half)
      : grid_(grid), placed_(placed), level_(level), half_(half) {}

  std::optional<bool> Wants(const Drawn& drawn, int32_t x, int32_t y, int32_t z, bool cover) const {
    const double depth = DepthAt({x + 0.5, y + 0.5, z + 0.5});
    if (IsDoubtfulAt(x, y, z, depth)) return std::nullopt;
    bool doubtful = false;
    if (half_ > 0 && std::isfinite(depth)) {
      if (IsAtAKink(x, y, z)) return std::nullopt;
      const double reach = half_ * SlopeAt(x, y, z);
      if (std::fabs(depth) < reach - kDoubt) return true;
      doubtful = std::fabs(depth) <= reach + kDoubt;
    }
    bool lit = false;
    drawn.ForEachNeighbour(x, y, z, cover, [&](int32_t u, int32_t v, int32_t w) {
      const double other = DepthAt({u + 0.5, v + 0.5, w + 0.5});
      const double least = std::fabs(other) - std::fabs(depth);
      if (IsDoubtfulAt(u, v, w, other) ||
          ((other > 0) != (depth > 0) && std::fabs(least) < kDoubt)) {
        doubtful = true;
      } else if ((other > 0) != (depth > 0) && !(least < 0)) {
        lit = true;
      }
    });
    if (lit) return true;
    return doubtful ? std::nullopt : std::optional(false);
  }

 private:
  // Returns the level minus the value: beyond the grid, everything is infinitely far outside.
  double DepthAt(const Vector& voxel) const {
    const Vector q = grid_.Place(placed_.Back(voxel));
    return Reference::Holds(q) ? level_ - grid_.At(q) : std::numeric_limits<double>::infinity();
  }
  bool IsDoubtfulAt(int32_t x, int32_t y, int32_t z, double depth) const {
    return grid_.IsDoubtful(grid_.Place(placed_.Back(x, y, z))) || std::fabs(depth) < kDoubt;
  }
  // Returns whether other samples begin to count here, so that the slope jumps.
  bool IsAtAKink(int32_t x, int32_t y, int32_t z) const {
    const Vector q = grid_.Place(placed_.Back(x, y, z));
    for (int a = 0; a < 3; ++a) {
      if (std::fabs(q[a] - 0.5 - std::round(q[a] - 0.5)) < kDoubt) return true;
    }
    return false;
  }
  // Returns the slope of the values across a voxel, by central differences.
  double SlopeAt(int32_t x, int32_t y, int32_t z) const {
    constexpr double kAside = 1e-6;
    double square = 0;
    for (int a = 0; a < 3; ++a) {
      double value[2];
      for (int side = 0; side < 2; ++side) {
        double at[3] = {x + 0.5, y + 0.5, z + 0.5};
        at[a] += side == 0 ? -kAside : kAside;
        value[side] = grid_.At(grid_.Place(placed_.Back(Vector{at[0], at[1], at[2]})));
      }
      square += std::pow((value[1] - value[0]) / (2 * kAside), 2);
    }
    return std::sqrt(square);
  }

  const Reference& grid_;
  const Placement& placed_;
  double level_, half_;
};

TEST_F(DrawnGrids, IsosurfacesAreAsThickAsTheirShells) {
  const Reference grid = Waves(false);
  for (const double half : {0.0, 0.375, 1.25}) {
    for (const auto rule : {v1::SURFACE_RULE_THIN, v1::SURFACE_RULE_COVER}) {
      P p;
      grid.Write(p.mutable_isosurface()->mutable_grid());
      p.mutable_isosurface()->set_level(0.1);
      p.mutable_isosurface()->set_rule(rule);
      p.mutable_isosurface()->mutable_shell()->set_value(static_cast<float>(2 * half));
      const Drawn drawn = Draw(p, placed_.map);
      const Shell shell(grid, placed_, 0.1, half);
      uint64_t lit = 0, wrong = 0, doubtful = 0;
      drawn.ForEach(
          [&](int32_t x, int32_t y, int32_t z) {
            const std::optional<bool> want =
                shell.Wants(drawn, x, y, z, rule == v1::SURFACE_RULE_COVER);
            lit += drawn.Lit(x, y, z);
            doubtful += !want.has_value();
            wrong += want.has_value() && *want != drawn.Lit(x, y, z);
          },
          1);
      EXPECT_GT(lit, 2000u);
      EXPECT_LT(doubtful, lit / 20);
      EXPECT_EQ(wrong, 0u) << "half " << half << ", rule " << rule;
    }
  }
}

// From the first of two colours to the second, along a direction that is not an axis of the grid.
TEST_F(DrawnGrids, IsosurfacesHaveTheColoursOfTheirPlaces) {
  const Reference grid = Waves(false);
  const Vector along{0.5, -1.5, 1};
  for (const bool solid : {false, true}) {
    P p;
    grid.Write(p.mutable_isosurface()->mutable_grid());
    p.mutable_isosurface()->set_level(0.1);
    if (solid) p.mutable_isosurface()->set_fill(v1::FILL_SOLID);
    const Drawn plain = Draw(p, placed_.map);
    p.mutable_color_scale()->add_colors(0x00FF40);
    p.mutable_color_scale()->add_colors(0xFF0040);
    Set(p.mutable_color_scale()->mutable_along(), along);
    p.mutable_color_scale()->set_low(-1);
    p.mutable_color_scale()->set_high(1.5);
    const Drawn drawn = Draw(p, placed_.map);
    uint64_t lit = 0, wrong = 0, clamped = 0;
    drawn.ForEach([&](int32_t x, int32_t y, int32_t z) {
      wrong += drawn.Lit(x, y, z) != plain.Lit(x, y, z);
      if (!drawn.Lit(x, y, z)) return;
      ++lit;
      const double number = Dot(placed_.Back(x, y, z), along) / Dot(along, along);
      const double level = std::clamp((number + 1) / 2.5, 0.0, 1.0);
      clamped += level == 0 || level == 1;
      // One of 256 steps, and the rounding of colours.
      const Color got = Channels(drawn.At(x, y, z));
      wrong += std::fabs(got[0] - 255 * level) > 1.6 ||
               std::fabs(got[1] - 255 * (1 - level)) > 1.6 || got[2] != 0x40;
    });
    EXPECT_GT(lit, 2000u);
    EXPECT_GT(clamped, 20u);
    EXPECT_LT(clamped, lit / 2);
    EXPECT_EQ(wrong, 0u) << (solid ? "solid" : "surface");
  }
}

}  // namespace grids_test
}  // namespace voxeld::daemon::drawn
