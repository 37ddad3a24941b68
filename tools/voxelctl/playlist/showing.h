// One playing item of a playlist: a recording that plays on its own thread, with an adjustable
// opacity.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"
#include "tools/recording/mcap.h"
#include "tools/voxelctl/playlist/playlist.h"
#include "tools/voxelctl/record/playback.h"

namespace voxeld::voxelctl {

// Returns what is wrong with an item's file, or with the item for that file; such an item would be
// skipped.
absl::Status CheckPlayable(const PlaylistItem& item);

// Thread-safe.
class Showing {
 public:
  // Opens the file and plays it repeatedly on a separate thread, in sessions that begin with
  // `opacity`. `connection` and `clock` must outlive the object. Errors: what is wrong with the
  // file.
  static absl::StatusOr<std::unique_ptr<Showing>> Begin(const PlaylistItem& item, double opacity,
                                                        Connection& connection, sync::Clock& clock);
  ~Showing();  // removes what is shown
  Showing(const Showing&) = delete;
  Showing& operator=(const Showing&) = delete;

  absl::Status SetOpacity(double opacity);
  // Return how long it is to be shown, in seconds, and whether that is the recording's own length.
  double seconds() const { return seconds_; }
  bool of_its_own_length() const { return !item_.seconds.has_value(); }
  // Returns whether its first state is visible.
  bool up() const;
  // Returns whether it is a single state of the scene without changes.
  bool still() const { return still_; }
  // Returns whether none of its states contains an entity.
  bool empty() const { return empty_; }
  // Returns why it has stopped playing; OK as long as it plays.
  absl::Status status() const;

 private:
  Showing(const PlaylistItem& item, double opacity, Connection& connection, sync::Clock& clock);
  void Run();
  absl::Status PlayOnce();
  bool AwaitOrStop(sync::TimeNs due);  // returns false if it is to stop

  const PlaylistItem item_;
  Connection& connection_;
  sync::Clock& clock_;
  std::unique_ptr<recording::McapReader> reader_;
  uint64_t start_ns_ = 0;
  double seconds_ = 0;
  bool still_ = false;
  bool empty_ = false;

  mutable sync::Mutex mutex_;
  sync::CondVar changed_;
  bool stop_ VOXELD_GUARDED_BY(mutex_) = false;
  double opacity_ VOXELD_GUARDED_BY(mutex_);
  std::shared_ptr<Playback> playback_ VOXELD_GUARDED_BY(mutex_);
  absl::Status status_ VOXELD_GUARDED_BY(mutex_);
  std::thread thread_;
};

}  // namespace voxeld::voxelctl
