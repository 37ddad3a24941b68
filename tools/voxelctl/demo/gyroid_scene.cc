#include "tools/voxelctl/demo/gyroid_scene.h"

#include <cmath>
#include <numbers>

#include "absl/strings/str_format.h"
#include "tools/voxelctl/demo/motion.h"

namespace voxeld::voxelctl {
namespace {

constexpr double kBreath_s = 8;
constexpr double kRadius = 2.5 * std::numbers::pi;  // two and a half cells across
// On displays with fewer voxels, one cell is shown; otherwise its walls would be everywhere.
constexpr int kFewVoxels = 32;

class GyroidScene final : public Scene {
 public:
  explicit GyroidScene(const SceneSettings& settings) : space_(settings.space) {
    radius_ = settings.least_side < kFewVoxels ? std::numbers::pi : kRadius;
    const double half = FitRadius(space_, 1e-9);
    scale_ = half / radius_;
    height_ = 0.97 * space_.half.z / scale_;
  }

  absl::Status Begin(Stage& stage) override {
    client::Frame frame = stage.layer().BeginFrame();
    frame.Draw("gyroid", Shape(0), Pose());
    return frame.End();
  }

  absl::Status Move(Stage& stage, double seconds) override {
    return stage.layer().Put("gyroid", Shape(seconds), Pose()).status();
  }

 private:
  client::Implicit Shape(double seconds) const {
    client::Implicit shape;
    shape.surface = "sin(x)*cos(y) + sin(y)*cos(z) + sin(z)*cos(x) = level";
    // The bound is a ball if the display is high enough, otherwise the part of it that fits.
    shape.bound =
        absl::StrFormat("x^2 + y^2 + z^2 <= %.17g and abs(z) <= %.17g", radius_ * radius_, height_);
    shape.parameters = {{"level", GyroidLevel(seconds)}};
    shape.level = absl::StrFormat("0.5 + z/%.17g", 2.2 * radius_);
    shape.colormap = "plasma";
    return shape;
  }

  client::Look Pose() const {
    return {.transform =
                client::Affine::Translate({space_.center.x, space_.center.y, space_.center.z}) *
                client::Affine::Scale(scale_)};
  }

  const DisplaySpace space_;
  double radius_ = kRadius, height_ = kRadius, scale_ = 1;
};

}  // namespace

double GyroidLevel(double seconds) { return std::sin(2 * std::numbers::pi * seconds / kBreath_s); }

absl::StatusOr<std::unique_ptr<Scene>> MakeGyroid(const SceneSettings& settings) {
  return std::make_unique<GyroidScene>(settings);
}

}  // namespace voxeld::voxelctl
