// A recording of a scene. It contains the change sets as the daemon sends them
// (WatchSceneResponse), from which the scene can be restored bit for bit, and in addition a form
// that third-party viewers can show.
//
//   voxeld/scene    voxeld.v1.WatchSceneResponse, protobuf. The first change set is the whole scene
//   scene           foxglove.SceneUpdate, protobuf
//
// Times are Unix time in nanoseconds. All messages of a change set have the time of the last one.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "tools/recording/mcap.h"
#include "tools/recording/scene_mirror.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::recording {

inline constexpr char kSceneTopic[] = "voxeld/scene";
inline constexpr char kViewersTopic[] = "scene";

// Not thread-safe.
class SceneRecorder {
 public:
  // The maximum loss if the writer crashes.
  static constexpr uint64_t kFlushNs = 500'000'000;

  static absl::StatusOr<std::unique_ptr<SceneRecorder>> Create(const std::string& path,
                                                               const std::string& version);

  // Adds the daemon's messages in their order. `time_ns` is the current time.
  absl::Status Add(const v1::WatchSceneResponse& message, uint64_t time_ns);
  // Syncs messages that have waited for kFlushNs to the disk. Call it about that often even if no
  // messages come.
  absl::Status Tick(uint64_t time_ns);
  absl::Status Close() { return writer_->Close(); }

  uint64_t change_sets() const { return change_sets_; }
  uint64_t bytes() const { return writer_->bytes(); }
  const SceneMirror& mirror() const { return mirror_; }

 private:
  explicit SceneRecorder(std::unique_ptr<McapWriter> writer);
  absl::Status Write(uint16_t channel, std::string_view data, uint64_t time_ns);

  const std::unique_ptr<McapWriter> writer_;
  uint16_t scene_, viewers_;
  SceneMirror mirror_;
  uint64_t change_sets_ = 0, since_ = 0;  // when the oldest unsynced one came; 0: none
  uint32_t sequence_ = 0;
};

// One state of the scene, and the changes that lead to it from the previous one.
struct ChangeSet {
  uint64_t time_ns = 0, snapshot = 0;
  v1::WatchSceneResponse changes;  // all of them in one message
};

// Calls `each` with the change sets in order until it returns false. Errors: DataLoss if the file
// is damaged; InvalidArgument if it has no scene.
absl::Status ReadScene(McapReader& reader, const std::function<bool(ChangeSet)>& each);

}  // namespace voxeld::recording
