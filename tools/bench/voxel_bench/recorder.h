// Runs voxelctl record beside a daemon that is measured.
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "absl/status/statusor.h"
#include "tools/child/child_process.h"

namespace voxeld::bench {

// Records into its own folder until Stop() or destruction. Bound to one thread.
class Recorder {
 public:
  // Starts the voxelctl beside this program. It records throughout the round that is not counted.
  static absl::StatusOr<std::unique_ptr<Recorder>> Start(const std::string& address);

  // Stops the recording. Returns its final report: change sets, bytes and the like.
  absl::StatusOr<nlohmann::json> Stop();

 private:
  explicit Recorder(child::TemporaryFolder folder) : folder_(std::move(folder)) {}

  child::TemporaryFolder folder_;
  std::unique_ptr<child::ChildProcess> process_;
};

}  // namespace voxeld::bench
