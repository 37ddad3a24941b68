// Plays a recorded scene in a session of its own, change set by change set.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "display/sync/mutex.h"
#include "tools/recording/putting_up.h"
#include "tools/voxelctl/connection/connection.h"
#include "tools/voxelctl/connection/raw_stream.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::voxelctl {

// Returns a recording's name in the scene: its file's name without folder and extension, short
// enough for names of sessions and layers, and escaped for a terminal.
std::string RecordingName(const std::string& file);

// Thread-safe. Statuses are the server's.
class Playback {
 public:
  struct Options {
    std::string client_name;
    std::string layer_prefix;  // prefix of its layers' names
    bool keep = false;         // keeps the final state in the scene
    double opacity = 1;
  };
  // `connection` must outlive the object.
  static absl::StatusOr<std::unique_ptr<Playback>> Begin(const Options& options,
                                                         Connection& connection);

  // Records the changes only: the next Put then leads to the whole scene.
  void Skip(const v1::WatchSceneResponse& changes);
  // Commits the changes at once. Returns: the snapshot.
  absl::StatusOr<uint64_t> Put(const v1::WatchSceneResponse& changes);
  // Multiplies the opacity of all its present and future layers by `opacity`, from 0 to 1, in one
  // commit.
  absl::Status SetOpacity(double opacity);
  // Returns the server's issues since the previous call.
  std::vector<v1::Issue> TakeIssues();
  // Removes its contents unless they are to be kept.
  absl::Status End();
  uint64_t owner() const;  // the owner of its layers

 private:
  Playback(const Options& options, Connection& connection)
      : scene_(options.layer_prefix), opacity_(options.opacity), connection_(connection) {}
  uint32_t Faded(uint32_t own) const VOXELD_REQUIRES(mutex_);

  mutable sync::Mutex mutex_;
  std::unique_ptr<RawStream> stream_ VOXELD_GUARDED_BY(mutex_);
  recording::PuttingUp scene_ VOXELD_GUARDED_BY(mutex_);
  bool skipped_ VOXELD_GUARDED_BY(mutex_) = false;
  double opacity_ VOXELD_GUARDED_BY(mutex_);
  std::map<std::string, uint32_t> own_opacity_
      VOXELD_GUARDED_BY(mutex_);  // by the layer's name in the scene
  Connection& connection_;
};

}  // namespace voxeld::voxelctl
