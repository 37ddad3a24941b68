// Draws scenes as they were sent, voxel by voxel, and holds what displays show against them. Beside the displays' own engines:
// on the CPU, on one thread of little priority, one after the other.
#pragma once

#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/statusor.h"
#include "daemon/pipeline/shown_scene.h"
#include "daemon/viewer/comparison.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::viewer {

// Thread-safe.
class Comparer {
 public:
  struct Task {
    std::string display;
    display::VoxelGrid grid;
    display::FrameLayout layout;
    Reach reach;
    DrawnFrom from;
    std::vector<OwnedName> hidden;  // layers that are not drawn
    PlaceBox box;                   // of `shown`
    Points shown;                   // what the display shows
    // On the comparer's thread, once; Cancelled when the comparer ends first. It must only post.
    std::function<void(absl::StatusOr<Comparison>)> done;
  };

  // A display that is not asked for as long as that has its scene let go.
  static constexpr sync::TimeNs kLinger = 5 * sync::kSecond;

  explicit Comparer(sync::Clock& clock);
  ~Comparer();
  Comparer(const Comparer&) = delete;
  Comparer& operator=(const Comparer&) = delete;

  void Post(Task task);

 private:
  class Reference;
  using References = std::map<std::string, Reference>;  // by display

  void Run();
  absl::StatusOr<Comparison> Serve(const Task& task, References& references) const;

  sync::Clock& clock_;
  sync::Mutex mutex_;
  sync::CondVar wake_;
  std::deque<Task> tasks_ VOXELD_GUARDED_BY(mutex_);
  bool ends_ VOXELD_GUARDED_BY(mutex_) = false;
  std::thread thread_;  // begun with the first task
};

}  // namespace voxeld::daemon::viewer
