// Surfaces separate inside from outside: no path of face steps crosses a THIN one, and no path at
// all a COVER one.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <string>

#include "gpu/primitives/list.h"
#include "tests/gpu/primitives/voxel_set.h"

namespace voxeld::gpu {
namespace surface_test {

constexpr int32_t kSize = 56;
const Box3 kBox = Cube(0, kSize);

struct Mesh {
  std::vector<double> positions;
  std::vector<uint32_t> indices;
};

// Returns a sphere of radius 1 around 0: an icosahedron whose faces are divided `times` times.
Mesh Icosphere(int times) {
  const double t = std::numbers::phi;
  Mesh m;
  m.positions = {-1, t,  0,  1, t, 0,  -1, -t, 0,  1, -t, 0, 0,  -1, t,  0,  1, t,
                 0,  -1, -t, 0, 1, -t, t,  0,  -1, t, 0,  1, -t, 0,  -1, -t, 0, 1};
  m.indices = {0, 11, 5,  0, 5,  1, 0, 1, 7, 0, 7,  10, 0, 10, 11, 1, 5, 9, 5, 11,
               4, 11, 10, 2, 10, 7, 6, 7, 1, 8, 3,  9,  4, 3,  4,  2, 3, 2, 6, 3,
               6, 8,  3,  8, 9,  4, 9, 5, 2, 4, 11, 6,  2, 10, 8,  6, 7, 9, 8, 1};
  for (; times > 0; --times) {
    std::vector<uint32_t> finer;
    std::map<std::pair<uint32_t, uint32_t>, uint32_t> middles;
    const auto middle = [&](uint32_t a, uint32_t b) {
      const auto [it, fresh] = middles.try_emplace(std::minmax(a, b), 0);
      if (fresh) {
        it->second = static_cast<uint32_t>(m.positions.size() / 3);
        for (uint32_t i = 0; i < 3; ++i) {
          m.positions.push_back((m.positions[a * 3 + i] + m.positions[b * 3 + i]) / 2);
        }
      }
      return it->second;
    };
    for (size_t i = 0; i < m.indices.size(); i += 3) {
      const uint32_t a = m.indices[i], b = m.indices[i + 1], c = m.indices[i + 2];
      const uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      for (uint32_t v : {a, ab, ca, b, bc, ab, c, ca, bc, ab, bc, ca}) finer.push_back(v);
    }
    m.indices = finer;
  }
  for (size_t i = 0; i < m.positions.size(); i += 3) {
    const double r = std::hypot(m.positions[i], m.positions[i + 1], m.positions[i + 2]);
    for (size_t a = 0; a < 3; ++a) m.positions[i + a] /= r;
  }
  return m;
}

// Returns the voxels of the mesh, stretched and moved, as triangles in units.
VoxelSet Drawn(const Mesh& m, const Affine& map, SurfaceRule rule) {
  std::vector<Int3> at;
  for (size_t i = 0; i < m.positions.size(); i += 3) {
    const Point3d p = Map(map, m.positions[i], m.positions[i + 1], m.positions[i + 2]);
    at.push_back({{Snap(p.x), Snap(p.y), Snap(p.z)}});
  }
  VoxelSet set;
  for (size_t i = 0; i < m.indices.size(); i += 3) {
    const Triangle t{{at[m.indices[i]], at[m.indices[i + 1]], at[m.indices[i + 2]]}, {}, rule};
    EmitTriangle(t, kBox, Into(set));
  }
  return set;
}

int Separation(SurfaceRule rule) { return rule == SurfaceRule::kThin ? 6 : 26; }

Affine RandomMap(std::mt19937& random) {
  std::uniform_real_distribution<double> shift(26, 30), size(5, 12), slant(-4, 4);
  Affine map;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      map.m[row * 4 + column] = row == column ? size(random) : slant(random);
    }
    map.m[row * 4 + 3] = shift(random);
  }
  return map;
}

Voxel MiddleOf(const Affine& map) {
  return {static_cast<int32_t>(map.m[3]), static_cast<int32_t>(map.m[7]),
          static_cast<int32_t>(map.m[11])};
}

TEST(Surface, ClosedMeshesAreNotCrossed) {
  std::mt19937 random(1);
  for (int i = 0; i < 12; ++i) {
    const Mesh mesh = Icosphere(i % 4);
    const Affine map = RandomMap(random);
    for (SurfaceRule rule : {SurfaceRule::kThin, SurfaceRule::kCover}) {
      const VoxelSet set = Drawn(mesh, map, rule);
      ASSERT_FALSE(set.contains(MiddleOf(map)));
      EXPECT_FALSE(Connected(set, kBox, {0, 0, 0}, MiddleOf(map), Separation(rule)))
          << "mesh " << i << ", rule " << static_cast<int>(rule);
    }
  }
}

// Corners on voxel centres and faces, sides along the axes: these cause ties.
TEST(Surface, BoxesOfTrianglesOnCentresAndFacesAreNotCrossed) {
  Mesh cube;
  for (int i = 0; i < 8; ++i) {
    for (int a = 0; a < 3; ++a) cube.positions.push_back(i >> a & 1 ? 1 : -1);
  }
  cube.indices = {0, 1, 3, 0, 3, 2, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                  2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 3, 7, 1, 7, 5};
  for (double at : {20.0, 20.5, 20.25}) {
    for (double half : {6.0, 6.5, 5.75}) {
      Affine map;
      for (int row = 0; row < 3; ++row) {
        map.m[row * 5] = half;
        map.m[row * 4 + 3] = at;
      }
      for (SurfaceRule rule : {SurfaceRule::kThin, SurfaceRule::kCover}) {
        const VoxelSet set = Drawn(cube, map, rule);
        EXPECT_FALSE(Connected(set, kBox, {0, 0, 0}, {20, 20, 20}, Separation(rule)))
            << at << " " << half << " " << static_cast<int>(rule);
      }
    }
  }
}

// Returns a cube from -1 to 1, each face divided into that many strips of two triangles.
Mesh CubeOfStrips(int strips) {
  Mesh m;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      for (int i = 0; i <= strips; ++i) {
        for (const double end : {-1.0, 1.0}) {
          double at[3];
          at[axis] = side;
          at[(axis + 1) % 3] = end;
          at[(axis + 2) % 3] = 2.0 * i / strips - 1;
          m.positions.insert(m.positions.end(), at, at + 3);
        }
        if (i == 0) continue;
        const auto last = static_cast<uint32_t>(m.positions.size() / 3 - 1);
        for (const uint32_t back : {3u, 2u, 1u, 2u, 0u, 1u}) m.indices.push_back(last - back);
      }
    }
  }
  return m;
}

TEST(Surface, CubesOfSliversAreNotCrossed) {
  std::mt19937 random(2);
  for (const int strips : {1, 7, 40, 500}) {
    const Mesh mesh = CubeOfStrips(strips);
    for (int i = 0; i < 3; ++i) {
      const Affine map = RandomMap(random);
      for (SurfaceRule rule : {SurfaceRule::kThin, SurfaceRule::kCover}) {
        const VoxelSet set = Drawn(mesh, map, rule);
        ASSERT_FALSE(set.contains(MiddleOf(map)));
        EXPECT_FALSE(Connected(set, kBox, {0, 0, 0}, MiddleOf(map), Separation(rule)))
            << strips << " strips, map " << i << ", rule " << static_cast<int>(rule);
      }
    }
  }
}

// Sides along the axes, through no centre and no face of a voxel: the outermost voxels of a block,
// however it is divided into triangles.
TEST(Surface, ACubeAlongTheAxesIsOneVoxelThick) {
  for (const int strips : {1, 3, 100}) {
    for (const double half : {5.7, 6.2}) {
      Affine map;
      for (int row = 0; row < 3; ++row) {
        map.m[row * 5] = half;
        map.m[row * 4 + 3] = 20.1;
      }
      const auto low = static_cast<int32_t>(20.1 - half), high = static_cast<int32_t>(20.1 + half);
      VoxelSet shell;
      for (int32_t z = low; z <= high; ++z) {
        for (int32_t y = low; y <= high; ++y) {
          for (int32_t x = low; x <= high; ++x) {
            const bool is_outermost =
                x == low || x == high || y == low || y == high || z == low || z == high;
            if (is_outermost) shell.insert({x, y, z});
          }
        }
      }
      const VoxelSet set = Drawn(CubeOfStrips(strips), map, SurfaceRule::kCover);
      EXPECT_EQ(set, shell) << strips << " " << half;
    }
  }
}

template <class Primitive>
VoxelSet DrawnSolid(const Affine& map, SurfaceRule rule, Fill fill) {
  GeometryRecord record;
  record.kind = Primitive::kKind;
  record.rule = rule;
  record.fill = fill;
  record.params[3] = Primitive::kKind == PrimitiveKind::kBox ? 2 : 1;
  record.params[4] = record.params[5] = 2;
  Source source;
  source.record = &record;
  source.solid = Solid::Of(Compose(map, Primitive::CanonicalMap(record)));
  VoxelSet set;
  EXPECT_EQ(Primitive::Count(source), 1u);
  Primitive::EmitVoxels(source, 0, kBox, Into(set));
  // A hollow shape is empty in the middle.
  EXPECT_EQ(set.contains(MiddleOf(map)), fill == Fill::kSolid);
  return set;
}

template <class Primitive>
class SolidSurface : public testing::Test {};
using Solids = testing::Types<Box, Sphere, Cylinder>;
TYPED_TEST_SUITE(SolidSurface, Solids);

TYPED_TEST(SolidSurface, IsNotCrossed) {
  std::mt19937 random(2);
  for (int i = 0; i < 5; ++i) {
    const Affine map = RandomMap(random);
    for (SurfaceRule rule : {SurfaceRule::kThin, SurfaceRule::kCover}) {
      const VoxelSet set = DrawnSolid<TypeParam>(map, rule, Fill::kSurface);
      EXPECT_FALSE(Connected(set, kBox, {0, 0, 0}, MiddleOf(map), Separation(rule)))
          << "solid " << i << ", rule " << static_cast<int>(rule);
    }
  }
}

TYPED_TEST(SolidSurface, LiesWithinTheSolidAndCoversMoreUnderCover) {
  std::mt19937 random(3);
  const Affine map = RandomMap(random);
  const VoxelSet solid = DrawnSolid<TypeParam>(map, SurfaceRule::kThin, Fill::kSolid);
  const VoxelSet thin = DrawnSolid<TypeParam>(map, SurfaceRule::kThin, Fill::kSurface);
  const VoxelSet cover = DrawnSolid<TypeParam>(map, SurfaceRule::kCover, Fill::kSurface);
  EXPECT_TRUE(std::includes(solid.begin(), solid.end(), cover.begin(), cover.end()));
  EXPECT_TRUE(std::includes(cover.begin(), cover.end(), thin.begin(), thin.end()));
  EXPECT_LT(thin.size(), solid.size());
}

TYPED_TEST(SolidSurface, ShiftedByWholeVoxelsShiftsItsVoxels) {
  std::mt19937 random(4);
  for (int i = 0; i < 10; ++i) {
    Affine map = RandomMap(random);
    for (int row = 0; row < 3; ++row) {  // smaller, to stay inside
      for (int column = 0; column < 3; ++column) map.m[row * 4 + column] *= 0.5;
    }
    Affine moved = map;
    const Voxel by = {3, -2, 5};
    for (int row = 0; row < 3; ++row) moved.m[row * 4 + 3] += by[static_cast<size_t>(row)];
    for (Fill fill : {Fill::kSurface, Fill::kSolid}) {
      EXPECT_TRUE(Shifted(DrawnSolid<TypeParam>(map, SurfaceRule::kThin, fill), by) ==
                  DrawnSolid<TypeParam>(moved, SurfaceRule::kThin, fill));
    }
  }
}

TYPED_TEST(SolidSurface, HasItsVolumeAtRadius20) {
  Affine map;
  for (int row = 0; row < 3; ++row) {
    map.m[row * 5] = 20;
    map.m[row * 4 + 3] = 27.3 + row * 0.21;
  }
  const double pi = std::numbers::pi, r3 = 20 * 20 * 20;
  const double want = TypeParam::kKind == PrimitiveKind::kBox      ? 8 * r3
                      : TypeParam::kKind == PrimitiveKind::kSphere ? 4 * pi / 3 * r3
                                                                   : 2 * pi * r3;
  const VoxelSet set = DrawnSolid<TypeParam>(map, SurfaceRule::kThin, Fill::kSolid);
  EXPECT_NEAR(static_cast<double>(set.size()), want, want * 0.01);
}

// Flattened completely, it is still there, one voxel thick and without holes: every column of
// voxels across it has one.
TYPED_TEST(SolidSurface, ThinnerThanAVoxelIsOneVoxelThick) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> place(25, 30);
  for (double thickness : {0.001, 0.2, 0.49}) {
    for (int i = 0; i < 20; ++i) {
      Affine map;
      map.m[0] = map.m[5] = 12;
      map.m[10] = thickness;
      for (int row = 0; row < 3; ++row) map.m[row * 4 + 3] = place(random);
      const VoxelSet set = DrawnSolid<TypeParam>(map, SurfaceRule::kThin, Fill::kSolid);
      const Voxel middle = MiddleOf(map);
      for (int32_t y = -5; y <= 5; ++y) {
        for (int32_t x = -5; x <= 5; ++x) {
          int count = 0;
          for (int32_t z = 0; z < kSize; ++z)
            count += set.contains({middle[0] + x, middle[1] + y, z});
          if (TypeParam::kKind == PrimitiveKind::kSphere) {
            EXPECT_LE(count, 2);
          } else {
            EXPECT_GE(count, 1) << thickness << " " << x << " " << y;
            EXPECT_LE(count, 2);
          }
        }
      }
      EXPECT_TRUE(set.contains(middle));
    }
  }
}

TEST(Triangle, AsSmallAsYouLikeCoversItsVertices) {
  for (SurfaceRule rule : {SurfaceRule::kThin, SurfaceRule::kCover}) {
    VoxelSet set;
    EmitTriangle({{{{1300, 1301, 1302}}, {{1301, 1301, 1303}}, {{1302, 1300, 1303}}}, {}, rule},
                 kBox, Into(set));
    EXPECT_TRUE(set.contains({5, 5, 5}));
  }
  VoxelSet line;  // no area: its longest edge
  EmitTriangle({{{{128, 128, 128}}, {{128 + 2560, 128, 128}}, {{128 + 512, 128, 128}}},
                {},
                SurfaceRule::kThin},
               kBox, Into(line));
  EXPECT_EQ(line.size(), 11u);
}

// x + y + z = 6 in voxels between (6, 0, 0), (0, 6, 0), (0, 0, 6): a centre's line along z meets it
// at z = 6 − x − y, so column (i, j) lights ⌊5 − i − j⌋ = 5 − i − j; the same along x and y.
TEST(Triangle, ThinVoxelsAreAsCountedByHand) {
  VoxelSet set;
  EmitTriangle({{{{1536, 0, 0}}, {{0, 1536, 0}}, {{0, 0, 1536}}}, {}, SurfaceRule::kThin}, kBox,
               Into(set));
  VoxelSet want = {{6, 0, 0}, {0, 6, 0}, {0, 0, 6}};  // those of its vertices
  for (int32_t i = 0; i <= 5; ++i) {
    for (int32_t j = 0; i + j <= 5; ++j) want.insert({i, j, 5 - i - j});
  }
  EXPECT_TRUE(set == want);
}

// Middle of three colours at the centroid: (85·3 …) by equal weights.
TEST(Triangle, ColoursFollowTheWeights) {
  const Triangle t{{{{0, 0, 128}}, {{768 * 4, 0, 128}}, {{0, 768 * 4, 128}}},
                   {0xFF0000, 0x00FF00, 0x0000FF},
                   SurfaceRule::kThin};
  std::map<Voxel, uint32_t> colors;
  EmitTriangle(t, kBox, [&](int32_t x, int32_t y, int32_t z, uint32_t rgb) {
    colors[{x, y, z}] = std::max(colors[{x, y, z}], rgb);
  });
  // Voxel (3, 3, 0): centre 3.5/12 = 0.2917 along both sides: red (1 − 2·0.2917)·255 = 106.25.
  EXPECT_EQ((colors[{3, 3, 0}]), 0x6A4A4Au);
}

}  // namespace surface_test
}  // namespace voxeld::gpu
