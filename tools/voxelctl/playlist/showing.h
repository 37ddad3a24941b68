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

// Thread-safe.
class Showing {
 public:
  // Opens a session, whose `opacity` is the first; plays from now on, on a thread of its own, over and over. DataLoss and the
  // like of the file; of the connection what the server said. `connection` and `clock` outlive it.
  static absl::StatusOr<std::unique_ptr<Showing>> Begin(const PlaylistItem& item, double opacity,
                                                        Connection& connection, sync::Clock& clock);
  ~Showing();  // what is up goes
  Showing(const Showing&) = delete;
  Showing& operator=(const Showing&) = delete;

  absl::Status SetOpacity(double opacity);
  // How long it is to be on, in seconds.
  double seconds() const { return seconds_; }
  // A state of the scene, and nothing that changes.
  bool still() const { return still_; }
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

  mutable sync::Mutex mutex_;
  sync::CondVar changed_;
  bool stop_ VOXELD_GUARDED_BY(mutex_) = false;
  double opacity_ VOXELD_GUARDED_BY(mutex_);
  std::shared_ptr<Playback> playback_ VOXELD_GUARDED_BY(mutex_);
  absl::Status status_ VOXELD_GUARDED_BY(mutex_);
  std::thread thread_;
};

}  // namespace voxeld::voxelctl
