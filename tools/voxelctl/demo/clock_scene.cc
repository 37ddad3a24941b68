#include "tools/voxelctl/demo/clock_scene.h"

#include <chrono>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "tools/voxelctl/demo/motion.h"

namespace voxeld::voxelctl {
namespace {

constexpr double kHigh = 0.62;  // of the ring's radius: the scene's extent up and down
constexpr double kRing = 0.86, kTube = 0.025;
constexpr double kLetters = 0.32;
constexpr double kLine = 0.42;  // from the first base line to the second
constexpr double kRingTilt = 20;

std::string TextNow() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  std::tm local{};
  localtime_r(&now, &local);
  return ClockText(local);
}

// Returns the ring about the origin; its radius including the hour marks is 1.
std::vector<client::Part> RingParts() {
  std::vector<client::Part> parts;
  parts.push_back({.shape = client::Torus{.radius = kRing, .tube_radius = kTube},
                   .color = {40, 90, 200},
                   .transform = {},
                   .color_scale = {}});
  for (int hour = 0; hour < 12; ++hour) {
    const double angle = hour * std::numbers::pi / 6;
    const double radius = hour == 0 ? 0.12 : hour % 3 == 0 ? 0.08 : 0.05;
    parts.push_back(
        {.shape = client::Sphere{.center = {kRing * std::cos(angle), kRing * std::sin(angle), 0},
                                 .radius = radius,
                                 .fill = client::Fill::kSolid},
         .color = hour == 0 ? client::Color{255, 70, 50} : client::Color{90, 190, 255},
         .transform = {},
         .color_scale = {}});
  }
  return parts;
}

class ClockScene final : public Scene {
 public:
  explicit ClockScene(const DisplaySpace& space)
      : space_(space), radius_(FitRadius(space, kHigh)) {}

  absl::Status Begin(Stage& stage) override {
    absl::Status status = stage.Define("ring", RingParts());
    if (!status.ok()) return status;
    client::Frame frame = stage.layer().BeginFrame();
    shown_ = TextNow();
    frame.Draw("time", Time(shown_), TextLook());
    frame.Draw("ring", client::Instance{stage.ObjectName("ring")}, {.transform = RingPose(0)});
    status = frame.End();
    return status.ok() ? Move(stage, 0) : status;
  }

  absl::Status Move(Stage& stage, double seconds) override {
    if (std::string now = TextNow(); now != shown_) {
      shown_ = std::move(now);
      const absl::Status status = stage.layer().Put("time", Time(shown_), TextLook()).status();
      if (!status.ok()) return status;
    }
    return stage.layer().SetTransform("ring", RingPose(seconds));
  }

 private:
  static client::Text Time(const std::string& text) {
    return {.text = text,
            .height = kLetters,
            .position = {0, 0, 0.06},
            .facing = {0, -1, 0},
            .up = client::Vec3{0, 0, 1},
            .alignment = client::Text::Alignment::kCenter,
            .line_spacing = kLine / kLetters / 1.6,
            .depth = 0.06};
  }

  client::Look TextLook() const {
    return {.color = {255, 235, 190},
            .transform =
                client::Affine::Translate({space_.center.x, space_.center.y, space_.center.z}) *
                client::Affine::Scale(radius_)};
  }

  client::Affine RingPose(double seconds) const {
    return PoseAt({.turn_s = 20, .tilt_degrees = kRingTilt}, space_, seconds) *
           client::Affine::Scale(radius_);
  }

  const DisplaySpace space_;
  const double radius_;
  std::string shown_;
};

}  // namespace

std::string ClockText(const std::tm& time) {
  return absl::StrFormat("%02d:%02d\n%02d", time.tm_hour, time.tm_min, time.tm_sec);
}

absl::StatusOr<std::unique_ptr<Scene>> MakeClock(const SceneSettings& settings) {
  return std::make_unique<ClockScene>(settings.space);
}

}  // namespace voxeld::voxelctl
