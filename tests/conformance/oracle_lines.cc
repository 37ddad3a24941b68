#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include "tests/conformance/oracle_shapes.h"

namespace voxeld::gpu::conformance {
namespace {

using Int128 = __int128;

// Returns a / b rounded towards −∞; b > 0.
Int128 Floor(Int128 a, Int128 b) { return a >= 0 ? a / b : -((-a + b - 1) / b); }

int64_t Cell(int64_t units) { return static_cast<int64_t>(Floor(units, 256)); }

uint32_t Mix(uint32_t c0, uint32_t c1, Int128 k, Int128 n) {
  uint32_t rgb = 0;
  for (int channel = 0; channel < 3; ++channel) {
    const Int128 a = c0 >> (8 * channel) & 255, b = c1 >> (8 * channel) & 255;
    rgb |= static_cast<uint32_t>((a * (n - k) + b * k + n / 2) / n) << (8 * channel);
  }
  return rgb;
}

void PlotAt(const Units& p, uint32_t rgb, const DenseVolume& grid, const Plot& plot) {
  const int64_t x = Cell(p.v[0]), y = Cell(p.v[1]), z = Cell(p.v[2]);
  if (grid.Has(x, y, z)) plot(x, y, z, rgb);
}

int64_t StepsOf(const OracleLine& line) {
  if (line.sampling == LineSampling::kThin) {
    int64_t n = 0;
    for (int a = 0; a < 3; ++a) n = std::max(n, std::abs(Cell(line.e.v[a]) - Cell(line.s.v[a])));
    return n;
  }
  Int128 square = 0;
  for (int a = 0; a < 3; ++a) {
    const Int128 d = line.e.v[a] - line.s.v[a];
    square += d * d;
  }
  // The greatest n with (256·n)² ≤ |E−S|².
  Int128 low = 0, high = Int128{1} << 40;
  while (high - low > 1) {
    const Int128 middle = (low + high) / 2;
    (middle * 256 * middle * 256 <= square ? low : high) = middle;
  }
  return static_cast<int64_t>(low);
}

// Returns coordinate `a` of voxel_k according to the definition.
int64_t StepCell(const OracleLine& line, int a, Int128 k, Int128 n) {
  const Int128 d = line.e.v[a] - line.s.v[a];
  return static_cast<int64_t>(Floor(line.s.v[a] * n + d * k, 256 * n));
}

// Returns the first k in [0, n] for which coordinate `a`, followed in its own direction, has
// reached `bound`; n + 1 if none has.
Int128 FirstReaching(const OracleLine& line, int a, Int128 n, int64_t bound) {
  const bool up = line.e.v[a] >= line.s.v[a];
  Int128 low = -1, high = n + 1;
  while (high - low > 1) {
    const Int128 middle = (low + high) / 2;
    const int64_t cell = StepCell(line, a, middle, n);
    ((up ? cell >= bound : cell <= bound) ? high : low) = middle;
  }
  return high;
}

void PlotSteps(const OracleLine& line, int64_t n, const DenseVolume& grid, const Plot& plot) {
  const int64_t size[3] = {grid.nx, grid.ny, grid.nz};
  Int128 first = 0, last = n;
  if (n > 100000) {  // too many steps: found by bisection over the same definition
    for (int a = 0; a < 3; ++a) {
      const bool up = line.e.v[a] >= line.s.v[a];
      first = std::max(first, FirstReaching(line, a, n, up ? 0 : size[a] - 1));
      last = std::min(last, FirstReaching(line, a, n, up ? size[a] : -1) - 1);
    }
  }
  for (Int128 k = first; k <= last; ++k) {
    const int64_t x = StepCell(line, 0, k, n), y = StepCell(line, 1, k, n),
                  z = StepCell(line, 2, k, n);
    if (grid.Has(x, y, z)) plot(x, y, z, Mix(line.color_s, line.color_e, k, n));
  }
}

// Where a coordinate crosses a face: the distance along the way as units / length, then the axis.
struct Crossing {
  Int128 units, length;
  int axis;
};
bool operator<(const Crossing& a, const Crossing& b) {
  const Int128 left = a.units * b.length, right = b.units * a.length;
  return left != right ? left < right : a.axis < b.axis;
}

// A cell is on the way if and only if the last face crossed to reach it comes before the first one
// crossed to leave it.
void PlotCells(OracleLine line, const DenseVolume& grid, const Plot& plot) {
  const auto key = [](const Units& p) { return std::tuple(p.v[0], p.v[1], p.v[2]); };
  if (key(line.e) < key(line.s)) {
    std::swap(line.s, line.e);
    std::swap(line.color_s, line.color_e);
  }
  const int64_t size[3] = {grid.nx, grid.ny, grid.nz};
  int64_t low[3], high[3], total = 0;
  for (int a = 0; a < 3; ++a) {
    const int64_t from = Cell(line.s.v[a]), to = Cell(line.e.v[a]);
    total += std::abs(to - from);
    low[a] = std::max<int64_t>(0, std::min(from, to));
    high[a] = std::min(size[a] - 1, std::max(from, to));
  }
  for (int64_t z = low[2]; z <= high[2]; ++z) {
    for (int64_t y = low[1]; y <= high[1]; ++y) {
      for (int64_t x = low[0]; x <= high[0]; ++x) {
        const int64_t cell[3] = {x, y, z};
        std::vector<Crossing> entered, left;
        Int128 k = 0;
        for (int a = 0; a < 3; ++a) {
          const int64_t s = line.s.v[a], e = line.e.v[a];
          const bool up = e > s;
          const Int128 length = up ? e - s : s - e;
          k += std::abs(cell[a] - Cell(s));
          if (cell[a] != Cell(s)) {
            const Int128 face = Int128{256} * (up ? cell[a] : cell[a] + 1);
            entered.push_back({up ? face - s : s - face, length, a});
          }
          if (cell[a] != Cell(e)) {
            const Int128 face = Int128{256} * (up ? cell[a] + 1 : cell[a]);
            left.push_back({up ? face - s : s - face, length, a});
          }
        }
        const bool on_the_way = entered.empty() || left.empty() ||
                                *std::max_element(entered.begin(), entered.end()) <
                                    *std::min_element(left.begin(), left.end());
        if (on_the_way) plot(x, y, z, Mix(line.color_s, line.color_e, k, total));
      }
    }
  }
}

}  // namespace

void PlotLine(const OracleLine& line, const DenseVolume& grid, const Plot& plot) {
  int64_t n = 0;
  if (line.sampling == LineSampling::kCover) {
    for (int a = 0; a < 3; ++a) n += std::abs(Cell(line.e.v[a]) - Cell(line.s.v[a]));
  } else {
    n = StepsOf(line);
  }
  if (n == 0) {
    PlotAt(line.s, line.color_s, grid, plot);
    PlotAt(line.e, line.color_e, grid, plot);
  } else if (line.sampling == LineSampling::kCover) {
    PlotCells(line, grid, plot);
  } else {
    PlotSteps(line, n, grid, plot);
  }
}

void PlotCapsule(const OracleLine& given, int64_t radius, const DenseVolume& grid,
                 const Plot& plot) {
  OracleLine line = given;
  const auto key = [](const Units& p) { return std::tuple(p.v[0], p.v[1], p.v[2]); };
  if (key(line.e) < key(line.s)) {
    std::swap(line.s, line.e);
    std::swap(line.color_s, line.color_e);
  }
  std::array<double, 3> d;
  for (size_t a = 0; a < 3; ++a) d[a] = static_cast<double>(line.e.v[a] - line.s.v[a]);
  const double dd = (d[0] * d[0] + d[1] * d[1]) + d[2] * d[2];
  const double r = static_cast<double>(radius);
  for (int64_t z = 0; z < grid.nz; ++z) {
    for (int64_t y = 0; y < grid.ny; ++y) {
      for (int64_t x = 0; x < grid.nx; ++x) {
        const std::array<double, 3> w = {static_cast<double>(x * 256 + 128 - line.s.v[0]),
                                         static_cast<double>(y * 256 + 128 - line.s.v[1]),
                                         static_cast<double>(z * 256 + 128 - line.s.v[2])};
        const double dot = (w[0] * d[0] + w[1] * d[1]) + w[2] * d[2];
        bool inside;
        uint32_t rgb;
        if (dot <= 0) {
          inside = (w[0] * w[0] + w[1] * w[1]) + w[2] * w[2] <= r * r;
          rgb = line.color_s;
        } else if (dot >= dd) {
          const std::array<double, 3> u = {w[0] - d[0], w[1] - d[1], w[2] - d[2]};
          inside = (u[0] * u[0] + u[1] * u[1]) + u[2] * u[2] <= r * r;
          rgb = line.color_e;
        } else {
          const std::array<double, 3> c = {w[1] * d[2] - w[2] * d[1], w[2] * d[0] - w[0] * d[2],
                                           w[0] * d[1] - w[1] * d[0]};
          inside = (c[0] * c[0] + c[1] * c[1]) + c[2] * c[2] <= r * r * dd;
          const Int128 k = static_cast<Int128>(std::floor(dot / dd * 65536.0));
          rgb = Mix(line.color_s, line.color_e, k, 65536);
        }
        if (inside) plot(x, y, z, rgb);
      }
    }
  }
}

}  // namespace voxeld::gpu::conformance
