// Single shapes, turned and off the grid, for comparison with known properties in double precision.
#pragma once

#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "gpu/implicit/field_shape.h"
#include "gpu/implicit/program.h"
#include "gpu/primitives/samples.h"
#include "gpu/samples_bricks.h"
#include "tests/conformance/conformance_test.h"

namespace voxeld::gpu::conformance {

using implicit::FieldShape;
using implicit::Graph;
using implicit::Vector;

inline constexpr double kHalfDiagonal = 0.8660254037844386;

// A rotation, a scale and a translation.
struct Placement {
  Affine map;
  double scale = 1;

  Vector Forth(const Vector& p) const {
    double v[3];
    for (int r = 0; r < 3; ++r) {
      v[r] =
          map.m[r * 4] * p.x + map.m[r * 4 + 1] * p.y + map.m[r * 4 + 2] * p.z + map.m[r * 4 + 3];
    }
    return {v[0], v[1], v[2]};
  }
  // The inverse of a rotation is its transpose.
  Vector Back(const Vector& p) const {
    const double d[3] = {p.x - map.m[3], p.y - map.m[7], p.z - map.m[11]};
    double q[3];
    for (int c = 0; c < 3; ++c) {
      q[c] = (map.m[c] * d[0] + map.m[4 + c] * d[1] + map.m[8 + c] * d[2]) / (scale * scale);
    }
    return {q[0], q[1], q[2]};
  }
  // Maps a voxel's centre back.
  Vector Back(int32_t x, int32_t y, int32_t z) const {
    return Back(Vector{x + 0.5, y + 0.5, z + 0.5});
  }
};

// Returns a rotation by `angle` about (1, 2, 3), followed by others, that maps the origin to
// (middle, middle, middle), plus `off` and more.
inline Placement Placed(double angle, double scale, double middle, double off) {
  const double length = std::sqrt(14.0), axis[3] = {1 / length, 2 / length, 3 / length};
  const double c = std::cos(angle), s = std::sin(angle);
  const double cross[3][3] = {
      {0, -axis[2], axis[1]}, {axis[2], 0, -axis[0]}, {-axis[1], axis[0], 0}};
  Placement placed{{}, scale};
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      placed.map.m[row * 4 + column] = scale * (axis[row] * axis[column] * (1 - c) +
                                                (row == column ? c : 0) + s * cross[row][column]);
    }
    placed.map.m[row * 4 + 3] = middle + off * (1 + 0.37 * row);
  }
  return placed;
}

inline ModelGeometry FieldGeometry(Graph& graph, const FieldShape& shape,
                                   const GeometryRecord& look = {}) {
  ModelGeometry g{.record = look, .positions = shape.ring_points, .indices = {}, .colors = {}};
  implicit::ProgramSource source{.surface = shape.surface, .bound = shape.bound};
  source.ring_ends = shape.ring_ends;
  source.ring_axis = shape.ring_axis;
  g.indices = *implicit::Compile(graph, source);
  g.record.kind = PrimitiveKind::kImplicit;
  g.record.index_count = static_cast<uint32_t>(g.indices.size());
  g.record.vertex_count = static_cast<uint32_t>(g.positions.size() / 3);
  return g;
}
template <typename Shape>
ModelGeometry FieldGeometry(const Shape& shape, const GeometryRecord& look = {}) {
  Graph graph;
  const FieldShape made = shape.Make(graph);
  return FieldGeometry(graph, made, look);
}

// Returns a geometry of `size`³ samples; with a level, or with a table of grey levels from low to
// high.
inline ModelGeometry GridGeometry(uint32_t size, SampleFilter filter,
                                  const std::function<double(double, double, double)>& number,
                                  bool by_level, double level, const GeometryRecord& look = {}) {
  SampleHead head = {};
  for (uint32_t& n : head.size) n = size;
  head.format = SampleFormat::kF32;
  head.filter = filter;
  head.by_level = by_level ? 1 : 0;
  head.level = static_cast<float>(level);
  head.scale = 1;
  head.bricks = BrickWords(head.size);
  ModelGeometry g{.record = look, .positions = {}, .indices = {}, .colors = {}};
  g.indices.resize(SampleWords(head.size, static_cast<uint32_t>(head.format)));
  std::memcpy(g.indices.data(), &head, sizeof(head));
  for (uint32_t i = 0; i < SampleHead::kTableEntries; ++i) {
    g.indices[kSampleHeadWords + i] = i == 0 ? 0 : i * 0x010101u | SampleHead::kDrawn;
  }
  size_t at = kSampleHeadWords + SampleHead::kTableEntries + head.bricks;
  for (uint32_t z = 0; z < size; ++z) {
    for (uint32_t y = 0; y < size; ++y) {
      for (uint32_t x = 0; x < size; ++x) {
        const auto value = static_cast<float>(number(x + 0.5, y + 0.5, z + 0.5));
        std::memcpy(&g.indices[at++], &value, sizeof(value));
      }
    }
  }
  g.record.kind = PrimitiveKind::kSamples;
  g.record.index_count = static_cast<uint32_t>(g.indices.size());
  FillBricks(g.record, g.indices);
  return g;
}

// The voxels of a cube.
struct Drawn {
  int32_t size = 0;
  std::vector<uint32_t> rgb;

  size_t Index(int32_t x, int32_t y, int32_t z) const {
    return (static_cast<size_t>(z) * static_cast<size_t>(size) + static_cast<size_t>(y)) *
               static_cast<size_t>(size) +
           static_cast<size_t>(x);
  }
  bool Holds(int32_t x, int32_t y, int32_t z) const {
    return std::min({x, y, z}) >= 0 && std::max({x, y, z}) < size;
  }
  uint32_t At(int32_t x, int32_t y, int32_t z) const { return rgb[Index(x, y, z)]; }
  bool Lit(int32_t x, int32_t y, int32_t z) const { return At(x, y, z) != 0; }

  // Calls each(x, y, z) for those at least `rim` voxels inside.
  template <typename Each>
  void ForEach(Each&& each, int32_t rim = 0) const {
    for (int32_t z = rim; z < size - rim; ++z) {
      for (int32_t y = rim; y < size - rim; ++y) {
        for (int32_t x = rim; x < size - rim; ++x) each(x, y, z);
      }
    }
  }
  // Calls each(x, y, z) for the neighbours in the cube: those that share a face, or all.
  template <typename Each>
  void ForEachNeighbour(int32_t x, int32_t y, int32_t z, bool any, Each&& each) const {
    for (int n = 0; n < 27; ++n) {
      const int32_t d[3] = {n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1};
      const int32_t steps = std::abs(d[0]) + std::abs(d[1]) + std::abs(d[2]);
      if (steps == 0 || (!any && steps > 1)) continue;
      if (Holds(x + d[0], y + d[1], z + d[2])) each(x + d[0], y + d[1], z + d[2]);
    }
  }
  // Returns the voxels that can be reached from one of them by steps among lit, or among dark,
  // voxels.
  std::vector<uint8_t> Reached(std::array<int32_t, 3> from, bool lit, bool any) const {
    std::vector<uint8_t> reached(rgb.size());
    std::vector<std::array<int32_t, 3>> open = {from};
    reached[Index(from[0], from[1], from[2])] = 1;
    while (!open.empty()) {
      const std::array<int32_t, 3> at = open.back();
      open.pop_back();
      ForEachNeighbour(at[0], at[1], at[2], any, [&](int32_t x, int32_t y, int32_t z) {
        uint8_t& here = reached[Index(x, y, z)];
        if (here != 0 || Lit(x, y, z) != lit) return;
        here = 1;
        open.push_back({x, y, z});
      });
    }
    return reached;
  }
};

// Draws one geometry at a time into a cube.
class PlacedShapes : public EngineConformance {
 protected:
  explicit PlacedShapes(int32_t size)
      : size_(size), engine_(Make({.threads = 1, .inline_execution = true})) {
    EXPECT_TRUE(engine_.SetTarget(CubeTarget(size)).ok());
  }
  Drawn Draw(ModelGeometry g, const Affine& map) {
    g.record.id = 1;
    DeltaBuffer delta;
    delta.Reset();
    delta.PutWhole(SceneOf(g, map));
    EXPECT_EQ(engine_.Apply(delta), absl::OkStatus());
    EXPECT_EQ(engine_.Frame().status(), absl::OkStatus());
    return {size_, engine_.Voxels()};
  }

  const int32_t size_;

 private:
  EngineDriver engine_;
};

}  // namespace voxeld::gpu::conformance
