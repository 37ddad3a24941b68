// One viewer's share of a display's volumes: the newest that it has not taken, and which slices differ from what it
// took last. Volumes that come while it is busy are passed over.
//
// A viewer that has not taken for kPatience while newer volumes came is taken to sleep: the feed lets go of all
// that it holds and stops watching, so that it costs nothing, and begins anew with the next Take.
// Thread-safe. The core outlives it.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "daemon/core/core.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon {

class VolumeFeed : public std::enable_shared_from_this<VolumeFeed> {
 public:
  static constexpr sync::TimeNs kPatience = sync::kSecond;

  struct Change {
    display::DecodedVolume volume;
    std::vector<int32_t>
        slices;          // that differ, ascending; of the first volume, and after a sleep, all
    bool whole = false;  // all of them are there
  };

  // `ready` is called once after each Take that found nothing, when there is something; from any thread, with no
  // lock held, and perhaps a last time while the feed is let go. It must only post.
  // The first call comes without a Take.
  static std::shared_ptr<VolumeFeed> Open(Core& core, sync::Clock& clock, std::string display,
                                          std::function<void()> ready);
  ~VolumeFeed();
  VolumeFeed(const VolumeFeed&) = delete;
  VolumeFeed& operator=(const VolumeFeed&) = delete;

  // One thread at a time. Nothing: there is none yet. An error is the end: the display is not there, or has stopped.
  absl::StatusOr<std::optional<Change>> Take();

  bool asleep() const;

 private:
  VolumeFeed(Core& core, sync::Clock& clock, std::string display, std::function<void()> ready)
      : core_(core), clock_(clock), display_(std::move(display)), ready_(std::move(ready)) {}

  void Begin();
  void OnVolume(const absl::StatusOr<display::DecodedVolume>& volume, uint64_t watch);

  Core& core_;
  sync::Clock& clock_;
  const std::string display_;
  const std::function<void()> ready_;

  mutable sync::Mutex mutex_;
  uint64_t begun_ VOXELD_GUARDED_BY(mutex_) =
      0;  // watches, counted: an old one's last word is no news
  WatchId watch_ VOXELD_GUARDED_BY(mutex_) = 0;  // 0: asleep, or over
  bool asleep_ VOXELD_GUARDED_BY(mutex_) = false;
  bool told_ VOXELD_GUARDED_BY(mutex_) =
      false;  // ready_ was called since the last Take that found nothing
  absl::Status end_ VOXELD_GUARDED_BY(mutex_);
  std::optional<display::DecodedVolume> newest_ VOXELD_GUARDED_BY(mutex_);
  sync::TimeNs waits_since_ VOXELD_GUARDED_BY(mutex_) = 0;
  std::vector<display::Picture> taken_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace voxeld::daemon
