#include "tests/display/geometry/swept_flat.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>
#include <variant>

namespace voxeld::display {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;
constexpr double kSlack = 2e-3;  // pixels, slices
constexpr double kFar = std::numeric_limits<double>::infinity();

// Returns x of a·x = b, three equations, by elimination.
std::array<double, 3> Solved(std::array<std::array<double, 4>, 3> m) {
  for (size_t i = 0; i < 3; ++i) {
    size_t most = i;
    for (size_t r = i + 1; r < 3; ++r) {
      if (std::abs(m[r][i]) > std::abs(m[most][i])) most = r;
    }
    std::swap(m[i], m[most]);
    for (size_t r = 0; r < 3; ++r) {
      if (r == i) continue;
      const double f = m[r][i] / m[i][i];
      for (size_t c = i; c < 4; ++c) m[r][c] -= f * m[i][c];
    }
  }
  return {m[0][3] / m[0][0], m[1][3] / m[1][1], m[2][3] / m[2][2]};
}

// Interpolates linearly between eight places, by their weights.
Vec3 DisplacedBy(const DisplacementGrid& grid, const Vec3& p) {
  const int32_t n[3] = {grid.nx, grid.ny, grid.nz};
  const double at[3] = {p.x, p.y, p.z}, low[3] = {grid.low_mm.x, grid.low_mm.y, grid.low_mm.z},
               high[3] = {grid.high_mm.x, grid.high_mm.y, grid.high_mm.z};
  double place[3];
  for (int a = 0; a < 3; ++a)
    place[a] = std::clamp((at[a] - low[a]) / (high[a] - low[a]), 0.0, 1.0) * (n[a] - 1);
  Vec3 sum;
  for (int32_t k = 0; k < n[2]; ++k) {
    for (int32_t j = 0; j < n[1]; ++j) {
      for (int32_t i = 0; i < n[0]; ++i) {
        double weight = 1;
        const int32_t ijk[3] = {i, j, k};
        for (int a = 0; a < 3; ++a) weight *= std::max(0.0, 1 - std::abs(place[a] - ijk[a]));
        const Vec3& d = grid.at_mm[static_cast<size_t>((k * n[1] + j) * n[0] + i)];
        sum = {sum.x + weight * d.x, sum.y + weight * d.y, sum.z + weight * d.z};
      }
    }
  }
  return sum;
}

double FromEdge(double at_mm, double pitch_mm, int32_t count, double shift_mm, bool mirror) {
  const double place = (at_mm - shift_mm) / pitch_mm + count / 2.0;
  return mirror ? count - place : place;
}

}  // namespace

SweptFlat::SweptFlat(const Geometry& geometry) : geometry_(geometry) {
  pitch_ = std::min({geometry.grid.pitch_mm.x, geometry.grid.pitch_mm.y, geometry.grid.pitch_mm.z});
  std::tie(width_, height_) = std::visit(
      [](const auto& shape) { return std::pair(shape.width_px, shape.height_px); }, geometry.shape);
}

Vec3 SweptFlat::NominalOf(const Vec3& place) const {
  if (!geometry_.correction.has_value()) return place;
  const auto& a = geometry_.correction->affine;
  Vec3 nominal = place;
  for (int i = 0; i < 300; ++i) {
    Vec3 d;
    if (geometry_.correction->displacement)
      d = DisplacedBy(*geometry_.correction->displacement, nominal);
    const auto x = Solved({{{a[0], a[1], a[2], place.x - d.x - a[3]},
                            {a[4], a[5], a[6], place.y - d.y - a[7]},
                            {a[8], a[9], a[10], place.z - d.z - a[11]}}});
    const double moved =
        std::abs(x[0] - nominal.x) + std::abs(x[1] - nominal.y) + std::abs(x[2] - nominal.z);
    nominal = {x[0], x[1], x[2]};
    if (moved < 1e-12) break;
  }
  return nominal;
}

// Solves M·(u, v, 1) ~ (x, y, 1) for (u, v): two equations.
PicturePlace SweptFlat::NominalPicture(int32_t slice, double x, double y) const {
  if (!geometry_.correction || geometry_.correction->homographies.empty()) return {x, y};
  const auto& all = geometry_.correction->homographies;
  const auto& m = all[all.size() == 1 ? 0 : static_cast<size_t>(slice)];
  const double a = m[0] - x * m[6], b = m[1] - x * m[7], c = m[3] - y * m[6], d = m[4] - y * m[7];
  const double e = x * m[8] - m[2], f = y * m[8] - m[5], det = a * d - b * c;
  return {(e * d - b * f) / det, (a * f - e * c) / det};
}

void SweptFlat::AddStack(const PlanarStack& stack, const Vec3& p, std::vector<Pass>& out) const {
  const bool flat = stack.normal == PlanarStack::Normal::kZ;
  const double depth = flat ? p.z : p.y,
               pitch = flat ? geometry_.grid.pitch_mm.z : geometry_.grid.pitch_mm.y;
  const auto& at = stack.positions_mm;
  const size_t count = at.size() / static_cast<size_t>(stack.strokes);
  for (size_t s = 0; s < at.size(); ++s) {
    const bool begins = s % count == 0, ends = s % count + 1 == count;
    const double before = begins ? 2 * at[s] - at[s + 1] : at[s - 1];
    const double after = ends ? 2 * at[s] - at[s - 1] : at[s + 1];
    const double way = (depth - at[s]) * (after - at[s]) > 0 ? after - at[s] : before - at[s];
    const double offset = (depth - at[s]) / way;  // 1: at the neighbour
    if (offset > 1.01) continue;
    // Beyond the outer slices there is half a spacing.
    const bool outward = (way == after - at[s] && ends) || (way == before - at[s] && begins);
    const double inside = outward ? (0.5 - offset) * std::abs(way) / pitch : kFar;
    if (outward && offset > 0.5 + kSlack) continue;
    const PicturePlace q = NominalPicture(static_cast<int32_t>(s), p.x, flat ? p.y : p.z);
    out.push_back({static_cast<int32_t>(s),
                   FromEdge(q.u, stack.pitch_u_mm, stack.width_px, 0, stack.mirror_u),
                   FromEdge(q.v, stack.pitch_v_mm, stack.height_px, 0, stack.mirror_v), offset,
                   inside});
  }
}

void SweptFlat::AddRotor(const Rotor& rotor, const Vec3& p, std::vector<Pass>& out) const {
  const int32_t n = rotor.slices_per_turn, panels = static_cast<int32_t>(rotor.panels.size());
  for (int32_t index = 0; index < panels; ++index) {
    const Rotor::Panel& panel = rotor.panels[static_cast<size_t>(index)];
    const double tilt = panel.tilt_deg * std::numbers::pi / 180;
    const double w = p.z / std::cos(tilt), e = panel.eccentricity_mm + w * std::sin(tilt);
    const double rho = std::hypot(p.x, p.y);
    if (rho < std::abs(e)) continue;
    const double v =
        FromEdge(w, panel.pitch_v_mm, rotor.height_px, panel.shift_v_mm, panel.mirror_v);
    for (const double sign : {1.0, -1.0}) {
      const double a = sign * std::sqrt(rho * rho - e * e);
      double turn = (std::atan2(p.y, p.x) - std::atan2(e, a)) / kTurn - panel.phase_turns;
      if (rotor.clockwise) turn = -turn;
      const double steps = (turn - std::floor(turn)) * n, below = std::floor(steps);
      const double u =
          FromEdge(a, panel.pitch_u_mm, rotor.width_px, panel.shift_u_mm, panel.mirror_u);
      for (const double step : {below, below + 1}) {
        out.push_back(
            {static_cast<int32_t>(step) % n * panels + index, u, v, std::abs(steps - step), kFar});
      }
    }
  }
}

void SweptFlat::AddHelix(const Helix& helix, const Vec3& p, std::vector<Pass>& out) const {
  const double rho = std::hypot(p.x, p.y), share = p.z / helix.height_mm + 0.5;
  double inside = std::min(helix.radius_mm - rho, (1 - share) * helix.height_mm);
  inside = std::min(inside, share * helix.height_mm);
  if (helix.hub_mm > 0) inside = std::min(inside, rho - helix.hub_mm);
  if (inside < -pitch_) return;
  for (int32_t blade = 0; blade < helix.blades; ++blade) {
    const double risen = share * helix.span_turns * (helix.left_handed ? -1 : 1);
    double turn = std::atan2(p.y, p.x) / kTurn - risen - blade / static_cast<double>(helix.blades) -
                  helix.phase_turns;
    if (helix.clockwise) turn = -turn;
    const double steps = (turn - std::floor(turn)) * helix.slices_per_turn,
                 below = std::floor(steps);
    for (const double step : {below, below + 1}) {
      const int32_t slice = static_cast<int32_t>(step) % helix.slices_per_turn;
      const PicturePlace q = NominalPicture(slice, p.x, p.y);
      out.push_back({slice, FromEdge(q.u, helix.pitch_u_mm, helix.width_px, 0, helix.mirror_u),
                     FromEdge(q.v, helix.pitch_v_mm, helix.height_px, 0, helix.mirror_v),
                     std::abs(steps - step), inside / pitch_});
    }
  }
}

std::vector<SweptFlat::Pass> SweptFlat::PassesOf(const Vec3& place) const {
  std::vector<Pass> out;
  const Vec3 nominal = NominalOf(place);
  if (const auto* stack = std::get_if<PlanarStack>(&geometry_.shape))
    AddStack(*stack, nominal, out);
  if (const auto* rotor = std::get_if<Rotor>(&geometry_.shape)) AddRotor(*rotor, nominal, out);
  if (const auto* helix = std::get_if<Helix>(&geometry_.shape)) AddHelix(*helix, nominal, out);
  return out;
}

bool SweptFlat::Doubtful(const Vec3& place) const {
  const Vec3 p = NominalOf(place);
  const double rho = std::hypot(p.x, p.y);
  if (std::holds_alternative<PlanarStack>(geometry_.shape)) return false;
  if (rho < 0.3 * pitch_) return true;
  if (const auto* rotor = std::get_if<Rotor>(&geometry_.shape)) {
    for (const Rotor::Panel& panel : rotor->panels) {
      const double tilt = panel.tilt_deg * std::numbers::pi / 180;
      const double e = panel.eccentricity_mm + p.z * std::tan(tilt);
      if (rho > std::abs(e) - 0.01 * pitch_ && rho < std::abs(e) + 0.05 * pitch_) return true;
    }
  }
  return false;
}

SweptSolid::Where SweptFlat::Locate(const Vec3& place) const {
  bool near = false;
  for (const Pass& pass : PassesOf(place)) {
    if (pass.offset > 0.5 + kSlack) continue;
    const double within =
        std::min({pass.u, width_ - pass.u, pass.v, height_ - pass.v, pass.inside});
    if (within > kSlack && pass.offset < 0.5 - kSlack) return SweptSolid::Where::kInside;
    near |= within > -kSlack;
  }
  return near ? SweptSolid::Where::kNearBoundary : SweptSolid::Where::kOutside;
}

bool SweptFlat::MayPass(int32_t slice, int32_t u, int32_t v, const Vec3& place, int reach) const {
  for (const Pass& pass : PassesOf(place)) {
    if (pass.slice == slice && pass.offset <= 0.5 * reach + kSlack && pass.inside > -kSlack &&
        std::abs(pass.u - u - 0.5) <= 0.5 + kSlack && std::abs(pass.v - v - 0.5) <= 0.5 + kSlack) {
      return true;
    }
  }
  return false;
}

}  // namespace voxeld::display
