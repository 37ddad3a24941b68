// Tests pictures on triangles.
#include <bit>
#include <cstdint>
#include <functional>
#include <vector>

#include "gpu/primitives/texture.h"
#include "gpu/texture_levels.h"
#include "tests/conformance/conformance_test.h"

namespace voxeld::gpu::conformance {
namespace texture_test {

constexpr int32_t kSide = 40;
constexpr float kPlane = 20.5f;  // a layer of voxel centres

// Returns a square of two triangles across the volume, from corner to corner of a picture, which is
// repeated this often along each side.
ModelGeometry Square(uint32_t width, uint32_t height, const std::vector<uint32_t>& picture,
                     float times = 1) {
  ModelGeometry g;
  g.record.id = 1;
  g.record.kind = PrimitiveKind::kTriangles;
  g.record.color = 0xFFFFFF;
  g.record.vertex_count = 4;
  g.record.index_count = 6;
  g.record.texture_width = static_cast<uint16_t>(width);
  g.record.texture_height = static_cast<uint16_t>(height);
  g.positions = {0, 0, kPlane, kSide, 0, kPlane, kSide, kSide, kPlane, 0, kSide, kPlane};
  g.indices = {0, 1, 2, 0, 2, 3};
  for (const float place : {0.f, 0.f, times, 0.f, times, times, 0.f, times}) {
    g.colors.push_back(std::bit_cast<uint32_t>(place));
  }
  std::vector<uint32_t> texels = picture;
  texels.resize(TexelCount(width, height));
  FillLevels(width, height, texels);
  g.colors.insert(g.colors.end(), texels.begin(), texels.end());
  return g;
}

class Textures : public EngineConformance {
 protected:
  using Want = std::function<uint32_t(int32_t x, int32_t y)>;

  // Checks that everything drawn is in the plane, that each of its voxels is as wanted, and that
  // the oracle agrees.
  void ExpectPlane(const ModelGeometry& g, const Want& want, uint32_t tint = 0xFFFFFF) {
    SceneModel scene = SceneOf(g);
    scene.drawables[1].tint = tint;
    const std::vector<uint32_t> voxels = DrawnLikeOracle(scene, CubeTarget(kSide));
    ASSERT_EQ(voxels.size(), static_cast<size_t>(kSide) * kSide * kSide);
    size_t at = 0;
    for (int32_t z = 0; z < kSide; ++z) {
      for (int32_t y = 0; y < kSide; ++y) {
        for (int32_t x = 0; x < kSide; ++x, ++at) {
          const uint32_t expected = z == static_cast<int32_t>(kPlane) ? want(x, y) : 0;
          ASSERT_EQ(voxels[at], expected) << x << " " << y << " " << z;
        }
      }
    }
  }

  static uint32_t Color(uint32_t column, uint32_t row) {
    return 0x102030 + column * 0x090000 + row * 0x000700;
  }
  static std::vector<uint32_t> Picture(uint32_t width, uint32_t height) {
    std::vector<uint32_t> picture;
    for (uint32_t i = 0; i < width * height; ++i) picture.push_back(Color(i % width, i / width));
    return picture;
  }
};

INSTANTIATE_TEST_SUITE_P(Engines, Textures, testing::ValuesIn(EngineCases()),
                         [](const auto& info) { return info.param.name; });

TEST_P(Textures, TexelsLieWhereTheirPlacesAre) {
  // 5 × 8 voxels a texel.
  ExpectPlane(Square(8, 5, Picture(8, 5)), [](int32_t x, int32_t y) {
    return Color(static_cast<uint32_t>(x / 5), static_cast<uint32_t>(y / 8));
  });
}

TEST_P(Textures, ThePictureRepeats) {
  ExpectPlane(Square(4, 4, Picture(4, 4), 2), [](int32_t x, int32_t y) {
    return Color(static_cast<uint32_t>(x / 5 % 4), static_cast<uint32_t>(y / 5 % 4));
  });
}

TEST_P(Textures, ColoursAndTintAreMultiplied) {
  ModelGeometry g = Square(1, 1, {0x80FF40});
  g.record.color = 0x00FFFF;
  ExpectPlane(g, [](int32_t, int32_t) { return 0x00FF40; });
  ExpectPlane(
      g, [](int32_t, int32_t) { return 0x000040; }, 0xFF00FF);
  g.record.color_mode = ColorMode::kPerVertex;
  g.colors.insert(g.colors.begin(), {0xFF0000, 0xFF0000, 0xFF0000, 0xFF0000});
  ExpectPlane(g, [](int32_t, int32_t) { return 0x800000; });
}

// Four texels to a voxel in each direction: the level with one texel to a voxel is used, so they
// are averaged.
TEST_P(Textures, FineTexelsAreMeans) {
  std::vector<uint32_t> picture;
  for (uint32_t i = 0; i < 160 * 160; ++i) {
    picture.push_back((i % 160 + i / 160) % 2 == 0 ? 0xFF0000 : 0x00FF00);
  }
  ExpectPlane(Square(160, 160, picture), [](int32_t, int32_t) { return 0x808000; });
}

// Three columns of texels to two of voxels, which is not fine enough for averaging.
TEST_P(Textures, TexelsHalfAsLargeAsVoxelsAreDrawnAsTheyAre) {
  std::vector<uint32_t> picture;
  for (uint32_t i = 0; i < 60 * 40; ++i) picture.push_back(1 + i % 60 * 4);
  ExpectPlane(Square(60, 40, picture),
              [](int32_t x, int32_t) { return 1 + static_cast<uint32_t>((6 * x + 3) / 4) * 4; });
}

TEST_P(Textures, AnotherPictureTakesTheFirstsPlace) {
  SceneModel scene;
  scene.layers[1].id = 1;
  scene.geometries[1] = Square(8, 5, Picture(8, 5));
  scene.drawables[1] = {.id = 1, .geometry = 1, .layer = 1};
  const Target target = CubeTarget(kSide);
  EngineDriver engine = Make();
  ASSERT_TRUE(engine.SetTarget(target).ok());
  DeltaBuffer delta;
  delta.PutWhole(scene);
  ASSERT_TRUE(engine.Apply(delta).ok());
  ExpectLikeOracle(engine, scene, target);
  scene.geometries[2] = Square(3, 7, Picture(3, 7), 1.5f);
  scene.geometries[2].record.id = 2;
  scene.drawables[1].geometry = 2;
  DeltaBuffer change;
  change.Put(scene.geometries[2]);
  change.Put(scene.drawables[1]);
  change.Drop(Op::kDropGeometry, 1);
  scene.geometries.erase(1);
  ASSERT_TRUE(engine.Apply(change).ok());
  ExpectLikeOracle(engine, scene, target);
}

}  // namespace texture_test
}  // namespace voxeld::gpu::conformance
