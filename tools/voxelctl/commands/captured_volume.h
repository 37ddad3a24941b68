// Assembles a volume from the chunks of CaptureVolume.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "tools/voxelctl/render/volume.h"
#include "voxeld/v1/display.pb.h"

namespace voxeld::voxelctl {

// Accepts a header first, then slices in any order, each once or more. Not thread-safe.
class CapturedVolume {
 public:
  static constexpr uint64_t kMostBytes = uint64_t{4} << 30;

  // Errors: InvalidArgument if the chunk does not fit the earlier ones.
  absl::Status Add(const v1::VolumeChunk& chunk);

  // Requires: all slices were added, and the geometry fits them.
  absl::StatusOr<Volume> Finish() &&;

  const v1::VolumeHeader& header() const { return header_; }

 private:
  absl::Status Begin(const v1::VolumeHeader& header);

  bool begun_ = false;
  v1::VolumeHeader header_;
  Volume volume_;
  std::vector<bool> come_;
};

}  // namespace voxeld::voxelctl
