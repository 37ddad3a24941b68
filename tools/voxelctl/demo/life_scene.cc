#include "tools/voxelctl/demo/life_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "tools/voxelctl/demo/life.h"
#include "tools/voxelctl/demo/motion.h"

namespace voxeld::voxelctl {
namespace {

constexpr double kStepsPerSecond = 7;
constexpr int kVoxelsPerCell = 5, kLeastSide = 16, kMostSide = 26;
// If cells are as large as voxels, a rotated cube is blurred.
constexpr int kTurnedFrom = 48;

constexpr std::array<std::array<uint8_t, 3>, 5> kStateColors = {
    {{0, 0, 0}, {30, 10, 70}, {90, 20, 130}, {220, 60, 120}, {255, 245, 190}}};

class LifeScene final : public Scene {
 public:
  explicit LifeScene(const SceneSettings& settings)
      : space_(settings.space),
        life_(std::clamp(settings.least_side / kVoxelsPerCell, kLeastSide, kMostSide)) {
    motion_.turn_s = settings.least_side < kTurnedFrom ? 0 : 30;
    const bool round = space_.round || motion_.turn_s > 0;
    // Half of a cube's diagonal, in half sides.
    const double across = round ? std::numbers::sqrt2 : 1;
    const double half =
        FitRadius({.half = {space_.half.x / across, space_.half.y / across, space_.half.z}}, 1);
    const double middle = -life_.side() / 2.0;
    to_scene_ = client::Affine::Scale(2 * half / life_.side()) *
                client::Affine::Translate({middle, middle, middle});
    life_.Sow(seed_);
  }

  absl::Status Begin(Stage& stage) override {
    client::Frame frame = stage.layer().BeginFrame();
    frame.Draw("cells", Cells(), {.transform = to_scene_});
    absl::Status status = frame.End();
    return status.ok() ? stage.layer().Set({.transform = PoseAt(motion_, space_, 0)}) : status;
  }

  absl::Status Move(Stage& stage, double seconds) override {
    const auto due = static_cast<int64_t>(seconds * kStepsPerSecond);
    if (due > steps_) {
      steps_ = due;  // missed steps are skipped
      life_.Step();
      if (watch_.IsOver(life_)) {
        life_.Sow(++seed_);
        watch_ = LifeWatch();
      }
      absl::Status status = stage.layer().Put("cells", Cells(), {.transform = to_scene_}).status();
      if (!status.ok()) return status;
    }
    return stage.layer().Set({.transform = PoseAt(motion_, space_, seconds)});
  }

 private:
  client::Points Cells() const {
    std::vector<float> positions;
    std::vector<uint8_t> colors;
    for (int z = 0; z < life_.side(); ++z) {
      for (int y = 0; y < life_.side(); ++y) {
        for (int x = 0; x < life_.side(); ++x) {
          const uint8_t state = life_.At(x, y, z);
          if (state == Life::kEmpty) continue;
          positions.insert(positions.end(),
                           {static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)});
          const std::array<uint8_t, 3>& color = kStateColors[state];
          colors.insert(colors.end(), color.begin(), color.end());
        }
      }
    }
    return {.vertices = {.positions = std::move(positions),
                         .colors = std::move(colors),
                         .indices = {},
                         .short_indices = {}},
            .thickness = {},
            .splat = client::Points::Splat::kCell};
  }

  const DisplaySpace space_;
  Life life_;
  LifeWatch watch_;
  Motion motion_;
  client::Affine to_scene_;
  uint64_t seed_ = 1;
  int64_t steps_ = 0;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Scene>> MakeLife(const SceneSettings& settings) {
  return std::make_unique<LifeScene>(settings);
}

}  // namespace voxeld::voxelctl
