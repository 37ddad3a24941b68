// Encodes a watch of the scene as messages: the difference from what its client has received, in
// pieces.
//
//   WatchMessages messages(filter);
//   messages.Begin(snapshot);                      // from the last one (or nothing) to this one
//   while (!messages.in_sync()) { messages.Next(&message); … }
//
// It holds two snapshots during a change set and one otherwise, and no message.
//
// Single-threaded.
#pragma once

#include <cstddef>
#include <optional>

#include "absl/status/status.h"
#include "daemon/scene/scene_changes.h"

namespace voxeld::v1 {
class WatchSceneRequest;
class WatchSceneResponse;
}  // namespace voxeld::v1

namespace voxeld::daemon::wire {

class WatchMessages {
 public:
  // A message ends with the change that makes it reach this size. It is therefore at most this
  // large, plus one entity or object.
  static constexpr size_t kMessageBytes = size_t{128} << 10;

  explicit WatchMessages(const v1::WatchSceneRequest& request,
                         size_t message_bytes = kMessageBytes);

  // Returns: the number of the snapshot that was sent completely; 0: none.
  uint64_t told() const { return told_ == nullptr ? 0 : told_->number; }
  bool in_sync() const { return !changes_.has_value(); }

  // Begins the change set that leads to `target`. Requires: in_sync().
  void Begin(SnapshotPtr target);

  // Writes the next message of the change set to `out`; the last one sets in_sync. Requires:
  // !in_sync(). Errors: FailedPrecondition for content that no message can hold, which ends the
  // watch.
  absl::Status Next(v1::WatchSceneResponse* out);

  // Releases its snapshots to the caller at the end of the watch.
  void LetGo(SnapshotPtr* told, SnapshotPtr* target) {
    changes_.reset();
    told_.swap(*told);
    target_.swap(*target);
  }

 private:
  const bool contents_;
  const size_t message_bytes_;
  const SceneFilter filter_;
  SnapshotPtr told_, target_;
  std::optional<SceneChanges> changes_;
};

}  // namespace voxeld::daemon::wire
