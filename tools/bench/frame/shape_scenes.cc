#include "tools/bench/frame/shape_scenes.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <random>
#include <utility>

#include "absl/strings/str_cat.h"
#include "gpu/implicit/graph.h"
#include "gpu/primitives/samples.h"
#include "gpu/samples_bricks.h"
#include "tools/bench/frame/line_set.h"

namespace voxeld::bench::frame {
namespace {

using display::PixelFormat;
using gpu::implicit::Graph;

// Returns the shape in voxels, relative to the middle of n³ voxels.
Content Shape(const Graph& graph, Graph::Node surface, int32_t n) {
  Content content;
  content.record.kind = gpu::PrimitiveKind::kImplicit;
  content.record.color = 0x40C0FF;
  content.indices = *gpu::implicit::Compile(graph, {.surface = surface});
  for (int a = 0; a < 3; ++a) content.transform.m[a * 4 + 3] = n / 2.0;
  return content;
}

// Returns the side of a cube with that share of the volume of 512³.
int32_t SideOf(double share) {
  return std::max<int32_t>(64, static_cast<int32_t>(std::lround(512 * std::cbrt(share))));
}

}  // namespace

Scene Gyroid(double share) {
  const int32_t n = SideOf(share);
  Scene scene = OneLayer("gyroid", Stack(n, n, n, PixelFormat::kBitPlanes));
  Graph graph;
  Graph::Node sum = graph.Constant(0);
  for (int a = 0; a < 3; ++a) {
    const Graph::Node wave = graph.Constant(8 * 2 * std::numbers::pi / n);
    const Graph::Node s = graph.Sin(graph.Mul(wave, graph.Axis(a)));
    const Graph::Node c = graph.Cos(graph.Mul(wave, graph.Axis((a + 1) % 3)));
    sum = a == 0 ? graph.Mul(s, c) : graph.Add(sum, graph.Mul(s, c));
  }
  Content shape = Shape(graph, sum, n);
  shape.record.thickness = 1;
  scene.contents.push_back(std::move(shape));
  return scene;
}

Scene ImplicitSphere(int32_t n) {
  Scene scene = OneLayer(absl::StrCat("implicit sphere, ", n, "\xC2\xB3"),
                         Stack(n, n, n, PixelFormat::kBitPlanes));
  Graph graph;
  Graph::Node sum = graph.Square(graph.Axis(0));
  for (int a = 1; a < 3; ++a) sum = graph.Add(sum, graph.Square(graph.Axis(a)));
  const double radius = n / 2.0 - 4;
  scene.contents.push_back(Shape(graph, graph.Sub(sum, graph.Constant(radius * radius)), n));
  return scene;
}

Scene InstancedSpheres(uint64_t count, uint64_t seed) {
  Scene scene = OneLayer("spheres", Stack(512, 512, 512, PixelFormat::kBitPlanes));
  std::mt19937_64 random(seed);
  Content sphere;
  sphere.record.kind = gpu::PrimitiveKind::kSphere;
  sphere.record.params[3] = 4;
  for (uint64_t i = 0; i < count; ++i) {
    sphere.record.color = RandomColor(random);
    for (int a = 0; a < 3; ++a) {
      sphere.transform.m[a * 4 + 3] = 5 + static_cast<double>(random() % (501 * 256)) / 256;
    }
    scene.contents.push_back(sphere);
  }
  return scene;
}

Scene CubePoints(uint64_t count, uint64_t seed) {
  Scene scene = OneLayer("cloud", Stack(512, 512, 512, PixelFormat::kBitPlanes));
  std::mt19937_64 random(seed);
  Content points;
  points.record.kind = gpu::PrimitiveKind::kPoints;
  points.record.color_mode = gpu::ColorMode::kPerVertex;
  for (uint64_t i = 0; i < count; ++i) {
    for (int a = 0; a < 3; ++a) {
      points.positions.push_back(static_cast<float>(random() % (511 * 256)) / 256);
    }
    points.colors.push_back(RandomColor(random));
  }
  scene.voxels = scene.scene_voxels = count;
  scene.contents.push_back(std::move(points));
  return scene;
}

Scene SampledVolume(bool by_level, double share) {
  const int32_t side = SideOf(share);
  const uint32_t count = static_cast<uint32_t>(side) / 2;
  Scene scene = OneLayer(by_level ? "isosurface" : "volume",
                         Stack(side, side, side, PixelFormat::kBitPlanes));
  Content content;
  content.record.kind = gpu::PrimitiveKind::kSamples;
  content.record.color = 0x40C0FF;
  gpu::SampleHead head = {};
  for (uint32_t& size : head.size) size = count;
  head.format = gpu::SampleFormat::kU16;
  head.by_level = by_level ? 1 : 0;
  head.scale = 256.0f / 65536.0f;
  head.level = 32768;
  head.bricks = gpu::BrickWords(head.size);
  content.indices.resize(gpu::SampleWords(head.size, static_cast<uint32_t>(head.format)));
  std::memcpy(content.indices.data(), &head, sizeof(head));
  // The upper three quarters of the values are coloured, from dark to light.
  for (uint32_t i = 64; i < gpu::SampleHead::kTableEntries; ++i) {
    content.indices[gpu::kSampleHeadWords + i] =
        gpu::SampleHead::kDrawn | i << 16 | (i / 2) << 8 | (255 - i);
  }
  auto* const samples = reinterpret_cast<uint16_t*>(
      &content.indices[gpu::kSampleHeadWords + gpu::SampleHead::kTableEntries + head.bricks]);
  // The samples are waves in three directions.
  size_t at = 0;
  for (uint32_t z = 0; z < count; ++z) {
    for (uint32_t y = 0; y < count; ++y) {
      for (uint32_t x = 0; x < count; ++x) {
        const double sum = std::sin(x * 0.09) + std::sin(y * 0.07 + x * 0.02) + std::sin(z * 0.08);
        samples[at++] = static_cast<uint16_t>((sum + 3) / 6 * 65535);
      }
    }
  }
  gpu::FillBricks(content.record, content.indices);
  // The volume is turned by 30° about two axes, so that it fills most of the display.
  const double c = std::cos(std::numbers::pi / 6), s = std::sin(std::numbers::pi / 6);
  constexpr double kScale = 1.4;
  const double turn[9] = {c, -s * c, s * s, s, c * c, -c * s, 0, s, c};
  for (int row = 0; row < 3; ++row) {
    double middle = 0;
    for (int col = 0; col < 3; ++col) {
      content.transform.m[row * 4 + col] = kScale * turn[row * 3 + col];
      middle += content.transform.m[row * 4 + col] * count / 2;
    }
    const auto half = side / 2;
    content.transform.m[row * 4 + 3] = half - middle;
  }
  scene.contents.push_back(std::move(content));
  return scene;
}

}  // namespace voxeld::bench::frame
