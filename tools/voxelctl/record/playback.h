// A recorded scene that is put up in a session of its own, change set by change set.
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

// What a recording is called in the scene: its file's name without folder and ending, not longer than fits into the
// names of sessions and layers; fit for a terminal.
std::string RecordingName(const std::string& file);

// Thread-safe. Statuses are the server's.
class Playback {
 public:
  struct Options {
    std::string client_name;
    std::string layer_prefix;  // of the names of its layers
    bool keep = false;         // what is up at the end stays
    double opacity = 1;
  };
  // `connection` outlives it.
  static absl::StatusOr<std::unique_ptr<Playback>> Begin(const Options& options,
                                                         Connection& connection);

  // Only remembers: the next Put leads to the whole scene.
  void Skip(const v1::WatchSceneResponse& changes);
  // In one commit; answers its snapshot.
  absl::StatusOr<uint64_t> Put(const v1::WatchSceneResponse& changes);
  // Of all that it has put up and will: each layer's own times `opacity`, from 0 to 1. In one commit.
  absl::Status SetOpacity(double opacity);
  // What the server said of what was put up since this was asked last.
  std::vector<v1::Issue> TakeIssues();
  // What is up goes, unless it is to stay.
  absl::Status End();
  uint64_t owner() const;  // whose layers they are

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
      VOXELD_GUARDED_BY(mutex_);  // by the layer's name here
  Connection& connection_;
};

}  // namespace voxeld::voxelctl
