// The calls that voxelctl makes. This folder alone knows gRPC; its headers do not.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/connection/raw_stream.h"
#include "tools/voxelctl/connection/scene_session.h"
#include "tools/voxelctl/process/interrupt.h"
#include "voxeld/assets.h"
#include "voxeld/credentials.h"
#include "voxeld/v1/display.pb.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::voxelctl {

// One channel. Calls block until their answer, a deadline of seconds, or an interrupt: then
// Cancelled. Statuses are the server's, their messages made fit for a terminal; Unavailable names
// the address and what to do about it. Thread-safe.
class Connection {
 public:
  // `interrupt` must outlive it. Unavailable if the server does not answer in time.
  // Statuses of the credentials' files are as they are.
  static absl::StatusOr<std::unique_ptr<Connection>> Connect(const std::string& address,
                                                             const client::Credentials& credentials,
                                                             Interrupt& interrupt);
  ~Connection();
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  absl::StatusOr<v1::ListDisplaysResponse> ListDisplays();
  absl::StatusOr<v1::DisplayDescription> UpdateDisplay(const v1::UpdateDisplayRequest& request);
  // All pages in one answer, or the first alone, which has all layers.
  absl::StatusOr<v1::ListEntitiesResponse> ListEntities(v1::ListEntitiesRequest request,
                                                        bool first_page_only = false);
  // DeadlineExceeded if it takes longer than `limit`, or without one as long as a drawing may take.
  absl::StatusOr<v1::ExplainEntityResponse> ExplainEntity(
      const v1::ExplainEntityRequest& request,
      std::optional<std::chrono::milliseconds> limit = std::nullopt);
  absl::StatusOr<v1::ClearLayerResponse> ClearLayer(const v1::ClearLayerRequest& request);
  absl::StatusOr<v1::ListAssetsResponse> ListAssets();
  absl::StatusOr<v1::ListOwnersResponse> ListOwners();
  // `progress` as of client::UploadOptions; what breaks off goes on.
  absl::StatusOr<client::Asset> UploadAsset(
      absl::string_view bytes, std::function<bool(uint64_t stored, uint64_t size)> progress);
  absl::StatusOr<v1::ApplyUpdateResponse> ApplyUpdate(const v1::ApplyUpdateRequest& request);

  // Calls `each` with every answer until that returns false, or the stream ends.
  absl::Status WatchStats(const v1::WatchStatsRequest& request,
                          const std::function<bool(const v1::Stats&)>& each);
  absl::Status WatchScene(const v1::WatchSceneRequest& request,
                          const std::function<bool(const v1::WatchSceneResponse&)>& each);
  absl::Status CaptureVolume(const v1::CaptureVolumeRequest& request,
                             const std::function<absl::Status(const v1::VolumeChunk&)>& each);

  // A stream of the wire's own requests, over this connection.
  absl::StatusOr<std::unique_ptr<RawStream>> OpenRawStream(v1::Open open);

  // A session with this server, over a connection of its own.
  absl::StatusOr<std::unique_ptr<SceneSession>> OpenSession(client::Options options);
  // The client's own, which opens a lost connection again; it begins to connect. For commands that stay.
  absl::StatusOr<std::unique_ptr<client::Session>> OpenLastingSession(client::Options options);

 private:
  class Impl;
  explicit Connection(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

// Makes the connection when it is needed.
using Connector = std::function<absl::StatusOr<std::unique_ptr<Connection>>()>;

}  // namespace voxeld::voxelctl
