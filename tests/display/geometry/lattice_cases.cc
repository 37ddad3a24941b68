#include <cmath>
#include <numbers>
#include <optional>
#include <random>
#include <utility>

#include "display/geometry/footprint.h"
#include "tests/display/geometry/geometry_cases.h"

namespace voxeld::display {
namespace {

using Points = std::vector<std::optional<Vec3>>;

// Random numbers that are the same with every library.
class Random {
 public:
  double In(double low, double high) { return low + (high - low) * engine_() / 0x1p32; }
  Vec3 Point(double reach) {
    const double x = In(-reach, reach), y = In(-reach, reach), z = In(-reach, reach);
    return {x, y, z};
  }

 private:
  std::mt19937 engine_{11};
};

Lattice Lights(int32_t width, Points points, Vec3 cell_mm) {
  points.resize((points.size() + static_cast<size_t>(width) - 1) / static_cast<size_t>(width) *
                static_cast<size_t>(width));
  return {.width_px = width, .points_mm = std::move(points), .cell_mm = cell_mm};
}

GeometryCase With(std::string name, Lattice lattice, std::optional<VoxelGrid> grid = {}) {
  GeometryCase c{"Lattice" + std::move(name), {std::move(lattice), {}}};
  c.geometry.grid = grid.has_value() ? *grid : DefaultGrid(c.geometry);
  return c;
}

// Removes about one light in `of`.
Lattice Thinned(Lattice lattice, int of, Random& random) {
  for (std::optional<Vec3>& point : lattice.points_mm) {
    if (random.In(0, of) < 1) point.reset();
  }
  return lattice;
}

Points Scattered(int count, double reach, Random& random) {
  Points points;
  for (int n = 0; n < count; ++n) points.push_back(random.Point(reach));
  return points;
}

Points OnSphere(int count, double radius) {
  Points points;
  for (int n = 0; n < count; ++n) {
    const double z = 1 - (2 * n + 1.0) / count, around = n * std::numbers::pi * (3 - std::sqrt(5));
    const double across = std::sqrt(1 - z * z) * radius;
    points.push_back(Vec3{across * std::cos(around), across * std::sin(around), z * radius});
  }
  return points;
}

}  // namespace

Lattice RegularLattice(int nx, int ny, int nz, Vec3 pitch_mm) {
  Lattice lattice;
  lattice.width_px = nx * ny;
  lattice.cell_mm = pitch_mm;
  for (int z = 0; z < nz; ++z) {
    for (int y = 0; y < ny; ++y) {
      for (int x = 0; x < nx; ++x) {
        lattice.points_mm.push_back(Vec3{(x + 0.5 - 0.5 * nx) * pitch_mm.x,
                                         (y + 0.5 - 0.5 * ny) * pitch_mm.y,
                                         (z + 0.5 - 0.5 * nz) * pitch_mm.z});
      }
    }
  }
  return lattice;
}

std::vector<GeometryCase> LatticeCases() {
  Random random;
  std::vector<GeometryCase> cases;
  const Lattice regular = RegularLattice(9, 8, 7, {1, 1, 1});
  cases.push_back(With("Regular", regular));
  cases.push_back(With("RegularOblong", RegularLattice(6, 5, 8, {0.3, 0.7, 1.1})));
  cases.push_back(With("RegularThinned", Thinned(regular, 3, random)));
  cases.push_back(With("CoarserGrid", regular, CentredGrid(4, 4, 3, {2.3, 2.1, 2.6})));
  cases.push_back(With("FinerGrid", regular, CentredGrid(30, 27, 24, {0.31, 0.29, 0.33})));
  cases.push_back(With("OneLight", Lights(1, {Vec3{3, 4, 5}}, {2, 2, 2}),
                       VoxelGrid{9, 9, 9, {0.6, 0.7, 0.8}, {0, 1, 2}}));

  const Points cloud = Scattered(400, 6, random);
  cases.push_back(With("Scattered", Lights(17, cloud, {1, 1, 1})));
  cases.push_back(With("ScatteredThinned", Thinned(Lights(50, cloud, {1.3, 0.9, 1.1}), 4, random)));
  cases.push_back(With("ScatteredFinerGrid", Lights(400, cloud, {1.5, 1.2, 1.9}),
                       CentredGrid(26, 25, 24, {0.47, 0.51, 0.55})));
  cases.push_back(With("ScatteredSmallCells", Lights(3, cloud, {0.4, 0.3, 0.5}),
                       CentredGrid(12, 12, 12, {1, 1, 1})));
  cases.push_back(With("ScatteredFlatCells", Lights(40, cloud, {0.11, 3, 3}),
                       CentredGrid(12, 20, 20, {1, 0.6, 0.6})));
  // Lights beside the grid on every side, some of whose boxes reach into it.
  cases.push_back(With("GridWithinScattered", Lights(20, cloud, {1.7, 1.7, 1.7}),
                       VoxelGrid{8, 7, 6, {0.9, 0.8, 0.7}, {-3.1, -2.2, -2.4}}));

  Points twice = Scattered(60, 4, random);
  for (size_t n = 0; n < 60; ++n) twice.push_back(twice[n % 20]);  // within and across slices
  cases.push_back(With("Duplicates", Lights(8, twice, {1.1, 1.2, 1.3})));
  cases.push_back(With("Sphere", Lights(32, OnSphere(700, 8), {1.2, 1.2, 1.2})));
  return cases;
}

}  // namespace voxeld::display
