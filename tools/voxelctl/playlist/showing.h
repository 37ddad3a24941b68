// One item of a playlist on its way: a recording that plays by itself, as bright as it is told.
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

// What is wrong with an item's file, or with its item for such a file: what would have it passed over.
absl::Status CheckPlayable(const PlaylistItem& item);

// Thread-safe.
class Showing {
 public:
  // Opens the file, and plays it from now on, on a thread of its own, over and over, in sessions whose `opacity` is the first. What
  // is wrong with the file. `connection` and `clock` outlive it.
  static absl::StatusOr<std::unique_ptr<Showing>> Begin(const PlaylistItem& item, double opacity,
                                                        Connection& connection, sync::Clock& clock);
  ~Showing();  // what is up goes
  Showing(const Showing&) = delete;
  Showing& operator=(const Showing&) = delete;

  absl::Status SetOpacity(double opacity);
  // How long it is to be on, in seconds; and whether that is as long as the recording itself is.
  double seconds() const { return seconds_; }
  bool of_its_own_length() const { return !item_.seconds.has_value(); }
  // Its first state is to be seen.
  bool up() const;
  // A state of the scene, and nothing that changes.
  bool still() const { return still_; }
  // No entity is in any of its states.
  bool empty() const { return empty_; }
  // Why it does not play any more; OK: it does.
  absl::Status status() const;

 private:
  Showing(const PlaylistItem& item, double opacity, Connection& connection, sync::Clock& clock);
  void Run();
  absl::Status PlayOnce();
  bool AwaitOrStop(sync::TimeNs due);  // false: it is to stop

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
