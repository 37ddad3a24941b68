#include <algorithm>
#include <cmath>

#include "tests/conformance/oracle_shapes.h"

namespace voxeld::gpu::conformance {
namespace {

// A second implementation of gpu/primitives/solid.h's definition.
struct OracleSolid {
  PrimitiveKind kind;
  OracleFrame frame;
  int64_t low[3], high[3];

  bool Inside(int64_t x, int64_t y, int64_t z) const {
    const int64_t at[3] = {x, y, z};
    for (int a = 0; a < 3; ++a) {
      if (at[a] < low[a] || at[a] > high[a]) return false;
    }
    float q[3];
    frame.Coordinates(x, y, z, q);
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

// Returns false if no inverse exists.
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
  s.kind = g.kind;
  if (!SetOracleFrame(OracleCompose(map, local), /*keep_thin=*/true, s.frame)) return false;
  for (int a = 0; a < 3; ++a) {
    const double reach = std::min(std::floor(s.frame.reach[a] * 1.0001) + 2, 0x1p30);
    s.low[a] = s.frame.origin[a] - static_cast<int64_t>(reach);
    s.high[a] = s.frame.origin[a] + static_cast<int64_t>(reach);
  }
  return true;
}

}  // namespace

void OracleFrame::Coordinates(int64_t x, int64_t y, int64_t z, float q[3]) const {
  const int64_t at[3] = {x, y, z};
  float d[3];
  for (int a = 0; a < 3; ++a) {
    d[a] = static_cast<float>(256 * (at[a] - origin[a]) + 128 - rest[a]) / 256.0f;
  }
  for (int r = 0; r < 3; ++r) {
    q[r] = inverse[r][0] * d[0] + inverse[r][1] * d[1];
    q[r] = q[r] + inverse[r][2] * d[2] + 0.0f;
  }
}

bool SetOracleFrame(const Affine& map, bool keep_thin, OracleFrame& frame) {
  const auto at = [&](int row, int column) { return map.m[row * 4 + column]; };
  const auto minor = [&](int r0, int c0, int r1, int c1) {
    return at(r0, c0) * at(r1, c1) - at(r0, c1) * at(r1, c0);
  };
  const double adjugate[3][3] = {{minor(1, 1, 2, 2), minor(0, 2, 2, 1), minor(0, 1, 1, 2)},
                                 {minor(1, 2, 2, 0), minor(0, 0, 2, 2), minor(0, 2, 1, 0)},
                                 {minor(1, 0, 2, 1), minor(0, 1, 2, 0), minor(0, 0, 1, 1)}};
  const double det =
      at(0, 0) * adjugate[0][0] + at(0, 1) * adjugate[1][0] + at(0, 2) * adjugate[2][0];
  for (double& reach : frame.reach) reach = 0;
  for (int r = 0; r < 3; ++r) {
    double row[3];
    for (int c = 0; c < 3; ++c) {
      row[c] = adjugate[r][c] / det;
      if (!std::isfinite(row[c])) return false;
    }
    const double greatest = std::max({std::fabs(row[0]), std::fabs(row[1]), std::fabs(row[2])});
    const double most = 2047.0 / 1024.0;
    const double scale = keep_thin && greatest > most ? most / greatest : 1;
    for (int c = 0; c < 3; ++c) {
      frame.inverse[r][c] = static_cast<float>(row[c] * scale);
      frame.reach[c] += std::fabs(at(c, r)) / scale;
    }
  }
  for (int a = 0; a < 3; ++a) {
    const double units = std::floor(at(a, 3) * 256 + 0.5);
    const int64_t snapped = static_cast<int64_t>(std::clamp(units, -0x1p38, 0x1p38));
    frame.origin[a] = static_cast<int64_t>(std::floor(static_cast<double>(snapped) / 256));
    frame.rest[a] = snapped - 256 * frame.origin[a];
  }
  return true;
}

// The lesser and the greater product of each axis, added from the left.
void OracleDomain(const GeometryRecord& g, const Affine& map, int64_t low[3], int64_t high[3]) {
  for (int a = 0; a < 3; ++a) {
    double least = map.m[a * 4 + 3], most = least;
    for (int b = 0; b < 3; ++b) {
      const double at[2] = {map.m[a * 4 + b] * static_cast<double>(g.params[b]),
                            map.m[a * 4 + b] * static_cast<double>(g.params[3 + b])};
      least += std::min(at[0], at[1]);
      most += std::max(at[0], at[1]);
    }
    const double half = static_cast<double>(OracleRadius(g, map)) / 256;
    low[a] = static_cast<int64_t>(std::floor(std::clamp(least - half, -0x1p30, 0x1p30))) - 2;
    high[a] = static_cast<int64_t>(std::floor(std::clamp(most + half, -0x1p30, 0x1p30))) + 3;
  }
}

void PlotSolid(const GeometryRecord& g, const Affine& map, const DenseVolume& grid,
               const Plot& plot) {
  OracleSolid s;
  if (!Set(g, map, s)) return;
  const uint32_t rgb = g.color & 0xFFFFFF;
  const bool missed = !s.Inside(s.frame.origin[0], s.frame.origin[1], s.frame.origin[2]);
  if (missed && grid.Has(s.frame.origin[0], s.frame.origin[1], s.frame.origin[2])) {
    plot(s.frame.origin[0], s.frame.origin[1], s.frame.origin[2], rgb);
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
