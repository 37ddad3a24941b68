// A volume put together from the chunks of CaptureVolume.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "tools/voxelctl/render/volume.h"
#include "voxeld/v1/display.pb.h"

namespace voxeld::voxelctl {

// A header first, then slices in any order, each once or more. Not thread-safe.
class CapturedVolume {
 public:
  static constexpr uint64_t kMostBytes = uint64_t{4} << 30;

  // InvalidArgument if the chunk does not fit what came before.
  absl::Status Add(const v1::VolumeChunk& chunk);

  // All slices must have come; the geometry must fit them.
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
