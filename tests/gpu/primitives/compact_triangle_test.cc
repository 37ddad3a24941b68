// Compares compact triangles with the definition: voxels and colours, region by region.
#include "gpu/primitives/compact_triangle.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>

#include "tests/gpu/primitives/voxel_set.h"

namespace voxeld::gpu {
namespace {

constexpr int32_t kRegion[3] = {32, 32, 16};

using Colored = std::map<Voxel, std::set<uint32_t>>;

// Returns all voxels of the regions that the triangle's bounds touch, and one more around them.
Box3 Around(const Triangle& t) {
  Box3 box = BoundsOf(t);
  for (int a = 0; a < 3; ++a) {
    box.lo[a] = static_cast<int32_t>(FloorDiv(box.lo[a], kRegion[a]) - 1) * kRegion[a];
    box.hi[a] = static_cast<int32_t>(FloorDiv(box.hi[a], kRegion[a]) + 2) * kRegion[a];
  }
  return box;
}

Colored Defined(const Triangle& t) {
  Colored voxels;
  EmitTriangle(t, Around(t), [&](int32_t x, int32_t y, int32_t z, uint32_t rgb) {
    voxels[{x, y, z}].insert(rgb);
  });
  return voxels;
}

void AddRegion(const CompactTriangle& t, const uint32_t color[3], const int32_t at[3],
               Colored& voxels) {
  const CompactPart part = CompactPart::Of(t, at);
  const auto add = [&](int32_t place, auto&& color_of) {
    ASSERT_GE(place, 0);
    ASSERT_LT(place, 1 << 14);
    const Voxel voxel = {at[0] + (place & 31), at[1] + (place >> 5 & 31), at[2] + (place >> 10)};
    voxels[voxel].insert(color_of(voxel));
  };
  if (part.row_count() == 0) return;
  EmitCompactVertices(t, part, [&](int32_t place, int vertex) {
    add(place, [&](const Voxel&) { return color[vertex]; });
  });
  if ((t.flags & CompactTriangle::kFlat) != 0) {
    ASSERT_EQ(part.row_count(), 1);
    Box3 box;
    for (int a = 0; a < 3; ++a) box.lo[a] = at[a], box.hi[a] = at[a] + kRegion[a];
    EmitCompactFlat(t, color, box, [&](int32_t x, int32_t y, int32_t z, uint32_t rgb) {
      voxels[{x, y, z}].insert(rgb);
    });
    return;
  }
  for (int32_t row = 0; row < part.row_count(); ++row) {
    EmitCompactRow(t, part, row, [&](int32_t place) {
      add(place, [&](const Voxel& voxel) {
        int32_t relative[3];
        for (int a = 0; a < 3; ++a) {
          relative[a] = voxel[static_cast<size_t>(a)] - CompactAxis::Of(t, a).origin;
        }
        return (t.flags & CompactTriangle::kMixed) != 0 ? CompactColorAt(t, color, relative)
                                                        : color[0];
      });
    });
  }
}

Colored ByRegion(const Triangle& t) {
  const bool mixed = t.color[0] != t.color[1] || t.color[1] != t.color[2];
  const CompactTriangle compact = MakeCompact(t, 1, mixed);
  Colored voxels;
  const Box3 box = Around(t);
  int32_t at[3];
  for (at[2] = box.lo[2]; at[2] < box.hi[2]; at[2] += kRegion[2]) {
    for (at[1] = box.lo[1]; at[1] < box.hi[1]; at[1] += kRegion[1]) {
      for (at[0] = box.lo[0]; at[0] < box.hi[0]; at[0] += kRegion[0]) {
        AddRegion(compact, t.color, at, voxels);
      }
    }
  }
  return voxels;
}

void ExpectAsDefined(const Triangle& t) {
  ASSERT_TRUE(IsCompact(t));
  SCOPED_TRACE(testing::Message() << "rule " << static_cast<int>(t.rule) << ", vertices ("
                                  << t.v[0][0] << ", " << t.v[0][1] << ", " << t.v[0][2] << "), ("
                                  << t.v[1][0] << ", " << t.v[1][1] << ", " << t.v[1][2] << "), ("
                                  << t.v[2][0] << ", " << t.v[2][1] << ", " << t.v[2][2] << ")");
  ASSERT_TRUE(ByRegion(t) == Defined(t));
}

class CompactTriangles : public testing::TestWithParam<SurfaceRule> {
 protected:
  // Returns a triangle with vertices within `extent` of a place that is at most `far` units away;
  // `snap` usually divides the coordinates.
  Triangle Random(int64_t extent, int64_t far, int64_t snap) {
    Triangle t;
    t.rule = GetParam();
    Int3 place;
    for (int a = 0; a < 3; ++a) place[a] = Uniform(-far, far - extent);
    for (int i = 0; i < 3; ++i) {
      t.color[i] = static_cast<uint32_t>(Uniform(0, 0xFFFFFF));
      for (int a = 0; a < 3; ++a) {
        t.v[i][a] = place[a] + Uniform(0, extent);
        if (Uniform(0, 7) != 0) t.v[i][a] -= t.v[i][a] % snap;
        if (i > 0 && Uniform(0, 9) == 0) t.v[i][a] = t.v[i - 1][a];
      }
    }
    if (Uniform(0, 3) == 0) {  // in a plane across an axis, so that the other shadows have no area
      const int64_t a = Uniform(0, 2);
      t.v[2][static_cast<int>(a)] = t.v[1][static_cast<int>(a)] = t.v[0][static_cast<int>(a)];
    }
    if (Uniform(0, 2) != 0) t.color[1] = t.color[2] = t.color[0];
    return t;
  }
  int64_t Uniform(int64_t low, int64_t high) {
    return std::uniform_int_distribution<int64_t>(low, high)(random_);
  }

  std::mt19937_64 random_{7};
};

INSTANTIATE_TEST_SUITE_P(Rules, CompactTriangles,
                         testing::Values(SurfaceRule::kThin, SurfaceRule::kCover));

TEST_P(CompactTriangles, OfAnySizeAreAsDefined) {
  for (const int64_t extent : {40, 300, 700, 1500, 5000, 12000}) {
    const int count = static_cast<int>(4'000'000 / (extent * 20));
    for (int i = 0; i < std::min(count, 1500); ++i) {
      for (const int64_t snap : {1, 128, 256, 4096}) {
        ASSERT_NO_FATAL_FAILURE(ExpectAsDefined(Random(extent, 1 << 17, snap)));
      }
    }
  }
}

TEST_P(CompactTriangles, FarAwayAreAsDefined) {
  for (int i = 0; i < 200; ++i) {
    ASSERT_NO_FATAL_FAILURE(
        ExpectAsDefined(Random(3000, CompactTriangle::kMostUnits, i % 2 == 0 ? 1 : 256)));
  }
}

// Vertices on one line, on one point, and nearly so.
TEST_P(CompactTriangles, FlatAndNearlySoAreAsDefined) {
  for (int i = 0; i < 1500; ++i) {
    Triangle t = Random(i % 2 == 0 ? 8000 : 900, 1 << 15, i % 3 == 0 ? 256 : 1);
    const int64_t parts = Uniform(1, 7), at = Uniform(0, parts);
    for (int a = 0; a < 3; ++a) {
      const int64_t d = (t.v[1][a] - t.v[0][a]) / parts;
      t.v[1][a] = t.v[0][a] + d * parts;
      t.v[2][a] = t.v[0][a] + d * at + (i % 5 == 0 ? Uniform(-1, 1) : 0);
      if (i % 17 == 0) t.v[2][a] = t.v[1][a] = t.v[0][a];
    }
    ASSERT_NO_FATAL_FAILURE(ExpectAsDefined(t));
  }
}

// Corners at the greatest extents, where all bounds are reached.
TEST_P(CompactTriangles, OfTheGreatestExtentAreAsDefined) {
  constexpr int64_t kExtent = CompactTriangle::kMostExtent;
  for (int i = 0; i < 150; ++i) {
    Triangle t;
    t.rule = GetParam();
    for (int v = 0; v < 3; ++v) {
      t.color[v] = i % 3 == 0 ? static_cast<uint32_t>(Uniform(0, 0xFFFFFF)) : 0x123456;
      for (int a = 0; a < 3; ++a) {
        const int64_t corner = Uniform(0, 1) * kExtent;
        t.v[v][a] =
            (i % 2 == 0 ? 255 : 0) + corner + (i % 5 == 0 ? Uniform(0, 1) - corner / kExtent : 0);
      }
    }
    ASSERT_NO_FATAL_FAILURE(ExpectAsDefined(t));
  }
}

TEST_P(CompactTriangles, LargerOrFurtherAreNone) {
  Triangle t = Random(100, 1000, 1);
  ASSERT_TRUE(IsCompact(t));
  const int64_t least = std::min({t.v[0][1], t.v[1][1], t.v[2][1]});
  t.v[1][1] = least + CompactTriangle::kMostExtent + 1;
  EXPECT_FALSE(IsCompact(t));
  for (int i = 0; i < 3; ++i) t.v[i][1] = CompactTriangle::kMostUnits + 1;
  EXPECT_FALSE(IsCompact(t));
  for (int i = 0; i < 3; ++i) t.v[i][1] = -CompactTriangle::kMostUnits;
  EXPECT_TRUE(IsCompact(t));
}

// AreCompact applies to positions and holds for vertices, which are snapped to units.
TEST_P(CompactTriangles, BoundsOfPositionsTell) {
  constexpr double kLo[3] = {-16382, 0, 0}, kHi[3] = {0, 16382, 62.5};
  constexpr double kExtent[3] = {62.8, 62.8, 62.5};
  ASSERT_TRUE(AreCompact(kLo, kHi, kExtent));
  Triangle t;
  for (int i = 0; i < 3; ++i) {
    t.v[i][0] = Snap(-16382 + 31.4 * i);
    t.v[i][1] = Snap(16382 - 31.4 * i);
    t.v[i][2] = Snap(31.25 * i);
  }
  EXPECT_TRUE(IsCompact(t));
  constexpr double kFar[3] = {-16384, 0, 0}, kWide[3] = {62.8, 63.5, 62.5};
  EXPECT_FALSE(AreCompact(kFar, kHi, kExtent));
  EXPECT_FALSE(AreCompact(kLo, kHi, kWide));
}

}  // namespace
}  // namespace voxeld::gpu
