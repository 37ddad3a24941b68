// SceneStream over gRPC.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "display/sync/clock.h"
#include "tools/voxelctl/connection/scene_stream.h"
#include "tools/voxelctl/process/interrupt.h"

namespace grpc {
class ChannelInterface;
}

namespace voxeld::voxelctl {

// Longer than a server waits for the outcomes that it still owes.
inline constexpr sync::TimeNs kCloseTime = 8 * sync::kSecond;

// Opens a stream and waits for Opened. `interrupt` must outlive it. `close_time`: how long Close
// waits for the server to end the stream.
absl::StatusOr<std::unique_ptr<SceneStream>> OpenGrpcSceneStream(
    std::shared_ptr<grpc::ChannelInterface> channel, const std::string& address,
    const v1::Open& open, Interrupt& interrupt, sync::TimeNs close_time = kCloseTime);

}  // namespace voxeld::voxelctl
