// A watch of the scene as messages: what differs from what its client has been told, in pieces.
//
//   WatchMessages messages(filter);
//   messages.Begin(snapshot);                      // to the whole of it, or from the last to this
//   while (!messages.in_sync()) { messages.Next(&message); … }
//
// It holds two snapshots while it tells of a change set, one in between, and no message.
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
  // A message ends with the first change that takes it to this size: so it is at most that, and one
  // entity or object.
  static constexpr size_t kMessageBytes = size_t{128} << 10;

  explicit WatchMessages(const v1::WatchSceneRequest& request,
                         size_t message_bytes = kMessageBytes);

  // Of what has been told, whole; 0: of none.
  uint64_t told() const { return told_ == nullptr ? 0 : told_->number; }
  bool in_sync() const { return !changes_.has_value(); }

  // Begins the change set that leads to `target`. Only when in sync.
  void Begin(SnapshotPtr target);

  // The next message of the change set, over whatever is in `out`; the last one says in_sync. Only
  // between Begin and that. FailedPrecondition, and the end of the watch, for contents that no
  // message can hold.
  absl::Status Next(v1::WatchSceneResponse* out);

  // Gives its snapshots away: the watch is over.
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
