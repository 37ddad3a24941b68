// Computes the inside of triangles, voxel by voxel, in integers of any size: the row's line is
// moved by 2⁻⁶⁰ unit along y and by 2⁻¹²⁰ unit along z, so that it meets no edge.
#include <boost/multiprecision/cpp_int.hpp>

#include "tests/conformance/oracle_shapes.h"

namespace voxeld::gpu::conformance {
namespace {

using Number = boost::multiprecision::cpp_int;

// Coordinates in 2⁻¹²⁰ unit.
struct Point {
  Number y, z;
};

Point PointOf(const Units& at) { return {Number(at.v[1]) << 120, Number(at.v[2]) << 120}; }

// Returns on which side of the line from a to b a point lies.
int SideOf(const Point& a, const Point& b, const Point& p) {
  const Number side = (b.y - a.y) * (p.z - a.z) - (b.z - a.z) * (p.y - a.y);
  return side.sign();
}

// Returns whether the line along x through a voxel's centre, moved a little, meets the triangle.
bool Meets(const OracleTriangle& t, int64_t y, int64_t z) {
  const Point p{((Number(y) * 256 + 128) << 120) + (Number(1) << 60),
                ((Number(z) * 256 + 128) << 120) + 1};
  int sides[3];
  for (int i = 0; i < 3; ++i) sides[i] = SideOf(PointOf(t.v[i]), PointOf(t.v[(i + 1) % 3]), p);
  return sides[0] != 0 && sides[0] == sides[1] && sides[1] == sides[2];
}

// Returns whether the triangle's plane is at a voxel's centre, or before it along x.
bool IsBefore(const OracleTriangle& t, int64_t x, int64_t y, int64_t z) {
  Number e[2][3], d[3];
  const int64_t centre[3] = {x * 256 + 128, y * 256 + 128, z * 256 + 128};
  for (int a = 0; a < 3; ++a) {
    for (int i = 0; i < 2; ++i) e[i][a] = Number(t.v[i + 1].v[a]) - t.v[0].v[a];
    d[a] = Number(centre[a]) - t.v[0].v[a];
  }
  const Number along_x = e[0][1] * e[1][2] - e[0][2] * e[1][1];
  const Number distance = along_x * d[0] + (e[0][2] * e[1][0] - e[0][0] * e[1][2]) * d[1] +
                          (e[0][0] * e[1][1] - e[0][1] * e[1][0]) * d[2];
  return distance.sign() * along_x.sign() >= 0;
}

}  // namespace

void PlotFilled(std::span<const OracleTriangle> triangles, const DenseVolume& grid,
                const Plot& plot) {
  if (triangles.empty()) return;
  for (int64_t z = 0; z < grid.nz; ++z) {
    for (int64_t y = 0; y < grid.ny; ++y) {
      std::vector<const OracleTriangle*> met;
      for (const OracleTriangle& t : triangles) {
        if (Meets(t, y, z)) met.push_back(&t);
      }
      for (int64_t x = 0; x < grid.nx && met.size() % 2 == 0; ++x) {
        int before = 0;
        for (const OracleTriangle* t : met) before += IsBefore(*t, x, y, z) ? 1 : 0;
        if (before % 2 != 0) plot(x, y, z, triangles[0].color[0]);
      }
    }
  }
}

}  // namespace voxeld::gpu::conformance
