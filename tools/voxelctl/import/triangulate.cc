#include "tools/voxelctl/import/triangulate.h"

#include <array>
#include <cmath>
#include <cstddef>

namespace voxeld::voxelctl {
namespace {

constexpr size_t kMostEarCorners = 512;

using Flat = std::array<double, 2>;

// Returns twice the signed area.
double AreaOf(const Flat& a, const Flat& b, const Flat& c) {
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

// Projects the polygon along the axis closest to its normal; the result is counter-clockwise.
std::vector<Flat> Flatten(std::span<const Point3> corners) {
  Point3 normal;  // by Newell's method
  for (size_t i = 0; i < corners.size(); ++i) {
    const Point3 &a = corners[i], &b = corners[(i + 1) % corners.size()];
    normal.x += (a.y - b.y) * (a.z + b.z - 2 * corners[0].z);
    normal.y += (a.z - b.z) * (a.x + b.x - 2 * corners[0].x);
    normal.z += (a.x - b.x) * (a.y + b.y - 2 * corners[0].y);
  }
  const double x = std::abs(normal.x), y = std::abs(normal.y), z = std::abs(normal.z);
  std::vector<Flat> flat;
  flat.reserve(corners.size());
  for (const Point3& p : corners) {
    if (z >= x && z >= y) {
      flat.push_back({normal.z < 0 ? -p.x : p.x, p.y});
    } else if (y >= x) {
      flat.push_back({normal.y < 0 ? -p.z : p.z, p.x});
    } else {
      flat.push_back({normal.x < 0 ? -p.y : p.y, p.z});
    }
  }
  return flat;
}

bool IsConvex(const std::vector<Flat>& flat) {
  const size_t n = flat.size();
  for (size_t i = 0; i < n; ++i) {
    if (AreaOf(flat[i], flat[(i + 1) % n], flat[(i + 2) % n]) < 0) return false;
  }
  return true;
}

bool Holds(const Flat& a, const Flat& b, const Flat& c, const Flat& p) {
  return AreaOf(a, b, p) >= 0 && AreaOf(b, c, p) >= 0 && AreaOf(c, a, p) >= 0;
}

}  // namespace

void Triangulator::Append(std::span<const Point3> corners, std::vector<uint32_t>* triangles) {
  const auto add = [&](size_t a, size_t b, size_t c) {
    for (const size_t i : {a, b, c}) triangles->push_back(static_cast<uint32_t>(i));
  };
  const auto fan = [&](const std::vector<uint32_t>& left) {
    for (size_t i = 2; i < left.size(); ++i) add(left[0], left[i - 1], left[i]);
  };
  std::vector<uint32_t> left(corners.size());
  for (size_t i = 0; i < left.size(); ++i) left[i] = static_cast<uint32_t>(i);
  if (corners.size() == 3) return fan(left);
  const std::vector<Flat> flat = Flatten(corners);
  if (corners.size() > kMostEarCorners || IsConvex(flat)) return fan(left);

  // An ear is a corner whose triangle contains no other corner of the polygon.
  const auto is_ear = [&](size_t at) {
    const size_t n = left.size();
    const uint32_t before = left[(at + n - 1) % n], tip = left[at], after = left[(at + 1) % n];
    if (!(AreaOf(flat[before], flat[tip], flat[after]) > 0)) return false;
    for (const uint32_t other : left) {
      if (other == before || other == tip || other == after) continue;
      const Flat& p = flat[other];
      // A corner at the same place as one of these is on the boundary, and not inside.
      if (p == flat[before] || p == flat[tip] || p == flat[after]) continue;
      if (Holds(flat[before], flat[tip], flat[after], p)) return false;
    }
    return true;
  };
  size_t at = 0, tried = 0;
  while (left.size() > 3 && tried < left.size()) {
    if (budget_ < left.size()) break;
    budget_ -= left.size();
    if (!is_ear(at)) {
      at = (at + 1) % left.size();
      ++tried;
      continue;
    }
    const size_t n = left.size();
    add(left[(at + n - 1) % n], left[at], left[(at + 1) % n]);
    left.erase(left.begin() + static_cast<std::ptrdiff_t>(at));
    at %= left.size();
    tried = 0;
  }
  fan(left);
}

}  // namespace voxeld::voxelctl
