#include <algorithm>
#include <cmath>

#include "tests/conformance/oracle_shapes.h"

namespace voxeld::gpu::conformance {
namespace {

// gpu/primitives/solid.h's definition, a second time.
struct OracleSolid {
  PrimitiveKind kind;
  float inverse[3][3];
  int64_t origin[3], rest[3], low[3], high[3];

  bool Inside(int64_t x, int64_t y, int64_t z) const {
    const int64_t at[3] = {x, y, z};
    float d[3], q[3];
    for (int a = 0; a < 3; ++a) {
      if (at[a] < low[a] || at[a] > high[a]) return false;
      d[a] = static_cast<float>(256 * (at[a] - origin[a]) + 128 - rest[a]) / 256.0f;
    }
    for (int r = 0; r < 3; ++r) {
      q[r] = inverse[r][0] * d[0] + inverse[r][1] * d[1];
      q[r] = q[r] + inverse[r][2] * d[2];
    }
    switch (kind) {
      case PrimitiveKind::kBox:
        return std::max({std::fabs(q[0]), std::fabs(q[1]), std::fabs(q[2])}) <= 1;
      case PrimitiveKind::kSphere: {
        const float plane = q[0] * q[0] + q[1] * q[1];
        return plane + q[2] * q[2] <= 1;
      }
      default:
        return q[0] * q[0] + q[1] * q[1] <= 1 && std::fabs(q[2]) <= 1;
    }
  }
};

// False if there is no inverse.
bool Set(const GeometryRecord& g, const Affine& map, OracleSolid& s) {
  const double p3 = g.params[3], p4 = g.params[4], p5 = g.params[5];
  Affine local;
  local.m[3] = g.params[0];
  local.m[7] = g.params[1];
  local.m[11] = g.params[2];
  const bool box = g.kind == PrimitiveKind::kBox, sphere = g.kind == PrimitiveKind::kSphere;
  local.m[0] = box ? p3 / 2 : p3;
  local.m[5] = box ? p4 / 2 : p3;
  local.m[10] = box ? p5 / 2 : sphere ? p3 : p4 / 2;
  const Affine m = OracleCompose(map, local);
  const auto at = [&](int row, int column) { return m.m[row * 4 + column]; };
  double reach[3] = {0, 0, 0};
  const auto minor = [&](int r0, int c0, int r1, int c1) {
    return at(r0, c0) * at(r1, c1) - at(r0, c1) * at(r1, c0);
  };
  const double adjugate[3][3] = {{minor(1, 1, 2, 2), minor(0, 2, 2, 1), minor(0, 1, 1, 2)},
                                 {minor(1, 2, 2, 0), minor(0, 0, 2, 2), minor(0, 2, 1, 0)},
                                 {minor(1, 0, 2, 1), minor(0, 1, 2, 0), minor(0, 0, 1, 1)}};
  const double det =
      at(0, 0) * adjugate[0][0] + at(0, 1) * adjugate[1][0] + at(0, 2) * adjugate[2][0];
  s.kind = g.kind;
  for (int r = 0; r < 3; ++r) {
    double row[3];
    for (int c = 0; c < 3; ++c) {
      row[c] = adjugate[r][c] / det;
      if (!std::isfinite(row[c])) return false;
    }
    const double greatest = std::max({std::fabs(row[0]), std::fabs(row[1]), std::fabs(row[2])});
    const double most = 2047.0 / 1024.0;
    const double scale = greatest > most ? most / greatest : 1;
    for (int c = 0; c < 3; ++c) {
      s.inverse[r][c] = static_cast<float>(row[c] * scale);
      reach[c] += std::fabs(at(c, r)) / scale;
    }
  }
  for (int a = 0; a < 3; ++a) {
    const double units = std::floor(at(a, 3) * 256 + 0.5);
    const int64_t snapped = static_cast<int64_t>(std::clamp(units, -0x1p38, 0x1p38));
    s.origin[a] = static_cast<int64_t>(std::floor(static_cast<double>(snapped) / 256));
    s.rest[a] = snapped - 256 * s.origin[a];
    const int64_t size = static_cast<int64_t>(std::min(std::floor(reach[a] * 1.0001) + 2, 0x1p30));
    s.low[a] = s.origin[a] - size;
    s.high[a] = s.origin[a] + size;
  }
  return true;
}

}  // namespace

void PlotSolid(const GeometryRecord& g, const Affine& map, const DenseVolume& grid,
               const Plot& plot) {
  OracleSolid s;
  if (!Set(g, map, s)) return;
  const uint32_t rgb = g.color & 0xFFFFFF;
  const bool missed = !s.Inside(s.origin[0], s.origin[1], s.origin[2]);
  if (missed && grid.Has(s.origin[0], s.origin[1], s.origin[2])) {
    plot(s.origin[0], s.origin[1], s.origin[2], rgb);
  }
  for (int64_t z = 0; z < grid.nz; ++z) {
    for (int64_t y = 0; y < grid.ny; ++y) {
      for (int64_t x = 0; x < grid.nx; ++x) {
        if (!s.Inside(x, y, z)) continue;
        bool shown = g.fill == Fill::kSolid;
        for (int n = 0; n < 27 && !shown; ++n) {
          const int dx = n % 3 - 1, dy = n / 3 % 3 - 1, dz = n / 9 - 1;
          const bool face = std::abs(dx) + std::abs(dy) + std::abs(dz) == 1;
          if (g.rule == SurfaceRule::kThin && !face) continue;
          shown = !s.Inside(x + dx, y + dy, z + dz);
        }
        if (shown) plot(x, y, z, rgb);
      }
    }
  }
}

}  // namespace voxeld::gpu::conformance
