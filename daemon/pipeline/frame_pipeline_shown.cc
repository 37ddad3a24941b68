// FramePipeline for those who hold what is shown against what was sent.
#include <utility>

#include "daemon/pipeline/frame_pipeline.h"

namespace voxeld::daemon {
namespace {

constexpr size_t kMostScenes = 8;  // volumes on their way are fewer

}  // namespace

absl::StatusOr<ShownScene> FramePipeline::Shown() {
  if (!started_) return absl::UnavailableError(WhyNotShowing());
  keep_scenes_until_ = clock_.Now() + kScenesLinger;
  if (!watched_.has_value()) {
    return watching_ ? absl::UnavailableError("nothing has been shown yet")
                     : absl::FailedPreconditionError("nobody watches the display");
  }
  const auto kept = scenes_.find(watched_->volume);
  if (kept != scenes_.end()) return ShownScene{*watched_, kept->second};
  // What the engine holds is what the newest volume was drawn from, unless another is being drawn.
  const bool newest = watched_->volume == last_submitted_ && !drawing_.has_value();
  if (!newest || scene_->held() == nullptr) {
    return absl::UnavailableError("what the volume was drawn from is not known any more");
  }
  KeepScene(last_submitted_);
  return ShownScene{*watched_, scenes_[last_submitted_]};
}

void FramePipeline::KeepScene(uint64_t volume) {
  if (clock_.Now() >= keep_scenes_until_ || scene_->held() == nullptr) return;
  DrawnFrom& from = scenes_[volume];
  Retire(std::exchange(from.scene, scene_->held()));
  from.scene_to_voxel = target_.view;
  from.tone = target_.tone;
  const uint64_t told = watched_.has_value() ? watched_->volume : 0;
  while (scenes_.begin()->first < told || scenes_.size() > kMostScenes) {
    Retire(std::move(scenes_.begin()->second.scene));
    scenes_.erase(scenes_.begin());
  }
}

sync::TimeNs FramePipeline::LetGoOfScenes() {
  if (scenes_.empty()) return sync::kNever;
  if (clock_.Now() < keep_scenes_until_) return keep_scenes_until_;
  for (auto& [volume, from] : scenes_) Retire(std::move(from.scene));
  scenes_.clear();
  return sync::kNever;
}

}  // namespace voxeld::daemon
