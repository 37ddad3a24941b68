#include <algorithm>
#include <cmath>

#include "tests/display/geometry/swept_solid.h"

namespace voxeld::display {
namespace {

struct Extent {
  double low, high;
  bool Holds(double x, double slack) const { return x >= low - slack && x < high + slack; }
};

class SweptStack : public SweptSolid {
 public:
  SweptStack(const PlanarStack& stack, const VoxelGrid& grid) : stack_(stack), grid_(grid) {}

  Where Locate(const Vec3& point) const override {
    Extent depth = Slab(0);
    for (size_t s = 0; s < stack_.positions_mm.size(); ++s) {
      depth = {std::min(depth.low, Slab(s).low), std::max(depth.high, Slab(s).high)};
    }
    const Extent u{-0.5 * stack_.width_px * stack_.pitch_u_mm,
                   0.5 * stack_.width_px * stack_.pitch_u_mm};
    const Extent v{-0.5 * stack_.height_px * stack_.pitch_v_mm,
                   0.5 * stack_.height_px * stack_.pitch_v_mm};
    const auto all = [&](double sign) {
      return u.Holds(point.x, sign * SlackX()) && v.Holds(Across(point), sign * SlackAcross()) &&
             depth.Holds(Normal(point), sign * SlackNormal());
    };
    return all(-1) ? Where::kInside : all(1) ? Where::kNearBoundary : Where::kOutside;
  }

  std::vector<PixelId> Passing(const Vec3& point) const override {
    std::vector<PixelId> pixels;
    for (size_t s = 0; s < stack_.positions_mm.size(); ++s) {
      if (!Slab(s).Holds(Normal(point), -SlackNormal())) continue;
      for (int32_t u = 0; u < stack_.width_px; ++u) {
        if (!PixelU(u).Holds(point.x, -SlackX())) continue;
        for (int32_t v = 0; v < stack_.height_px; ++v) {
          if (PixelV(v).Holds(Across(point), -SlackAcross())) {
            pixels.push_back({static_cast<int32_t>(s), u, v});
          }
        }
      }
    }
    return pixels;
  }

  Vec3 Centre(const PixelId& pixel) const override {
    const double u = 0.5 * (PixelU(pixel.u).low + PixelU(pixel.u).high);
    const double v = 0.5 * (PixelV(pixel.v).low + PixelV(pixel.v).high);
    const double n = stack_.positions_mm[static_cast<size_t>(pixel.slice)];
    return Flat() ? Vec3{u, v, n} : Vec3{u, n, v};
  }

  bool MayShowOuter(int32_t slice, int32_t u, const FootprintEntry& entry,
                    int reach) const override {
    const size_t s = static_cast<size_t>(slice);
    const Vec3 voxel = VoxelCentre(grid_, entry.x, entry.y, entry.z);
    const Extent pixel = PixelU(u);
    const double middle = 0.5 * (pixel.low + pixel.high);
    const bool shows_x = pixel.Holds(voxel.x, SlackX()) ||
                         std::abs(middle - voxel.x) <= 0.5 * grid_.pitch_mm.x + SlackX();
    Extent depth = Slab(s);
    const size_t count = stack_.positions_mm.size() / static_cast<size_t>(stack_.strokes);
    for (const size_t beside : {s - 1, s + 1}) {
      if (reach < 2 || beside / count != s / count || beside >= stack_.positions_mm.size())
        continue;
      depth.low = std::min(depth.low, stack_.positions_mm[beside]);
      depth.high = std::max(depth.high, stack_.positions_mm[beside]);
    }
    const double half = 0.5 * Normal(grid_.pitch_mm) + SlackNormal();
    return shows_x && (depth.Holds(Normal(voxel), SlackNormal()) ||
                       std::abs(stack_.positions_mm[s] - Normal(voxel)) <= half);
  }

  bool MayShowInner(int32_t, int32_t v, const FootprintEntry& entry) const override {
    const double voxel = Across(VoxelCentre(grid_, entry.x, entry.y, entry.z));
    const Extent pixel = PixelV(v);
    const double half = 0.5 * Across(grid_.pitch_mm) + SlackAcross();
    return pixel.Holds(voxel, SlackAcross()) ||
           std::abs(0.5 * (pixel.low + pixel.high) - voxel) <= half;
  }

 private:
  bool Flat() const { return stack_.normal == PlanarStack::Normal::kZ; }
  double Across(const Vec3& p) const { return Flat() ? p.y : p.z; }
  double Normal(const Vec3& p) const { return Flat() ? p.z : p.y; }
  double SlackX() const { return kMargin * grid_.pitch_mm.x; }
  double SlackAcross() const { return kMargin * Across(grid_.pitch_mm); }
  double SlackNormal() const { return kMargin * Normal(grid_.pitch_mm); }

  Extent PixelU(int32_t u) const {
    const double from_left = stack_.mirror_u ? stack_.width_px - 1 - u : u;
    const double low = (from_left - stack_.width_px / 2.0) * stack_.pitch_u_mm;
    return {low, low + stack_.pitch_u_mm};
  }
  Extent PixelV(int32_t v) const {
    const double from_low = stack_.mirror_v ? stack_.height_px - 1 - v : v;
    const double low = (from_low - stack_.height_px / 2.0) * stack_.pitch_v_mm;
    return {low, low + stack_.pitch_v_mm};
  }
  Extent Slab(size_t s) const {
    const std::vector<double>& p = stack_.positions_mm;
    if (p.size() == 1) return {p[0] - stack_.thickness_mm / 2, p[0] + stack_.thickness_mm / 2};
    const size_t count = p.size() / static_cast<size_t>(stack_.strokes);
    const double before = s % count > 0 ? p[s] - p[s - 1] : p[s + 1] - p[s];
    const double after = s % count + 1 < count ? p[s + 1] - p[s] : p[s] - p[s - 1];
    const double a = p[s] - before / 2, b = p[s] + after / 2;
    return {std::min(a, b), std::max(a, b)};
  }

  const PlanarStack stack_;
  const VoxelGrid grid_;
};

}  // namespace

std::unique_ptr<SweptSolid> MakeSweptStack(const PlanarStack& stack, const VoxelGrid& grid) {
  return std::make_unique<SweptStack>(stack, grid);
}

}  // namespace voxeld::display
