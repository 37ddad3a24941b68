// Types that all drawing messages are made of.
#pragma once

#include <array>
#include <cstdint>

namespace voxeld::client {

struct Vec3 {
  double x = 0, y = 0, z = 0;
};

struct Color {
  uint8_t r = 255, g = 255, b = 255;
};

// Row-major 3×4: p ↦ (m0·x + m1·y + m2·z + m3, m4·x + …, m8·x + …). The linear part must not be
// singular.
struct Affine {
  std::array<double, 12> m = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};

  static Affine Translate(const Vec3& by);
  static Affine Scale(const Vec3& by);
  static Affine Scale(double by) { return Scale({by, by, by}); }
  // Right-handed rotation about an axis through the origin; the axis may have any length but 0.
  static Affine Rotate(const Vec3& axis, double radians);

  bool operator==(const Affine&) const = default;
};

// Returns the map that applies `first`, then `second`.
Affine operator*(const Affine& second, const Affine& first);

// Diameter of a curve or point, or thickness of a surface; 0: one voxel wide.
struct Thickness {
  enum class Unit : uint8_t { kVoxels, kUnits };  // the display's voxels, or the entity's own units
  float value = 0;
  Unit unit = Unit::kVoxels;
};

enum class LineSampling : uint8_t { kThin, kEuclidean, kCover };
enum class SurfaceRule : uint8_t { kThin, kCover };
// kLines draws edges, or meridians and parallels 45° apart; kDots draws the places where those
// meet.
enum class Fill : uint8_t { kSurface, kSolid, kLines, kDots };

// A part of a space, its faces included; with `everything`, all of it, whatever the corners.
struct Region {
  Vec3 min, max;
  bool everything = false;
};

}  // namespace voxeld::client
