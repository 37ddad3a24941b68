#include "tools/voxelctl/record/playback.h"

#include <cmath>
#include <filesystem>
#include <utility>

#include "common/text/printable.h"

namespace voxeld::voxelctl {

namespace {

constexpr size_t kMostNameBytes = 80;

}  // namespace

std::string RecordingName(const std::string& file) {
  std::string name = EscapeForTerminal(std::filesystem::path(file).stem().string());
  if (name.size() <= kMostNameBytes) return name;
  size_t end = kMostNameBytes;
  while (end > 0 && (name[end] & 0xc0) == 0x80) --end;
  name.resize(end);
  return name;
}

absl::StatusOr<std::unique_ptr<Playback>> Playback::Begin(const Options& options,
                                                          Connection& connection) {
  v1::Open open;
  open.set_client_name(options.client_name);
  open.set_on_disconnect(options.keep ? v1::DISCONNECT_POLICY_KEEP : v1::DISCONNECT_POLICY_CLEAR);
  absl::StatusOr<std::unique_ptr<RawStream>> stream = connection.OpenRawStream(std::move(open));
  if (!stream.ok()) return stream.status();
  std::unique_ptr<Playback> playback(new Playback(options, connection));
  const sync::MutexLock lock(playback->mutex_);
  playback->stream_ = *std::move(stream);
  return playback;
}

void Playback::Skip(const v1::WatchSceneResponse& changes) {
  const sync::MutexLock lock(mutex_);
  scene_.Skip(changes);
  skipped_ = true;
}

uint32_t Playback::Faded(uint32_t own) const {
  return static_cast<uint32_t>(std::lround(own * opacity_));
}

absl::StatusOr<uint64_t> Playback::Put(const v1::WatchSceneResponse& changes) {
  const sync::MutexLock lock(mutex_);
  std::vector<v1::StreamRequest> requests;
  if (std::exchange(skipped_, false)) {
    scene_.Skip(changes);
    requests = scene_.Whole();
  } else {
    requests = scene_.Step(changes);
  }
  for (v1::StreamRequest& request : requests) {
    if (request.has_layer_state() && request.layer_state().has_opacity()) {
      v1::LayerState* state = request.mutable_layer_state();
      own_opacity_[state->layer()] = state->opacity();
      state->set_opacity(Faded(state->opacity()));
    }
    if (absl::Status status = stream_->Send(request); !status.ok()) return status;
  }
  const absl::StatusOr<v1::Accepted> accepted = stream_->Commit();
  if (!accepted.ok()) return accepted.status();
  // These layers are empty now, and are created again if they reappear.
  for (const std::string& layer : scene_.TakeEmptied()) {
    own_opacity_.erase(layer);
    v1::ClearLayerRequest clear;
    clear.set_owner(stream_->owner());
    clear.set_layer(layer);
    if (absl::Status status = connection_.ClearLayer(clear).status(); !status.ok()) return status;
  }
  return accepted->snapshot();
}

absl::Status Playback::SetOpacity(double opacity) {
  const sync::MutexLock lock(mutex_);
  opacity_ = opacity;
  for (const auto& [layer, own] : own_opacity_) {
    v1::StreamRequest request;
    request.mutable_layer_state()->set_layer(layer);
    request.mutable_layer_state()->set_opacity(Faded(own));
    if (absl::Status status = stream_->Send(request); !status.ok()) return status;
  }
  if (own_opacity_.empty()) return absl::OkStatus();
  return stream_->Commit().status();
}

uint64_t Playback::owner() const {
  const sync::MutexLock lock(mutex_);
  return stream_->owner();
}

std::vector<v1::Issue> Playback::TakeIssues() {
  const sync::MutexLock lock(mutex_);
  return stream_->TakeIssues();
}

absl::Status Playback::End() {
  const sync::MutexLock lock(mutex_);
  return stream_->Close();
}

}  // namespace voxeld::voxelctl
