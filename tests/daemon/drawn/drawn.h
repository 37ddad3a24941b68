// Primitives as they are sent, drawn alone by the CPU's engine; other engines draw the same voxels
// (tests/conformance).
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <variant>
#include <vector>

#include "daemon/text/fonts.h"
#include "daemon/wire/primitive.h"
#include "tests/conformance/placed.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::drawn {

using gpu::conformance::Drawn;
using gpu::conformance::kHalfDiagonal;
using gpu::conformance::Placed;
using gpu::conformance::Placement;
using gpu::implicit::Vector;
using P = v1::Primitive;

// Vertices are snapped to 2⁻⁸ voxel along each axis, after rounding to single precision.
inline constexpr double kSnapped = 0.0034 + 1e-4;

inline void Set(v1::Vec3* out, const Vector& v) {
  out->set_x(v.x);
  out->set_y(v.y);
  out->set_z(v.z);
}
inline void Set(v1::Vertices* out, const std::vector<Vector>& points) {
  std::vector<float> positions;
  for (const Vector& p : points) {
    for (int a = 0; a < 3; ++a) positions.push_back(static_cast<float>(p[a]));
  }
  out->set_count(static_cast<uint32_t>(points.size()));
  out->set_positions(positions.data(), positions.size() * sizeof(float));
}

inline Vector Unit(const Vector& v) { return 1 / gpu::implicit::Length(v) * v; }

class DrawnPrimitives : public ::testing::Test {
 protected:
  explicit DrawnPrimitives(int32_t size)
      : size_(size),
        engine_(gpu::conformance::CaseOf("cpu", gpu::EngineKind::kCpu, false),
                {.threads = 1, .inline_execution = true}) {
    EXPECT_TRUE(engine_.SetTarget(gpu::conformance::CubeTarget(size)).ok());
  }

  Drawn Draw(const P& primitive, const gpu::Affine& map) {
    Content content;
    const wire::MaybeFault fault =
        wire::ToContent(wire::FieldPath("primitive"), primitive,
                        wire::DecodeContext{.limits = limits_, .fonts = &fonts_}, &content);
    EXPECT_FALSE(fault.has_value()) << fault->field << " " << fault->message;
    if (fault.has_value()) return {};
    gpu::conformance::SceneModel scene;
    scene.layers[1].id = 1;
    scene.layers[1].transform = map;
    if (const auto* one = std::get_if<GeometryPtr>(&content)) Put(**one, {}, scene);
    if (const auto* group = std::get_if<GroupPtr>(&content)) {
      for (const GroupData::Part& part : (*group)->parts)
        Put(*part.geometry, part.transform, scene);
    }
    gpu::conformance::DeltaBuffer delta;
    delta.Reset();
    delta.PutWhole(scene);
    EXPECT_EQ(engine_.Apply(delta), absl::OkStatus());
    EXPECT_EQ(engine_.Frame().status(), absl::OkStatus());
    return {size_, engine_.Voxels()};
  }

  const int32_t size_;
  text::Fonts fonts_;

 private:
  static void Put(const GeometryData& data, const gpu::Affine& map,
                  gpu::conformance::SceneModel& scene) {
    const uint64_t id = scene.geometries.size() + 1;
    gpu::conformance::ModelGeometry& g = scene.geometries[id];
    g.record = data.record;
    g.record.id = id;
    g.positions.assign(data.arrays.positions().begin(), data.arrays.positions().end());
    g.indices.assign(data.arrays.indices().begin(), data.arrays.indices().end());
    g.colors.assign(data.arrays.colors().begin(), data.arrays.colors().end());
    scene.drawables[id] = {.id = id, .geometry = id, .layer = 1};
    scene.drawables[id].transform = map;
  }

  Limits limits_;
  gpu::conformance::EngineDriver engine_;
};

// Measures how far the centres of voxels are from closely spaced places on a curve or a surface, up
// to `reach`.
class Distances {
 public:
  Distances(int32_t size, double reach)
      : size_(size),
        reach_(reach),
        squares_(static_cast<size_t>(size) * size * size, reach * reach) {}

  void Add(const Vector& p) {
    int32_t low[3], high[3];
    for (int a = 0; a < 3; ++a) {
      low[a] = std::max(0, static_cast<int32_t>(std::floor(p[a] - reach_)));
      high[a] = std::min(size_, static_cast<int32_t>(std::ceil(p[a] + reach_)));
    }
    for (int32_t z = low[2]; z < high[2]; ++z) {
      for (int32_t y = low[1]; y < high[1]; ++y) {
        double* const row = &squares_[Index(0, y, z)];
        const double dy = y + 0.5 - p.y, dz = z + 0.5 - p.z, across = dy * dy + dz * dz;
        for (int32_t x = low[0]; x < high[0]; ++x) {
          const double dx = x + 0.5 - p.x;
          row[x] = std::min(row[x], dx * dx + across);
        }
      }
    }
  }
  double At(int32_t x, int32_t y, int32_t z) const { return std::sqrt(squares_[Index(x, y, z)]); }

 private:
  size_t Index(int32_t x, int32_t y, int32_t z) const {
    return (static_cast<size_t>(z) * static_cast<size_t>(size_) + static_cast<size_t>(y)) *
               static_cast<size_t>(size_) +
           static_cast<size_t>(x);
  }

  int32_t size_;
  double reach_;
  std::vector<double> squares_;
};

}  // namespace voxeld::daemon::drawn
