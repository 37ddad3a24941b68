// A recording of a scene: change sets as the daemon tells them (WatchSceneResponse), from which the scene can
// be put up again bit for bit; beside them what other people's viewers show.
//
//   voxeld/scene    voxeld.v1.WatchSceneResponse, protobuf. The first change set is the whole scene
//   scene           foxglove.SceneUpdate, protobuf
//
// Times are Unix time in nanoseconds. A change set's messages have one time, that of the last.
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
  // What a crash of the writer loses at most.
  static constexpr uint64_t kFlushNs = 500'000'000;

  static absl::StatusOr<std::unique_ptr<SceneRecorder>> Create(const std::string& path,
                                                               const std::string& version);

  // One after another, as the daemon tells them. `time_ns`: now.
  absl::Status Add(const v1::WatchSceneResponse& message, uint64_t time_ns);
  // Puts on the disk what has waited for kFlushNs; to be called about that often also when nothing comes.
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
  uint64_t change_sets_ = 0, since_ = 0;  // when the oldest came that is not on the disk; 0: none
  uint32_t sequence_ = 0;
};

// One state of the scene and how to come to it from the one before.
struct ChangeSet {
  uint64_t time_ns = 0, snapshot = 0;
  v1::WatchSceneResponse changes;  // all of them in one message
};

// Calls `each` with the change sets, in their order, until it answers false. DataLoss for what is damaged,
// InvalidArgument for a file without a scene.
absl::Status ReadScene(McapReader& reader, const std::function<bool(ChangeSet)>& each);

}  // namespace voxeld::recording
