// glTF's animations: every property of every node has its own keys.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/text/printable.h"
#include "tools/import/gltf_model.h"

namespace voxeld::voxelctl {
namespace {

void Normalize(std::vector<double>* turn) {
  double length = 0;
  for (const double v : *turn) length += v * v;
  if (!(length > 0)) return;
  for (double& v : *turn) v /= std::sqrt(length);
}

// Interpolates along the shorter arc between two rotations.
std::vector<double> Slerp(const double* from, const double* to, double share) {
  double dot = 0;
  for (size_t i = 0; i < 4; ++i) dot += from[i] * to[i];
  const double sign = dot < 0 ? -1 : 1;
  dot = std::min(std::abs(dot), 1.0);
  const double angle = std::acos(dot), sine = std::sin(angle);
  const double a = sine < 1e-6 ? 1 - share : std::sin((1 - share) * angle) / sine;
  const double b = sign * (sine < 1e-6 ? share : std::sin(share * angle) / sine);
  std::vector<double> turn(4);
  for (size_t i = 0; i < 4; ++i) turn[i] = a * from[i] + b * to[i];
  return turn;
}

std::vector<double> ValueAt(const GltfChannel& channel, double time) {
  const size_t width = channel.width;
  const bool cubic = channel.interpolation == GltfInterpolation::kCubicSpline;
  // Part 0 is the in-tangent, 1 the value, 2 the out-tangent.
  const auto at = [&](size_t key, size_t part) {
    return channel.values.data() + (cubic ? key * 3 + part : key) * width;
  };
  const auto after = std::upper_bound(channel.times.begin(), channel.times.end(), time);
  const auto next = static_cast<size_t>(after - channel.times.begin());
  const size_t from = next == 0 ? 0 : next - 1;
  const bool between = next > 0 && next < channel.times.size();
  std::vector<double> value(at(from, 1), at(from, 1) + width);
  if (between && channel.interpolation != GltfInterpolation::kStep) {
    const double length = channel.times[next] - channel.times[from];
    const double t = (time - channel.times[from]) / length;
    if (cubic) {
      const double t2 = t * t, t3 = t2 * t;
      for (size_t i = 0; i < width; ++i) {
        value[i] = (2 * t3 - 3 * t2 + 1) * at(from, 1)[i] +
                   length * (t3 - 2 * t2 + t) * at(from, 2)[i] +
                   (3 * t2 - 2 * t3) * at(next, 1)[i] + length * (t3 - t2) * at(next, 0)[i];
      }
    } else if (channel.path == GltfPath::kRotation) {
      value = Slerp(at(from, 1), at(next, 1), t);
    } else {
      for (size_t i = 0; i < width; ++i) value[i] += t * (at(next, 1)[i] - value[i]);
    }
  }
  if (channel.path == GltfPath::kRotation) Normalize(&value);
  return value;
}

template <size_t kCount>
std::array<double, kCount> ArrayOf(const std::vector<double>& value) {
  std::array<double, kCount> array;
  std::copy_n(value.begin(), kCount, array.begin());
  return array;
}

class GltfFrames final : public FrameSource {
 public:
  explicit GltfFrames(SourceFile file) : file_(std::move(file)) {}

  absl::Status Load(size_t number, double fps) {
    absl::StatusOr<std::unique_ptr<GltfScene>> scene = GltfScene::Load(file_);
    if (!scene.ok()) return scene.status();
    scene_ = *std::move(scene);
    const std::vector<std::string> names = scene_->AnimationNames();
    if (number < 1 || number > names.size()) {
      std::vector<std::string> known;
      known.reserve(names.size());
      for (const std::string& name : names) {
        known.push_back(
            absl::StrCat(known.size() + 1, name.empty() ? "" : " ", EscapeForTerminal(name)));
      }
      return FileError(file_, absl::StrCat("has no animation ", number),
                       known.empty() ? "it has none at all"
                                     : absl::StrCat("it has ", absl::StrJoin(known, ", ")));
    }
    absl::StatusOr<std::vector<GltfChannel>> channels = scene_->ChannelsOf(number - 1, &left_out_);
    if (!channels.ok()) return channels.status();
    channels_ = *std::move(channels);
    double seconds = 0;
    for (const GltfChannel& channel : channels_) seconds = std::max(seconds, channel.times.back());
    if (!(seconds * fps <= static_cast<double>(kMaxFrames))) {
      return FileError(
          file_, absl::StrCat("has an animation of ", seconds, " s"),
          absl::StrCat("at most ", static_cast<double>(kMaxFrames) / fps, " are played"));
    }
    fps_ = fps;
    count_ = std::max<int64_t>(1, std::llround(seconds * fps));
    return absl::OkStatus();
  }

  int64_t count() const override { return count_; }

  absl::StatusOr<Model> Read(int64_t frame) override {
    const double time = static_cast<double>(frame) / fps_;
    GltfPose pose;
    for (const GltfChannel& channel : channels_) {
      std::vector<double> value = ValueAt(channel, time);
      switch (channel.path) {
        case GltfPath::kTranslation:
          pose.translations[channel.node] = ArrayOf<3>(value);
          break;
        case GltfPath::kRotation:
          pose.rotations[channel.node] = ArrayOf<4>(value);
          break;
        case GltfPath::kScale:
          pose.scales[channel.node] = ArrayOf<3>(value);
          break;
        case GltfPath::kWeights:
          pose.weights[channel.node] = std::move(value);
      }
    }
    absl::StatusOr<Model> model = scene_->ModelAt(&pose, true);
    if (!model.ok()) return model;
    for (const LeftOut& one : left_out_.left_out) AddLeftOut(one.kind, one.count, &*model);
    return model;
  }

 private:
  const SourceFile file_;
  std::unique_ptr<GltfScene> scene_;
  std::vector<GltfChannel> channels_;
  Model left_out_;  // parts of the animation
  double fps_ = 1;
  int64_t count_ = 1;
};

}  // namespace

absl::StatusOr<std::unique_ptr<FrameSource>> OpenGltfAnimation(SourceFile file, size_t number,
                                                               double fps) {
  auto frames = std::make_unique<GltfFrames>(std::move(file));
  if (absl::Status status = frames->Load(number, fps); !status.ok()) return status;
  return frames;
}

}  // namespace voxeld::voxelctl
