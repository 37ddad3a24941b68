// SceneStream over gRPC.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "tools/voxelctl/connection/scene_stream.h"
#include "tools/voxelctl/process/interrupt.h"

namespace grpc {
class ChannelInterface;
}

namespace voxeld::voxelctl {

// Opens a stream and waits for Opened. `interrupt` must outlive it.
absl::StatusOr<std::unique_ptr<SceneStream>> OpenGrpcSceneStream(
    std::shared_ptr<grpc::ChannelInterface> channel, const std::string& address,
    const v1::Open& open, Interrupt& interrupt);

}  // namespace voxeld::voxelctl
