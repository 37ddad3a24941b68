// Implements gpu/implicit/field.h's definition voxel by voxel: a plain interpreter runs the
// program, with gradients by the rules of differentiation, in the order of operations that dual.h
// states.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "gpu/implicit/number.h"
#include "gpu/implicit/program.h"
#include "tests/conformance/oracle_shapes.h"

namespace voxeld::gpu::conformance {
namespace {

using implicit::Op;

struct Jet {
  float v = 0, d[3] = {};
};

// Applies one operation; `n` is its immediate operand. Without `gradients`, they stay 0.
Jet Apply(Op op, const Jet& a, const Jet& b, int32_t n, bool gradients) {
  const auto jet_of = [gradients](float v, auto f) {
    Jet jet{v};
    for (int i = 0; gradients && i < 3; ++i) jet.d[i] = f(i);
    return jet;
  };
  const auto chain = [&](float v, float slope) {
    return jet_of(v, [&](int i) { return slope * a.d[i]; });
  };
  const bool a_first = std::isnan(a.v) ? false : (std::isnan(b.v) || a.v <= b.v);
  switch (op) {
    case Op::kNeg:
      return jet_of(-a.v, [&](int i) { return -a.d[i]; });
    case Op::kAbs:
      return a.v < 0 ? jet_of(-a.v, [&](int i) { return -a.d[i]; }) : a;
    case Op::kSquare:
      return chain(a.v * a.v, a.v + a.v);
    case Op::kSqrt: {
      const float root = a.v < 0 ? std::numeric_limits<float>::quiet_NaN() : std::sqrt(a.v);
      return chain(root, 0.5f / root);
    }
    case Op::kCbrt: {
      const float root = implicit::Cbrt(a.v);
      return chain(root, 0.333333343f / (root * root));
    }
    case Op::kSin:
      return chain(implicit::Sin(a.v), implicit::Cos(a.v));
    case Op::kCos:
      return chain(implicit::Cos(a.v), -implicit::Sin(a.v));
    case Op::kExp:
      return chain(implicit::Exp(a.v), implicit::Exp(a.v));
    case Op::kLog:
      return chain(implicit::Log(a.v), 1.0f / a.v);
    case Op::kFloor:
      return {std::floor(a.v)};
    case Op::kPowI:
      return chain(implicit::PowI(a.v, n),
                   static_cast<float>(n) * implicit::PowI(a.v, n == 0 ? 0 : n - 1));
    case Op::kAdd:
      return jet_of(a.v + b.v, [&](int i) { return a.d[i] + b.d[i]; });
    case Op::kSub:
      return jet_of(a.v - b.v, [&](int i) { return a.d[i] - b.d[i]; });
    case Op::kMul:
      return jet_of(a.v * b.v, [&](int i) { return a.d[i] * b.v + a.v * b.d[i]; });
    case Op::kDiv: {
      const float q = a.v / b.v;
      return jet_of(q, [&](int i) { return (a.d[i] - q * b.d[i]) / b.v; });
    }
    case Op::kMin:
      return a_first ? a : b;
    case Op::kMax:
      return std::isnan(a.v) || (!std::isnan(b.v) && a.v >= b.v) ? a : b;
    case Op::kAtan2: {
      const float length2 = b.v * b.v + a.v * a.v;
      return jet_of(implicit::Atan2(a.v, b.v),
                    [&](int i) { return (b.v * a.d[i] - a.v * b.d[i]) / length2; });
    }
    default:
      return {};
  }
}

class OracleField {
 public:
  OracleField(const ModelGeometry& g, const Affine& map, const DenseVolume& grid)
      : g_(g), nx_(grid.nx + 2), ny_(grid.ny + 2), nz_(grid.nz + 2) {
    drawable_ = SetOracleFrame(map, /*keep_thin=*/false, frame_);
    voxel_ = static_cast<float>(1.0 / OracleScale(map));
    half_ = static_cast<float>(OracleRadius(g.record, map)) / 256.0f;
    std::memcpy(static_cast<void*>(&header_), g.indices.data(), sizeof(header_));
    code_[0] = implicit::kHeaderWords;
    code_[1] = code_[0] + 2 * header_.surface;
    code_[2] = code_[1] + 2 * header_.bound;
    rings_ = code_[2] + 2 * header_.color;
  }

  bool drawable() const { return drawable_; }

  // Computes P for every voxel, and for those around the grid.
  void FindSurface() {
    surface_.reserve(static_cast<size_t>(nx_ * ny_ * nz_));
    for (int64_t z = -1; z < nz_ - 1; ++z) {
      for (int64_t y = -1; y < ny_ - 1; ++y) {
        for (int64_t x = -1; x < nx_ - 1; ++x) {
          float q[3];
          frame_.Coordinates(x, y, z, q);
          surface_.push_back(Run(0, header_.surface, q)[header_.surface_slot].v);
        }
      }
    }
  }

  bool Covers(int64_t x, int64_t y, int64_t z) const {
    const float p = Surface(x, y, z);
    bool covered = p <= 0;
    if (g_.record.fill != Fill::kSolid) {
      covered = half_ == 0 ? p == 0 : IsWithin(x, y, z);
      for (int n = 0; n < 27 && !covered; ++n) {
        const int dx = n % 3 - 1, dy = n / 3 % 3 - 1, dz = n / 9 - 1;
        const int steps = std::abs(dx) + std::abs(dy) + std::abs(dz);
        if (steps == 0 || (steps > 1 && g_.record.rule == SurfaceRule::kThin)) continue;
        const float other = Surface(x + dx, y + dy, z + dz);
        covered = (p <= 0) != (other <= 0) && Size(p) <= Size(other);
      }
    }
    if (!covered) return false;
    float q[3];
    frame_.Coordinates(x, y, z, q);
    if (header_.bound != 0 && !(Run(1, header_.bound, q)[header_.bound_slot].v <= 0)) return false;
    return header_.rings == 0 || Crossings(q) % 2 == 1;
  }

  uint32_t Color(int64_t x, int64_t y, int64_t z) const {
    if (header_.color == 0) return g_.record.color & 0xFFFFFF;
    float q[3];
    frame_.Coordinates(x, y, z, q);
    const Slots slots = Run(2, header_.color, q);
    if (header_.color_by == implicit::ColorBy::kTable) {
      const float place = slots[header_.color_slots[0]].v;
      const size_t entry = !(place > 0) ? 0 : place >= 1 ? 255 : static_cast<size_t>(place * 256);
      return g_.indices[rings_ + header_.rings + entry];
    }
    uint32_t rgb = 0;
    for (const uint32_t slot : header_.color_slots) {
      float level = slots[slot].v;
      if (std::isnan(level) || level < 0) level = 0;
      if (level > 1) level = 1;
      rgb = rgb * 256 + static_cast<uint32_t>(level * 255 + 0.5f);
    }
    return rgb;
  }

 private:
  static float Size(float p) {
    return std::isnan(p) ? std::numeric_limits<float>::infinity() : std::fabs(p);
  }

  using Slots = std::array<Jet, implicit::kMostSlots>;
  Slots Run(int section, uint32_t count, const float q[3], bool gradients = false) const {
    Slots slots;
    for (uint32_t i = 0; i < count; ++i) {
      const uint32_t word = g_.indices[code_[section] + 2 * i];
      const uint32_t immediate = g_.indices[code_[section] + 2 * i + 1];
      const auto op = static_cast<Op>(word & 255);
      Jet value;
      if (op == Op::kConstant) {
        std::memcpy(&value.v, &immediate, sizeof(value.v));
      } else if (op == Op::kVoxel) {
        value.v = voxel_;
      } else if (op == Op::kX || op == Op::kY || op == Op::kZ) {
        const int axis = static_cast<int>(op) - static_cast<int>(Op::kX);
        value.v = q[axis];
        for (int a = 0; a < 3; ++a) value.d[a] = frame_.inverse[axis][a];
      } else {
        value = Apply(op, slots[word >> 16 & 255], slots[word >> 24],
                      static_cast<int32_t>(immediate), gradients);
      }
      slots[word >> 8 & 255] = value;
    }
    return slots;
  }

  bool IsWithin(int64_t x, int64_t y, int64_t z) const {
    float q[3];
    frame_.Coordinates(x, y, z, q);
    const Jet p = Run(0, header_.surface, q, /*gradients=*/true)[header_.surface_slot];
    return std::fabs(p.v) <=
           half_ * std::sqrt((p.d[0] * p.d[0] + p.d[1] * p.d[1]) + p.d[2] * p.d[2]);
  }
  float Surface(int64_t x, int64_t y, int64_t z) const {
    return surface_[static_cast<size_t>(((z + 1) * ny_ + y + 1) * nx_ + x + 1)];
  }

  // Counts the crossings of a ray along the first of the two remaining axes, from the point to +∞.
  int Crossings(const float q[3]) const {
    const uint32_t u = (header_.ring_axis + 1) % 3, v = (header_.ring_axis + 2) % 3;
    int crossings = 0;
    for (uint32_t r = 0; r < header_.rings; ++r) {
      const uint32_t begin = r == 0 ? 0 : g_.indices[rings_ + r - 1];
      const uint32_t count = g_.indices[rings_ + r] - begin;
      for (uint32_t i = 0; i < count; ++i) {
        const float* a = &g_.positions[3 * (begin + i)];
        const float* b = &g_.positions[3 * (begin + (i + 1) % count)];
        if ((a[v] > q[v]) == (b[v] > q[v])) continue;
        const float t = (q[v] - a[v]) / (b[v] - a[v]);
        if (q[u] < a[u] + t * (b[u] - a[u])) ++crossings;
      }
    }
    return crossings;
  }

  const ModelGeometry& g_;
  int64_t nx_, ny_, nz_;
  std::vector<float> surface_;
  OracleFrame frame_;
  bool drawable_ = false;
  float voxel_ = 0, half_ = 0;
  implicit::ProgramHeader header_;
  uint32_t code_[3], rings_;
};

}  // namespace

void PlotImplicit(const ModelGeometry& g, const Affine& map, const DenseVolume& grid,
                  const Plot& plot) {
  OracleField field(g, map, grid);
  if (!field.drawable()) return;
  field.FindSurface();
  int64_t low[3] = {0, 0, 0}, high[3] = {grid.nx, grid.ny, grid.nz};
  if (g.record.params[6] != 0) OracleDomain(g.record, map, low, high);
  for (int64_t z = std::max<int64_t>(0, low[2]); z < std::min<int64_t>(grid.nz, high[2]); ++z) {
    for (int64_t y = std::max<int64_t>(0, low[1]); y < std::min<int64_t>(grid.ny, high[1]); ++y) {
      for (int64_t x = std::max<int64_t>(0, low[0]); x < std::min<int64_t>(grid.nx, high[0]); ++x) {
        if (field.Covers(x, y, z)) plot(x, y, z, field.Color(x, y, z));
      }
    }
  }
}

}  // namespace voxeld::gpu::conformance
