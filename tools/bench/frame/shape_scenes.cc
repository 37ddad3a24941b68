#include "tools/bench/frame/shape_scenes.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <utility>

#include "absl/strings/str_cat.h"
#include "gpu/implicit/graph.h"
#include "tools/bench/frame/line_set.h"

namespace voxeld::bench::frame {
namespace {

using display::PixelFormat;
using gpu::implicit::Graph;

// In voxels, from the middle of n³ of them.
Content Shape(const Graph& graph, Graph::Node surface, int32_t n) {
  Content content;
  content.record.kind = gpu::PrimitiveKind::kImplicit;
  content.record.color = 0x40C0FF;
  content.indices = *gpu::implicit::Compile(graph, {.surface = surface});
  for (int a = 0; a < 3; ++a) content.transform.m[a * 4 + 3] = n / 2.0;
  return content;
}

}  // namespace

Scene Gyroid(double share) {
  const int32_t n =
      std::max<int32_t>(64, static_cast<int32_t>(std::lround(512 * std::cbrt(share))));
  Scene scene = OneLayer("gyroid", Stack(n, n, n, PixelFormat::kBitPlanes3));
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
                         Stack(n, n, n, PixelFormat::kBitPlanes3));
  Graph graph;
  Graph::Node sum = graph.Square(graph.Axis(0));
  for (int a = 1; a < 3; ++a) sum = graph.Add(sum, graph.Square(graph.Axis(a)));
  const double radius = n / 2.0 - 4;
  scene.contents.push_back(Shape(graph, graph.Sub(sum, graph.Constant(radius * radius)), n));
  return scene;
}

Scene InstancedSpheres(uint64_t count, uint64_t seed) {
  Scene scene = OneLayer("spheres", Stack(512, 512, 512, PixelFormat::kBitPlanes3));
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
  Scene scene = OneLayer("cloud", Stack(512, 512, 512, PixelFormat::kBitPlanes3));
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

}  // namespace voxeld::bench::frame
