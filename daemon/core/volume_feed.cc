#include "daemon/core/volume_feed.h"

#include <numeric>
#include <utility>

namespace voxeld::daemon {
namespace {

bool Same(const display::Picture& a, const display::Picture& b) { return a == b || *a == *b; }

}  // namespace

std::shared_ptr<VolumeFeed> VolumeFeed::Open(Core& core, sync::Clock& clock, std::string display,
                                             std::function<void()> ready) {
  std::shared_ptr<VolumeFeed> feed(
      new VolumeFeed(core, clock, std::move(display), std::move(ready)));
  feed->Begin();
  return feed;
}

VolumeFeed::~VolumeFeed() {
  sync::MutexLock lock(mutex_);
  if (watch_ != 0) core_.UnwatchVolumes(display_, watch_);
}

bool VolumeFeed::asleep() const {
  sync::MutexLock lock(mutex_);
  return asleep_;
}

void VolumeFeed::Begin() {
  uint64_t number = 0;
  {
    sync::MutexLock lock(mutex_);
    number = ++begun_;
    asleep_ = false;
  }
  const WatchId watch = core_.WatchVolumes(
      display_, [weak = weak_from_this(), number](const absl::StatusOr<display::DecodedVolume>& v) {
        if (const auto feed = weak.lock()) feed->OnVolume(v, number);
      });
  sync::MutexLock lock(mutex_);
  if (asleep_) return core_.UnwatchVolumes(display_, watch);
  watch_ = watch;
}

void VolumeFeed::OnVolume(const absl::StatusOr<display::DecodedVolume>& volume, uint64_t watch) {
  bool tell = false;
  {
    sync::MutexLock lock(mutex_);
    if (watch != begun_ || asleep_) return;
    const sync::TimeNs now = clock_.Now();
    if (!volume.ok()) {
      end_ = volume.status();
    } else if (newest_.has_value() && now - waits_since_ >= kPatience) {
      core_.UnwatchVolumes(display_, std::exchange(watch_, 0));
      newest_.reset();
      taken_.clear();
      asleep_ = true;
      core_.CountAsleep();
      return;
    } else {
      if (!newest_.has_value()) waits_since_ = now;
      newest_ = *volume;
    }
    tell = !std::exchange(told_, true);
  }
  if (tell) ready_();
}

absl::StatusOr<std::optional<VolumeFeed::Change>> VolumeFeed::Take() {
  Change change;
  std::vector<display::Picture> before;
  bool taken = false, begin = false;
  {
    sync::MutexLock lock(mutex_);
    if (newest_.has_value()) {
      taken = true;
      change.volume = *std::exchange(newest_, std::nullopt);
      before = std::exchange(taken_, change.volume.pictures);
    } else {
      if (!end_.ok()) return end_;
      told_ = false;
      begin = asleep_;
    }
  }
  if (begin) Begin();
  if (!taken) return std::nullopt;
  const std::vector<display::Picture>& pictures = change.volume.pictures;
  const auto each = static_cast<size_t>(change.volume.layout.sub_frames);
  change.whole = before.size() != pictures.size();
  for (int32_t slice = 0; slice < change.volume.layout.slices; ++slice) {
    const size_t first = static_cast<size_t>(slice) * each;
    bool differs = change.whole;
    for (size_t i = first; i < first + each && !differs; ++i) {
      differs = !Same(before[i], pictures[i]);
    }
    if (differs) change.slices.push_back(slice);
  }
  return change;
}

}  // namespace voxeld::daemon
