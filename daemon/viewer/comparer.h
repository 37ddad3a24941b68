// Draws scenes as they were sent, voxel by voxel, and holds what displays show against them. Beside the displays' own engines:
// on the CPU, on one thread of little priority, one after the other, half of the time at the most.
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
    // On the comparer's thread, once; Cancelled when the comparer ends first. It must only post.
    std::function<void(absl::StatusOr<Comparison>)> done;
  };

  // A display that is not asked for as long as that has its scene let go.
  static constexpr sync::TimeNs kLinger = 5 * sync::kSecond;
  // Tasks that wait, and after one a rest as long as it took, at the most.
  static constexpr size_t kMostTasks = 8;
  static constexpr sync::TimeNs kMostRest = 2 * sync::kSecond;

  // `budget`: charged with what a comparison holds; outlives it. May be none.
  Comparer(sync::Clock& clock, std::shared_ptr<Budget> budget);
  ~Comparer();  // a comparison under way ends soon
  Comparer(const Comparer&) = delete;
  Comparer& operator=(const Comparer&) = delete;

  // ResourceExhausted, at once, to one more than kMostTasks.
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
  std::thread thread_;  // begun with the first task
};

}  // namespace voxeld::daemon::viewer
