#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "tests/conformance/oracle_shapes.h"

namespace voxeld::gpu::conformance {
namespace {

using Int128 = __int128;

struct Vec {
  Int128 x, y, z;
  Int128 operator[](int a) const { return a == 0 ? x : a == 1 ? y : z; }
};
Vec operator-(const Vec& a, const Vec& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Vec Cross(const Vec& a, const Vec& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
Int128 Dot(const Vec& a, const Vec& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
int Sign(Int128 v) { return v > 0 ? 1 : v < 0 ? -1 : 0; }
Int128 Magnitude(Int128 v) { return v < 0 ? -v : v; }

Vec Axis(int a) { return {a == 0, a == 1, a == 2}; }

struct Tri {
  Vec p[3];
  Vec n;
};

// Returns whether the line through `q` along `a`, not parallel to the triangle, passes through it,
// rim included: the signed volumes that it spans with the edges do not have two different signs.
bool LineMeets(const Tri& t, const Vec& q, int a) {
  bool positive = false, negative = false;
  for (int i = 0; i < 3; ++i) {
    const Int128 volume = Dot(Axis(a), Cross(t.p[i] - q, t.p[(i + 1) % 3] - q));
    positive |= volume > 0;
    negative |= volume < 0;
  }
  return !(positive && negative);
}

int Side(const Tri& t, const Vec& q) { return Sign(Dot(t.n, q - t.p[0])); }

// THIN: returns whether the triangle meets the segment from `low` one voxel along `a`, without its
// far end.
bool MeetsHalfOpen(const Tri& t, const Vec& low, int a) {
  if (t.n[a] == 0 || !LineMeets(t, low, a)) return false;
  Vec high = low;
  (a == 0 ? high.x : a == 1 ? high.y : high.z) += 256;
  const int from = Side(t, low), to = Side(t, high);
  return from == 0 || (to != 0 && from != to);
}

bool MeetsClosed(const Tri& t, const Vec& low, int a) {
  if (t.n[a] == 0 || !LineMeets(t, low, a)) return false;
  Vec high = low;
  (a == 0 ? high.x : a == 1 ? high.y : high.z) += 256;
  return Side(t, low) * Side(t, high) <= 0;
}

// Tests a closed segment against a closed box: the parts of the way inside each slab have a common
// point.
bool SegmentMeetsBox(const Vec& s, const Vec& e, const Vec& corner) {
  Int128 in_num = 0, in_den = 1, out_num = 1, out_den = 1;
  for (int a = 0; a < 3; ++a) {
    const Int128 d = e[a] - s[a];
    Int128 near = corner[a] - s[a], far = corner[a] + 256 - s[a];
    if (d == 0) {
      if (near > 0 || far < 0) return false;
      continue;
    }
    if (d < 0) {
      std::swap(near, far);
      near = -near;
      far = -far;
    }
    const Int128 den = Magnitude(d);
    if (near * in_den > in_num * den) in_num = near, in_den = den;
    if (far * out_den < out_num * den) out_num = far, out_den = den;
  }
  return in_num * out_den <= out_num * in_den;
}

// Two closed convex sets meet if and only if an edge of the triangle meets the box, or an edge of
// the box the triangle.
bool MeetsBox(const Tri& t, const Vec& corner) {
  for (int i = 0; i < 3; ++i) {
    if (SegmentMeetsBox(t.p[i], t.p[(i + 1) % 3], corner)) return true;
  }
  for (int a = 0; a < 3; ++a) {
    for (int side = 0; side < 4; ++side) {
      Vec low = corner;
      const Int128 first = side & 1 ? 256 : 0, second = side & 2 ? 256 : 0;
      if (a == 0) low.y += first, low.z += second;
      if (a == 1) low.x += first, low.z += second;
      if (a == 2) low.x += first, low.y += second;
      if (MeetsClosed(t, low, a)) return true;
    }
  }
  return false;
}

// Returns the factor for colours at a place: a texel of the level that suits the triangle.
uint32_t TexelOf(const OracleTriangle& t, double u, double v) {
  uint64_t begin = 0, width = t.texture.width, height = t.texture.height;
  const auto at = [&](int corner, int k) {
    return static_cast<long double>(t.texture.at[corner][k]) -
           static_cast<long double>(t.texture.at[0][k]);
  };
  const long double share = std::fabs(at(1, 0) * at(2, 1) - at(1, 1) * at(2, 0));
  long double faces = 0;  // twice the number of voxels in its largest shadow
  for (int a = 0; a < 3; ++a) {
    const auto edge = [&](int corner, int axis) {
      return static_cast<long double>(t.v[corner].v[axis % 3] - t.v[0].v[axis % 3]) / 256;
    };
    const long double shadow = edge(1, a + 1) * edge(2, a + 2) - edge(1, a + 2) * edge(2, a + 1);
    faces = std::max(faces, std::fabs(shadow));
  }
  while ((width > 1 || height > 1) &&
         share * static_cast<long double>(width * height) > 2 * faces) {
    begin += width * height;
    width = std::max<uint64_t>(width / 2, 1);
    height = std::max<uint64_t>(height / 2, 1);
  }
  // Returns the position along a side of the picture, in (0, 1], or 0 for 0 itself.
  const auto along = [](double place, uint64_t count) -> uint64_t {
    if (std::isnan(place) || std::fabs(place) >= 1e12) return 0;
    double part = place - std::floor(place);
    if (part == 0 && place > 0) part = 1;
    return std::min(static_cast<uint64_t>(part * static_cast<double>(count)), count - 1);
  };
  return t.texture.texels[begin + along(v, height) * width + along(u, width)];
}

uint32_t ColorOfCorner(const OracleTriangle& t, int i) {
  if (t.texture.texels == nullptr) return t.color[i];
  return OracleTint(t.color[i], TexelOf(t, static_cast<double>(t.texture.at[i][0]),
                                        static_cast<double>(t.texture.at[i][1])));
}

// Returns the rounded value: each half is rounded by itself.
double Rounded(Int128 value) {
  return static_cast<double>(static_cast<uint64_t>(value >> 64)) * 0x1p64 +
         static_cast<double>(static_cast<uint64_t>(value));
}

uint32_t ColorOf(const OracleTriangle& t, const Tri& tri, const Vec& centre) {
  const bool textured = t.texture.texels != nullptr;
  if (!textured && t.color[0] == t.color[1] && t.color[1] == t.color[2]) return t.color[0];
  int major = 0;
  for (int a = 1; a < 3; ++a) {
    if (Magnitude(tri.n[a]) > Magnitude(tri.n[major])) major = a;
  }
  Int128 weight[3], sum = 0;
  for (int i = 0; i < 3; ++i) {
    const Vec& b = tri.p[(i + 1) % 3];
    const Vec& c = tri.p[(i + 2) % 3];
    const Int128 area = Dot(Axis(major), Cross(c - b, centre - b)) * Sign(tri.n[major]);
    weight[i] = area > 0 ? area : 0;
    sum += weight[i];
  }
  uint32_t rgb = 0;
  for (int shift = 0; shift < 24; shift += 8) {
    Int128 total = sum / 2;
    for (int i = 0; i < 3; ++i) total += weight[i] * (t.color[i] >> shift & 255);
    rgb |= static_cast<uint32_t>(total / sum) << shift;
  }
  if (!textured) return rgb;
  double place[2];
  for (int k = 0; k < 2; ++k) {
    double total = 0;
    for (int i = 0; i < 3; ++i) {
      total += Rounded(weight[i]) * static_cast<double>(t.texture.at[i][k]);
    }
    place[k] = total / Rounded(sum);
  }
  return OracleTint(rgb, TexelOf(t, place[0], place[1]));
}

OracleLine LongestEdgeOf(const OracleTriangle& t) {
  const LineSampling sampling =
      t.rule == SurfaceRule::kThin ? LineSampling::kThin : LineSampling::kCover;
  Int128 longest = -1;
  OracleLine line{};
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3;
    Int128 square = 0;
    for (int a = 0; a < 3; ++a) {
      const Int128 d = t.v[j].v[a] - t.v[i].v[a];
      square += d * d;
    }
    if (square <= longest) continue;
    longest = square;
    line = {t.v[i], t.v[j], ColorOfCorner(t, i), ColorOfCorner(t, j), sampling};
  }
  return line;
}

}  // namespace

void PlotTriangle(const OracleTriangle& t, const DenseVolume& grid, const Plot& plot) {
  Tri tri;
  // Relative to vertex 0, so that products fit.
  const Vec origin = {t.v[0].v[0], t.v[0].v[1], t.v[0].v[2]};
  for (int i = 0; i < 3; ++i) tri.p[i] = Vec{t.v[i].v[0], t.v[i].v[1], t.v[i].v[2]} - origin;
  tri.n = Cross(tri.p[1] - tri.p[0], tri.p[2] - tri.p[0]);
  const bool flat = tri.n.x == 0 && tri.n.y == 0 && tri.n.z == 0;
  if (flat) PlotLine(LongestEdgeOf(t), grid, plot);
  if (flat || t.rule == SurfaceRule::kThin) {
    for (int i = 0; i < 3; ++i) {
      const uint32_t color = ColorOfCorner(t, i);
      PlotLine({t.v[i], t.v[i], color, color, LineSampling::kThin}, grid, plot);
    }
  }
  if (flat) return;
  // Voxels that the triangle meets are at most as far away as its corners.
  const int64_t size[3] = {grid.nx, grid.ny, grid.nz};
  int64_t begin[3], end[3];
  for (int a = 0; a < 3; ++a) {
    const auto [low, high] = std::minmax({t.v[0].v[a], t.v[1].v[a], t.v[2].v[a]});
    begin[a] = std::clamp<int64_t>(low / 256 - 2, 0, size[a]);
    end[a] = std::clamp<int64_t>(high / 256 + 2, 0, size[a]);
  }
  for (int64_t z = begin[2]; z < end[2]; ++z) {
    for (int64_t y = begin[1]; y < end[1]; ++y) {
      for (int64_t x = begin[0]; x < end[0]; ++x) {
        const Vec corner = Vec{x * 256, y * 256, z * 256} - origin;
        const Vec centre = {corner.x + 128, corner.y + 128, corner.z + 128};
        const bool covered = t.rule == SurfaceRule::kCover
                                 ? MeetsBox(tri, corner)
                                 : MeetsHalfOpen(tri, {corner.x, centre.y, centre.z}, 0) ||
                                       MeetsHalfOpen(tri, {centre.x, corner.y, centre.z}, 1) ||
                                       MeetsHalfOpen(tri, {centre.x, centre.y, corner.z}, 2);
        if (covered) plot(x, y, z, ColorOf(t, tri, centre));
      }
    }
  }
}

namespace {

using Real3 = std::array<double, 3>;

double Product(const Real3& a, const Real3& b) { return (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2]; }
Real3 Across(const Real3& a, const Real3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// A second implementation of thick_triangle.h; thick_triangles_test.cc checks its meaning in
// another way.
struct ThickOracle {
  OracleTriangle given;
  OracleTriangle t;  // with the corners in order
  Real3 edge[3], side[3], normal;
  double normal2, radius;

  ThickOracle(const OracleTriangle& triangle, int64_t units) : given(triangle), t(triangle) {
    std::array<size_t, 3> order = {0, 1, 2};
    std::stable_sort(order.begin(), order.end(), [&](size_t i, size_t j) {
      return std::lexicographical_compare(given.v[i].v, given.v[i].v + 3, given.v[j].v,
                                          given.v[j].v + 3);
    });
    for (size_t i = 0; i < 3; ++i) {
      t.v[i] = given.v[order[i]];
      t.color[i] = given.color[order[i]];
      std::copy_n(given.texture.at[order[i]], 2, t.texture.at[i]);
    }
    radius = static_cast<double>(units);
    Vec p[3];
    for (int i = 0; i < 3; ++i) p[i] = {t.v[i].v[0], t.v[i].v[1], t.v[i].v[2]};
    const Vec n = Cross(p[1] - p[0], p[2] - p[0]);
    for (int a = 0; a < 3; ++a)
      normal[static_cast<size_t>(a)] = Sign(n[a]) * Rounded(Magnitude(n[a]));
    normal2 = Product(normal, normal);
    for (size_t i = 0; i < 3; ++i) {
      const Units &from = t.v[i], &to = t.v[(i + 1) % 3];
      for (size_t a = 0; a < 3; ++a) edge[i][a] = static_cast<double>(to.v[a] - from.v[a]);
      side[i] = Across(normal, edge[i]);
    }
  }

  // Returns the colour of a voxel, or nullopt.
  std::optional<uint32_t> At(int64_t x, int64_t y, int64_t z) const {
    const int64_t centre[3] = {x * 256 + 128, y * 256 + 128, z * 256 + 128};
    Real3 w[3];
    bool beyond[3];
    for (size_t i = 0; i < 3; ++i) {
      for (size_t a = 0; a < 3; ++a) w[i][a] = static_cast<double>(centre[a] - t.v[i].v[a]);
      beyond[i] = Product(side[i], w[i]) < 0;
    }
    if (normal2 > 0 && !beyond[0] && !beyond[1] && !beyond[2]) {
      const double height = Product(normal, w[0]);
      if (height * height > radius * radius * normal2) return {};
      return ColorBy({Product(side[1], w[1]), Product(side[2], w[2]), Product(side[0], w[0])});
    }
    bool near = false;
    double least = std::numeric_limits<double>::infinity();
    Real3 weights = {};
    for (size_t i = 0; i < 3; ++i) {
      if (normal2 > 0 && !beyond[i]) continue;
      const size_t j = (i + 1) % 3;
      const double along = Product(w[i], edge[i]), length2 = Product(edge[i], edge[i]);
      Real3 here = {};
      double square;
      if (along <= 0) {
        square = Product(w[i], w[i]);
        here[i] = 1;
        near = near || square <= radius * radius;
      } else if (along >= length2) {
        square = Product(w[j], w[j]);
        here[j] = 1;
        near = near || square <= radius * radius;
      } else {
        const Real3 c = Across(w[i], edge[i]);
        near = near || Product(c, c) <= radius * radius * length2;
        square = Product(c, c) / length2;
        here[i] = length2 - along;
        here[j] = along;
      }
      if (square < least) least = square, weights = here;
    }
    if (!near) return {};
    return ColorBy(weights);
  }

  uint32_t ColorBy(const Real3& weights) const {
    const bool textured = t.texture.texels != nullptr;
    if (!textured && t.color[0] == t.color[1] && t.color[1] == t.color[2]) return t.color[0];
    // All weights that are not zero are added in the order of the corners.
    const double sum = (weights[0] + weights[1]) + weights[2];
    uint32_t rgb = 0;
    for (int shift = 0; shift < 24; shift += 8) {
      Real3 channel;
      for (size_t i = 0; i < 3; ++i) channel[i] = t.color[i] >> shift & 255;
      rgb |= static_cast<uint32_t>(std::floor(Product(weights, channel) / sum + 0.5)) << shift;
    }
    if (!textured) return rgb;
    double place[2];
    for (size_t k = 0; k < 2; ++k) {
      Real3 on_picture;
      for (size_t i = 0; i < 3; ++i) on_picture[i] = static_cast<double>(t.texture.at[i][k]);
      place[k] = Product(weights, on_picture) / sum;
    }
    return OracleTint(rgb, TexelOf(given, place[0], place[1]));
  }
};

}  // namespace

void PlotThick(const OracleTriangle& t, int64_t radius, const DenseVolume& grid, const Plot& plot) {
  const ThickOracle thick(t, radius);
  const int64_t size[3] = {grid.nx, grid.ny, grid.nz};
  int64_t begin[3], end[3];
  for (int a = 0; a < 3; ++a) {
    const auto [low, high] = std::minmax({t.v[0].v[a], t.v[1].v[a], t.v[2].v[a]});
    begin[a] = std::clamp<int64_t>((low - radius) / 256 - 3, 0, size[a]);
    end[a] = std::clamp<int64_t>((high + radius) / 256 + 3, 0, size[a]);
  }
  for (int64_t z = begin[2]; z < end[2]; ++z) {
    for (int64_t y = begin[1]; y < end[1]; ++y) {
      for (int64_t x = begin[0]; x < end[0]; ++x) {
        if (const std::optional<uint32_t> rgb = thick.At(x, y, z)) plot(x, y, z, *rgb);
      }
    }
  }
}

}  // namespace voxeld::gpu::conformance
