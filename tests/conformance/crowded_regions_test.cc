// Tests cases that engines draw in other ways because there are many items, or because they are
// small, full or empty: numbers of solids around each threshold, meshes that fill tiles or leave
// them empty, and grids of samples around tiles and at their edges.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include "gpu/primitives/samples.h"
#include "gpu/samples_bricks.h"
#include "tests/conformance/conformance_test.h"

namespace voxeld::gpu::conformance {
namespace {

class CrowdedRegions : public EngineConformance {
 protected:
  double Random(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  // Rotates about a random axis, and then stretches each of the shape's own axes.
  void Turn(Affine& map, double least, double most) {
    double axis[3], length = 0;
    for (double& a : axis) {
      a = Random(-1, 1);
      length += a * a;
    }
    for (double& a : axis) a /= std::sqrt(length);
    const double angle = Random(0, 3), c = std::cos(angle), s = std::sin(angle);
    const double cross[3][3] = {
        {0, -axis[2], axis[1]}, {axis[2], 0, -axis[0]}, {-axis[1], axis[0], 0}};
    for (int column = 0; column < 3; ++column) {
      const double scale = Random(least, most);
      for (int row = 0; row < 3; ++row) {
        map.m[row * 4 + column] = scale * (axis[row] * axis[column] * (1 - c) +
                                           (row == column ? c : 0) + s * cross[row][column]);
      }
    }
  }
  void PutLayer(uint64_t id) {
    scene_.layers[id].id = id;
    scene_.layers[id].order = static_cast<int32_t>(id);
  }

  // Inserts nine geometries: each kind as a thin surface, as a covering one, and solid.
  void PutSolids() {
    for (uint64_t id = 1; id <= 9; ++id) {
      GeometryRecord& g = scene_.geometries[id].record;
      g.id = id;
      g.kind = static_cast<PrimitiveKind>(4 + id % 3);
      g.fill = id > 6 ? Fill::kSolid : Fill::kSurface;
      g.rule = id > 3 ? SurfaceRule::kCover : SurfaceRule::kThin;
      g.color = 0x0D1B29u * static_cast<uint32_t>(id);
      const float params[] = {0.125f, 0, -0.25f, 1, 1.5f, 1};
      std::copy(std::begin(params), std::end(params), g.params);
    }
  }
  DrawableRecord& PutSolid(uint64_t id, uint64_t layer, double least, double most) {
    DrawableRecord& d = scene_.drawables[id];
    d = {.id = id, .geometry = 1 + random_() % 9, .layer = layer};
    d.priority = static_cast<uint32_t>(random_() % 3);
    d.erase = random_() % 16 == 0 ? 1 : 0;
    Turn(d.transform, least, most);
    return d;
  }

  // Inserts a grid with `samples` along one axis and a little fewer along the others; its values
  // are waves, and floats are NaN or −∞ here and there.
  void PutGrid(SampleFormat format, uint32_t samples) {
    SampleHead head = {};
    for (uint32_t a = 0; a < 3; ++a) head.size[a] = samples - a;
    head.format = format;
    const double most = format == SampleFormat::kU8 ? 255 : 60000;
    head.low = static_cast<float>(most / 16);
    head.scale = static_cast<float>(300 / most);
    head.bricks = BrickWords(head.size);
    ModelGeometry& g = scene_.geometries[1];
    g.record.id = 1;
    g.record.kind = PrimitiveKind::kSamples;
    g.indices.resize(SampleWords(head.size, static_cast<uint32_t>(format)));
    std::memcpy(g.indices.data(), &head, sizeof(head));
    for (uint32_t i = 0; i < SampleHead::kTableEntries; ++i) {
      const uint32_t color = static_cast<uint32_t>(random_() & 0xFFFFFF);
      g.indices[kSampleHeadWords + i] = i % 32 < 3 ? 0 : color | SampleHead::kDrawn;
    }
    auto* const bytes = reinterpret_cast<unsigned char*>(
        &g.indices[kSampleHeadWords + SampleHead::kTableEntries + head.bricks]);
    size_t at = 0;
    for (uint32_t z = 0; z < head.size[2]; ++z) {
      for (uint32_t y = 0; y < head.size[1]; ++y) {
        for (uint32_t x = 0; x < head.size[0]; ++x, ++at) {
          const double wave = (std::sin(x * 0.7) + std::sin(y * 0.5 + x * 0.2) + std::sin(z)) / 6;
          const double value = (wave + 0.5) * most;
          if (format == SampleFormat::kU8) bytes[at] = static_cast<unsigned char>(value);
          if (format == SampleFormat::kU16) {
            const auto number = static_cast<uint16_t>(value);
            std::memcpy(bytes + 2 * at, &number, 2);
          }
          if (format == SampleFormat::kF32) {
            float number = static_cast<float>(value);
            if (random_() % 64 == 0) number = std::numeric_limits<float>::quiet_NaN();
            if (random_() % 64 == 0) number = -std::numeric_limits<float>::infinity();
            std::memcpy(bytes + 4 * at, &number, 4);
          }
        }
      }
    }
    g.record.index_count = static_cast<uint32_t>(g.indices.size());
    FillBricks(g.record, g.indices);
  }

  std::mt19937_64 random_{SeedOr(20261125)};
  SceneModel scene_;
};

INSTANTIATE_TEST_SUITE_P(Engines, CrowdedRegions, testing::ValuesIn(EngineCases()),
                         [](const auto& info) { return info.param.name; });

// Regions have 32×32×16 voxels: here some are whole, and some end with the volume.
TEST_P(CrowdedRegions, SolidsOfEverySize) {
  constexpr int32_t kSide = 52;
  PutSolids();
  for (const uint64_t layer : {1, 2}) PutLayer(layer);
  scene_.layers[2].opacity = 160;
  for (uint64_t id = 1; id <= 240; ++id) {
    // From less than a voxel to far above the threshold for small ones.
    const double size = id % 4 == 0 ? 0.3 : id % 4 == 1 ? 3 : id % 4 == 2 ? 6 : 9;
    DrawableRecord& d = PutSolid(id, 1 + id % 2, 0.5 * size, size);
    for (int a = 0; a < 3; ++a) d.transform.m[a * 4 + 3] = Random(-3, kSide + 3);
  }
  EXPECT_GT(CountLit(DrawnLikeOracle(scene_, CubeTarget(kSide))), 10'000u);
}

// More than fit into a block of threads at once, and more than a block has threads.
TEST_P(CrowdedRegions, ManySolidsInOneRegion) {
  constexpr int32_t kSide = 40;
  PutSolids();
  PutLayer(1);
  for (uint64_t id = 1; id <= 1300; ++id) {
    DrawableRecord& d = PutSolid(id, 1, 0.5, id % 8 == 0 ? 6 : 2.5);
    for (int a = 0; a < 3; ++a) d.transform.m[a * 4 + 3] = Random(1, a == 2 ? 15 : 31);
  }
  EXPECT_GT(CountLit(DrawnLikeOracle(scene_, CubeTarget(kSide))), 1'000u);
}

TEST_P(CrowdedRegions, FilledMeshesWithFullTilesAndNone) {
  constexpr int32_t kSide = 84;
  constexpr uint32_t kCorners[6][6] = {{0, 1, 3, 0, 3, 2}, {4, 5, 7, 4, 7, 6}, {0, 1, 5, 0, 5, 4},
                                       {2, 3, 7, 2, 7, 6}, {0, 2, 6, 0, 6, 4}, {1, 3, 7, 1, 7, 5}};
  PutLayer(1);
  // Two boxes far apart, with tiles between them; one over both; one in a single tile; one beyond
  // the volume.
  const struct {
    uint64_t id;  // the id of its geometry
    float corner[2][3];
  } boxes[] = {{1, {{1, 2, 3}, {40.4f, 50, 36}}},
               {1, {{70, 60.2f, 65}, {83, 81, 79.6f}}},
               {2, {{-9, 30, 20}, {95, 37, 70}}},
               {3, {{17.2f, 18, 19}, {20, 30.7f, 31}}}};
  for (uint64_t id = 1; id <= 3; ++id) {
    ModelGeometry& g = scene_.geometries[id];
    g.record.id = id;
    g.record.kind = PrimitiveKind::kFilled;
    g.record.color = 0x301040u * static_cast<uint32_t>(id);
    for (const auto& box : boxes) {
      if (box.id != id) continue;
      const auto first = static_cast<uint32_t>(g.positions.size() / 3);
      for (uint32_t corner = 0; corner < 8; ++corner) {
        for (uint32_t a = 0; a < 3; ++a) g.positions.push_back(box.corner[corner >> a & 1][a]);
      }
      for (const auto& side : kCorners) {
        for (const uint32_t corner : side) g.indices.push_back(first + corner);
      }
    }
    g.record.vertex_count = static_cast<uint32_t>(g.positions.size() / 3);
    g.record.index_count = static_cast<uint32_t>(g.indices.size());
    scene_.drawables[id] = {.id = id, .geometry = id, .layer = 1};
    scene_.drawables[id].priority = static_cast<uint32_t>(id % 3);
  }
  const std::vector<uint32_t> voxels = DrawnLikeOracle(scene_, CubeTarget(kSide));
  const auto at = [&](int x, int y, int z) {
    return voxels[(static_cast<size_t>(z) * kSide + static_cast<size_t>(y)) * kSide +
                  static_cast<size_t>(x)];
  };
  EXPECT_EQ(at(5, 5, 5), 0x301040u);
  EXPECT_EQ(at(39, 20, 20), 0x301040u);
  EXPECT_EQ(at(75, 70, 70), 0x301040u);
  EXPECT_EQ(at(60, 33, 40), 0x602080u);
  EXPECT_EQ(at(60, 55, 60), 0u);
}

TEST_P(CrowdedRegions, GridsOfNumbersWithinAndAtTheirRims) {
  constexpr int32_t kSide = 50;
  PutLayer(1);
  for (const SampleFormat format : {SampleFormat::kU8, SampleFormat::kU16, SampleFormat::kF32}) {
    for (const double scale : {0.3, 1.4, 2.5}) {
      SCOPED_TRACE(testing::Message() << static_cast<int>(format) << " at " << scale);
      const uint32_t samples = scale < 1 ? 70 : 33;
      PutGrid(format, samples);
      DrawableRecord& d = scene_.drawables[1];
      d = {.id = 1, .geometry = 1, .layer = 1, .tint = 0xC0FF80};
      Turn(d.transform, scale, scale);
      for (int a = 0; a < 3; ++a) {
        double middle = 0;
        for (int b = 0; b < 3; ++b) middle += d.transform.m[a * 4 + b] * samples / 2;
        d.transform.m[a * 4 + 3] = kSide / 2.0 - middle + Random(-4, 4);
      }
      EXPECT_GT(CountLit(DrawnLikeOracle(scene_, CubeTarget(kSide))), 1'000u);
    }
  }
}

}  // namespace
}  // namespace voxeld::gpu::conformance
