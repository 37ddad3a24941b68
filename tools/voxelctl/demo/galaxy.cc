#include "tools/voxelctl/demo/galaxy.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace voxeld::voxelctl {
namespace {

// The standard's distributions differ between libraries; its generators do not.
class Chance {
 public:
  explicit Chance(uint64_t seed) : bits_(seed) {}
  double Uniform() { return static_cast<double>(bits_() >> 11) * 0x1p-53; }
  // Approximately normal, within ±3: the sum of twelve uniform numbers has a variance of one.
  double Normal() {
    double sum = -6;
    for (int i = 0; i < 12; ++i) sum += Uniform();
    return std::clamp(sum, -3.0, 3.0);
  }

 private:
  std::mt19937_64 bits_;
};

constexpr double kPitch = 0.3;       // tangent of the arms' pitch
constexpr double kInnermost = 0.12;  // where the arms begin

Rgb Dimmed(const Rgb& c, double light) {
  const auto dim = [&](uint8_t v) { return static_cast<uint8_t>(v * light); };
  return {dim(c.r), dim(c.g), dim(c.b)};
}

}  // namespace

Model GalaxyModel(uint64_t seed, uint32_t stars) {
  Chance chance(seed);
  Model model;
  model.format = "galaxy";
  model.lit_already = true;
  Part& part = model.parts.emplace_back();
  part.kind = Kind::kPoints;
  for (uint32_t i = 0; i < stars; ++i) {
    const double share = chance.Uniform();
    Point3 p;
    Rgb color;
    if (share < 0.22) {
      const double r = 0.065;
      p = {r * chance.Normal(), r * chance.Normal(), 0.8 * r * chance.Normal()};
      color = {255, 205, 130};
    } else if (share < 0.85) {
      // Stars are denser near the centre, and each arm is wider farther out.
      const double r = kInnermost + (0.95 - kInnermost) * std::pow(chance.Uniform(), 0.8);
      const double arm = chance.Uniform() < 0.5 ? 0 : std::numbers::pi;
      const double angle = arm + std::log(r / kInnermost) / kPitch + 0.13 * chance.Normal();
      p = {r * std::cos(angle), r * std::sin(angle), 0.016 * chance.Normal()};
      color = chance.Uniform() < 0.08 ? Rgb{255, 90, 160} : Rgb{130, 180, 255};
    } else {
      const double r = std::sqrt(chance.Uniform());
      const double angle = 2 * std::numbers::pi * chance.Uniform();
      p = {r * std::cos(angle), r * std::sin(angle), 0.03 * chance.Normal()};
      color = {255, 235, 200};
    }
    const double light = 0.3 + 0.7 * std::pow(chance.Uniform(), 2);
    // Stars beyond the edge are moved to the centre, where this is not noticeable.
    if (std::hypot(p.x, p.y) > 1) p = {0, 0, 0};
    part.positions.push_back(p);
    part.colors.push_back(Dimmed(color, light));
  }
  return model;
}

}  // namespace voxeld::voxelctl
