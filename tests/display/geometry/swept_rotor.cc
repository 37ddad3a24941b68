#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/display/geometry/swept_solid.h"

namespace voxeld::display {
namespace {

constexpr double kFullTurn = 2 * std::numbers::pi;

// An interval on the panel's u axis, or of turn angles in steps.
struct Interval {
  double low, high;
  bool Overlaps(const Interval& other) const { return low <= other.high && other.low <= high; }
  bool Contains(const Interval& other) const { return low <= other.low && other.high < high; }
  Interval Wider(double slack) const { return {low - slack, high + slack}; }
};

// Where a panel's plane passes a point: the place along u, and the turn in steps, over all points
// within the margin of it.
struct Pass {
  Interval a, steps;
};

class SweptRotor : public SweptSolid {
 public:
  SweptRotor(const Rotor& rotor, const VoxelGrid& grid)
      : rotor_(rotor),
        grid_(grid),
        slack_(kMargin * std::max(grid.pitch_mm.x, grid.pitch_mm.y)),
        slack_z_(kMargin * grid.pitch_mm.z) {}

  Where Locate(const Vec3& point) const override {
    bool near = false;
    for (const Rotor::Panel& panel : rotor_.panels) {
      const Where where = LocateFor(panel, point);
      if (where == Where::kInside) return where;
      near = near || where == Where::kNearBoundary;
    }
    return near ? Where::kNearBoundary : Where::kOutside;
  }

  std::vector<PixelId> Passing(const Vec3& point) const override {
    std::vector<PixelId> pixels;
    for (size_t p = 0; p < rotor_.panels.size(); ++p) {
      const Rotor::Panel& panel = rotor_.panels[p];
      if (std::hypot(point.x, point.y) < std::abs(panel.eccentricity_mm) + slack_) continue;
      for (const double sign : {1.0, -1.0}) {
        const Pass pass = PassAt(panel, point, sign);
        // Both ends of the turn must be in one step, and both ends along u in one pixel.
        const double step = std::floor(pass.steps.low + 0.5);
        if (!Interval{step - 0.5, step + 0.5}.Contains(pass.steps)) continue;
        const int32_t slice = SliceAt(static_cast<int32_t>(step), p);
        for (int32_t u = 0; u < rotor_.width_px; ++u) {
          if (!PixelU(panel, u).Contains(pass.a)) continue;
          for (int32_t v = 0; v < rotor_.height_px; ++v) {
            const Interval z{point.z - slack_z_, point.z + slack_z_};
            if (PixelV(panel, v).Contains(z)) pixels.push_back({slice, u, v});
          }
        }
      }
    }
    return pixels;
  }

  Vec3 Centre(const PixelId& pixel) const override {
    const Rotor::Panel& panel = PanelOf(pixel.slice);
    const double theta = AngleAt(pixel.slice);
    const Interval u = PixelU(panel, pixel.u), v = PixelV(panel, pixel.v);
    const double a = (u.low + u.high) / 2, e = panel.eccentricity_mm;
    return {a * std::cos(theta) - e * std::sin(theta), a * std::sin(theta) + e * std::cos(theta),
            (v.low + v.high) / 2};
  }

  bool MayShowOuter(int32_t slice, int32_t u, const FootprintEntry& entry,
                    int reach) const override {
    const Vec3 voxel = VoxelCentre(grid_, entry.x, entry.y, 0);
    const Vec3 centre = Centre({slice, u, 0});
    if (std::abs(centre.x - voxel.x) <= grid_.pitch_mm.x / 2 + slack_ &&
        std::abs(centre.y - voxel.y) <= grid_.pitch_mm.y / 2 + slack_) {
      return true;
    }
    const Rotor::Panel& panel = PanelOf(slice);
    const double rho = std::hypot(voxel.x, voxel.y);
    if (rho < std::abs(panel.eccentricity_mm) - slack_) return false;
    if (rho < slack_) return PixelU(panel, u).Overlaps({-slack_, slack_});
    const double steps = rotor_.slices_per_turn;
    const double step = slice / static_cast<int32_t>(rotor_.panels.size());
    for (const double sign : {1.0, -1.0}) {
      const Pass pass = PassAt(panel, voxel, sign);
      if (!PixelU(panel, u).Overlaps(pass.a)) continue;
      for (const double turn : {-steps, 0.0, steps}) {
        const double at = step + turn;
        if (Interval{at - 0.5 * reach, at + 0.5 * reach}.Overlaps(pass.steps)) return true;
      }
    }
    return false;
  }

  bool MayShowInner(int32_t slice, int32_t v, const FootprintEntry& entry) const override {
    const double z = VoxelCentre(grid_, 0, 0, entry.z).z;
    const Interval pixel = PixelV(PanelOf(slice), v);
    return pixel.Overlaps(Interval{z, z}.Wider(slack_z_)) ||
           std::abs((pixel.low + pixel.high) / 2 - z) <= grid_.pitch_mm.z / 2 + slack_z_;
  }

 private:
  const Rotor::Panel& PanelOf(int32_t slice) const {
    return rotor_.panels[static_cast<size_t>(slice) % rotor_.panels.size()];
  }
  // Turns beyond a whole one wrap around.
  int32_t SliceAt(int32_t step, size_t panel) const {
    const int32_t n = rotor_.slices_per_turn;
    const int32_t within = (step % n + n) % n;
    return within * static_cast<int32_t>(rotor_.panels.size()) + static_cast<int32_t>(panel);
  }
  double AngleAt(int32_t slice) const {
    const int32_t step = slice / static_cast<int32_t>(rotor_.panels.size());
    const double turned = kFullTurn * step / rotor_.slices_per_turn;
    const double phase = kFullTurn * PanelOf(slice).phase_turns;
    return rotor_.clockwise ? phase - turned : phase + turned;
  }
  Interval PixelU(const Rotor::Panel& panel, int32_t u) const {
    const double from_near = panel.mirror_u ? rotor_.width_px - 1 - u : u;
    const double low = (from_near - rotor_.width_px / 2.0) * panel.pitch_u_mm + panel.shift_u_mm;
    return {low, low + panel.pitch_u_mm};
  }
  Interval PixelV(const Rotor::Panel& panel, int32_t v) const {
    const double from_low = panel.mirror_v ? rotor_.height_px - 1 - v : v;
    const double low = (from_low - rotor_.height_px / 2.0) * panel.pitch_v_mm + panel.shift_v_mm;
    return {low, low + panel.pitch_v_mm};
  }

  Where LocateFor(const Rotor::Panel& panel, const Vec3& point) const {
    const double half_u = rotor_.width_px * panel.pitch_u_mm / 2;
    const double half_v = rotor_.height_px * panel.pitch_v_mm / 2;
    const Interval u{panel.shift_u_mm - half_u, panel.shift_u_mm + half_u};
    const Interval v{panel.shift_v_mm - half_v, panel.shift_v_mm + half_v};
    const double e = std::abs(panel.eccentricity_mm), rho = std::hypot(point.x, point.y);
    bool near = std::abs(rho - std::hypot(u.low, e)) < slack_ ||
                std::abs(rho - std::hypot(u.high, e)) < slack_ ||
                std::abs(point.z - v.low) < slack_z_ || std::abs(point.z - v.high) < slack_z_;
    // The cylinder that the plane touches bounds the solid, unless it is the axis, within the
    // panel.
    if (e > 0 || u.low >= 0 || u.high <= 0) near = near || std::abs(rho - e) < slack_;
    if (near) return Where::kNearBoundary;
    if (rho < e || point.z < v.low || point.z > v.high) return Where::kOutside;
    const double a = std::sqrt(rho * rho - e * e);
    const bool inside = (u.low < a && a < u.high) || (u.low < -a && -a < u.high);
    return inside ? Where::kInside : Where::kOutside;
  }

  Pass PassAt(const Rotor::Panel& panel, const Vec3& point, double sign) const {
    const double e = panel.eccentricity_mm, rho = std::hypot(point.x, point.y);
    const auto along = [&](double distance) {
      return sign * std::sqrt(std::max(0.0, distance * distance - e * e));
    };
    const auto steps_at = [&](double a) {
      // The panel's point at a is seen from the axis at the angle atan2(e, a) to its u axis.
      const double theta = std::atan2(point.y, point.x) - std::atan2(e, a);
      double turn = theta / kFullTurn - panel.phase_turns;
      if (rotor_.clockwise) turn = -turn;
      return rotor_.slices_per_turn * (turn - std::floor(turn));
    };
    const double inner = along(std::max(0.0, rho - slack_)), outer = along(rho + slack_);
    const double slack = rotor_.slices_per_turn * slack_ / rho / kFullTurn;
    const double middle = steps_at(along(rho));
    // All three in the same turn as the middle.
    const auto nearest = [&](double steps) {
      const double n = rotor_.slices_per_turn;
      return steps - n * std::round((steps - middle) / n);
    };
    const auto [low, high] =
        std::minmax({nearest(steps_at(inner)), middle, nearest(steps_at(outer))});
    return {{std::min(inner, outer), std::max(inner, outer)}, Interval{low, high}.Wider(slack)};
  }

  const Rotor rotor_;
  const VoxelGrid grid_;
  const double slack_, slack_z_;  // in mm
};

}  // namespace

std::unique_ptr<SweptSolid> MakeSweptRotor(const Rotor& rotor, const VoxelGrid& grid) {
  return std::make_unique<SweptRotor>(rotor, grid);
}

std::unique_ptr<SweptSolid> MakeSweptSolid(const Geometry& geometry) {
  if (const auto* stack = std::get_if<PlanarStack>(&geometry.shape)) {
    return MakeSweptStack(*stack, geometry.grid);
  }
  if (const auto* lattice = std::get_if<Lattice>(&geometry.shape)) {
    return MakeSweptLattice(*lattice, geometry.grid);
  }
  return MakeSweptRotor(std::get<Rotor>(geometry.shape), geometry.grid);
}

}  // namespace voxeld::display
