// The calls that voxelctl makes. Only this folder uses gRPC; its headers do not expose it.
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

// One channel. Calls block until their response, a deadline of seconds, or an interrupt
// (Cancelled). Statuses are the server's, with messages escaped for a terminal; Unavailable names
// the address and a remedy. Thread-safe.
class Connection {
 public:
  // Connects to the server. `interrupt` must outlive the connection. Errors: Unavailable if the
  // server does not answer in time; errors of the credentials' files are passed on.
  static absl::StatusOr<std::unique_ptr<Connection>> Connect(const std::string& address,
                                                             const client::Credentials& credentials,
                                                             Interrupt& interrupt);
  ~Connection();
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  absl::StatusOr<v1::ListDisplaysResponse> ListDisplays();
  absl::StatusOr<v1::DisplayDescription> UpdateDisplay(const v1::UpdateDisplayRequest& request);
  // Returns all pages as one response, or only the first, which has all layers.
  absl::StatusOr<v1::ListEntitiesResponse> ListEntities(v1::ListEntitiesRequest request,
                                                        bool first_page_only = false);
  // Errors: DeadlineExceeded if it takes longer than `limit`; without a limit, longer than a
  // drawing may take.
  absl::StatusOr<v1::ExplainEntityResponse> ExplainEntity(
      const v1::ExplainEntityRequest& request,
      std::optional<std::chrono::milliseconds> limit = std::nullopt);
  absl::StatusOr<v1::ClearLayerResponse> ClearLayer(const v1::ClearLayerRequest& request);
  absl::StatusOr<v1::ListAssetsResponse> ListAssets();
  absl::StatusOr<v1::ListOwnersResponse> ListOwners();
  // `progress` as in client::UploadOptions; an interrupted upload is resumed.
  absl::StatusOr<client::Asset> UploadAsset(
      absl::string_view bytes, std::function<bool(uint64_t stored, uint64_t size)> progress);
  absl::StatusOr<v1::ApplyUpdateResponse> ApplyUpdate(const v1::ApplyUpdateRequest& request);

  // Calls `each` with every response until it returns false, or the stream ends.
  absl::Status WatchStats(const v1::WatchStatsRequest& request,
                          const std::function<bool(const v1::Stats&)>& each);
  absl::Status WatchScene(const v1::WatchSceneRequest& request,
                          const std::function<bool(const v1::WatchSceneResponse&)>& each);
  absl::Status CaptureVolume(const v1::CaptureVolumeRequest& request,
                             const std::function<absl::Status(const v1::VolumeChunk&)>& each);

  // Opens a stream of raw requests over this connection.
  absl::StatusOr<std::unique_ptr<RawStream>> OpenRawStream(v1::Open open);

  // Opens a session with this server over a separate connection.
  absl::StatusOr<std::unique_ptr<SceneSession>> OpenSession(client::Options options);
  // Returns the client's own session, which reconnects; it is still connecting on return. For
  // commands that run for a long time.
  absl::StatusOr<std::unique_ptr<client::Session>> OpenLastingSession(client::Options options);

 private:
  class Impl;
  explicit Connection(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

// Makes the connection when it is needed.
using Connector = std::function<absl::StatusOr<std::unique_ptr<Connection>>()>;

}  // namespace voxeld::voxelctl
