// Draws scenes exactly as sent, voxel by voxel, and compares what displays show with them. Runs
// beside the displays' own engines: on the CPU, on one low-priority thread, one task at a time, at
// most half of the time.
#pragma once

#include <atomic>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/statusor.h"
#include "daemon/core/budget.h"
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
    std::shared_ptr<const display::DisplayInfo> info;  // of the display
    ShownScene shown;
    std::vector<OwnedName> hidden;  // layers that are not drawn
    // Called once on the comparer's thread; with Cancelled if the comparer is destroyed first. It
    // must only post.
    std::function<void(absl::StatusOr<Comparison>)> done;
  };

  // The scene of a display is dropped if it is not compared for this long.
  static constexpr sync::TimeNs kLinger = 5 * sync::kSecond;
  // Maximum number of queued tasks. After a task the thread rests for at most as long as the task
  // took.
  static constexpr size_t kMostTasks = 8;
  static constexpr sync::TimeNs kMostRest = 2 * sync::kSecond;

  // `budget` is charged for what a comparison holds; it must outlive the comparer and may be null.
  Comparer(sync::Clock& clock, std::shared_ptr<Budget> budget);
  ~Comparer();  // aborts a running comparison
  Comparer(const Comparer&) = delete;
  Comparer& operator=(const Comparer&) = delete;

  // Queues the task; beyond kMostTasks it gets ResourceExhausted at once.
  void Post(Task task);

 private:
  class Reference;
  using References = std::map<std::string, Reference>;  // by display

  void Run();
  absl::StatusOr<Comparison> Serve(const Task& task, References& references) const;
  absl::StatusOr<Comparison> Hold(const Task& task, Reference& reference) const;

  sync::Clock& clock_;
  const std::shared_ptr<Budget> budget_;
  sync::Mutex mutex_;
  sync::CondVar wake_;
  std::deque<Task> tasks_ VOXELD_GUARDED_BY(mutex_);
  std::atomic<bool> ends_ = false;
  std::thread thread_;  // started by the first task
};

}  // namespace voxeld::daemon::viewer
