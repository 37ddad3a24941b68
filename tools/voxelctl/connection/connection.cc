#include "tools/voxelctl/connection/connection.h"

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>
#include <grpcpp/support/channel_arguments.h>

#include <chrono>
#include <set>
#include <utility>

#include "common/text/printable.h"
#include "display/sync/mutex.h"
#include "tools/voxelctl/connection/status.h"
#include "voxeld/channel.h"
#include "voxeld/v1/display.grpc.pb.h"
#include "voxeld/v1/scene.grpc.pb.h"

namespace voxeld::voxelctl {
namespace {

using std::chrono::milliseconds;
using std::chrono::system_clock;

constexpr milliseconds kConnectTime(5000);
constexpr milliseconds kConnectStep(100);
constexpr milliseconds kLastErrorTime(1000);
constexpr milliseconds kCallTime(15000);
constexpr milliseconds kDrawnTime(300000);   // for answers that require the server to draw
constexpr int kMostMessageBytes = 64 << 20;  // a slice of 16384² pixels must fit into one message

// Returns why the channel has no connection, in gRPC's words, which are only available through a
// call.
std::string LastError(const std::shared_ptr<grpc::Channel>& channel) {
  grpc::ClientContext context;
  context.set_deadline(system_clock::now() + kLastErrorTime);
  v1::ListDisplaysResponse response;
  return v1::DisplayService::NewStub(channel)
      ->ListDisplays(&context, v1::ListDisplaysRequest(), &response)
      .error_message();
}

}  // namespace

class Connection::Impl {
 public:
  Impl(std::string address, client::Credentials credentials, std::shared_ptr<grpc::Channel> channel,
       Interrupt& interrupt)
      : address_(std::move(address)),
        credentials_(std::move(credentials)),
        channel_(std::move(channel)),
        displays_(v1::DisplayService::NewStub(channel_)),
        scene_(v1::SceneService::NewStub(channel_)),
        interrupt_(interrupt),
        listener_(interrupt.AddListener([this] { CancelAll(); })) {}

  ~Impl() { interrupt_.RemoveListener(listener_); }

  // Makes one call with a context that an interrupt cancels.
  template <typename Call>
  absl::Status Invoke(milliseconds limit, Call call) {
    grpc::ClientContext context;
    if (limit > milliseconds::zero()) context.set_deadline(system_clock::now() + limit);
    {
      sync::MutexLock lock(mutex_);
      if (interrupt_.requested()) return absl::CancelledError("interrupted");
      active_.insert(&context);
    }
    const grpc::Status status = call(&context);
    {
      sync::MutexLock lock(mutex_);
      active_.erase(&context);
    }
    if (status.error_code() == grpc::StatusCode::CANCELLED && interrupt_.requested()) {
      return absl::CancelledError("interrupted");
    }
    return FromGrpc(status, address_);
  }

  template <typename Response, typename Call>
  absl::StatusOr<Response> Unary(Call call, milliseconds limit = kCallTime) {
    Response response;
    const absl::Status status =
        Invoke(limit, [&](grpc::ClientContext* context) { return call(context, &response); });
    if (!status.ok()) return status;
    return response;
  }

  // Calls `each` with every response until it returns false, or the stream ends.
  template <typename Response, typename Call>
  absl::Status Watch(milliseconds limit, const std::function<bool(const Response&)>& each,
                     Call call) {
    bool stopped = false;
    const absl::Status status = Invoke(limit, [&](grpc::ClientContext* context) {
      const auto reader = call(context);
      Response response;
      while (reader->Read(&response)) {
        if (each(response)) continue;
        stopped = true;
        context->TryCancel();
        break;
      }
      return reader->Finish();
    });
    return stopped ? absl::OkStatus() : status;
  }

  v1::DisplayService::Stub& displays() { return *displays_; }
  v1::SceneService::Stub& scene() { return *scene_; }
  const std::string& address() const { return address_; }
  const std::shared_ptr<grpc::Channel>& channel() const { return channel_; }
  const client::Credentials& credentials() const { return credentials_; }
  Interrupt& interrupt() { return interrupt_; }

 private:
  void CancelAll() {
    sync::MutexLock lock(mutex_);
    for (grpc::ClientContext* context : active_) context->TryCancel();
  }

  const std::string address_;
  const client::Credentials credentials_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::DisplayService::Stub> displays_;
  std::unique_ptr<v1::SceneService::Stub> scene_;
  Interrupt& interrupt_;
  sync::Mutex mutex_;
  std::set<grpc::ClientContext*> active_ VOXELD_GUARDED_BY(mutex_);
  const int listener_;
};

Connection::Connection(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Connection::~Connection() = default;

absl::StatusOr<std::unique_ptr<Connection>> Connection::Connect(
    const std::string& address, const client::Credentials& credentials, Interrupt& interrupt) {
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(kMostMessageBytes);
  // The server is local or nearby, so a configured web proxy must not be used.
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  absl::StatusOr<std::shared_ptr<grpc::Channel>> made =
      client::MakeChannel(address, credentials, arguments);
  if (!made.ok())
    return absl::Status(made.status().code(), EscapeForTerminal(made.status().message()));
  std::shared_ptr<grpc::Channel> channel = *std::move(made);
  const system_clock::time_point deadline = system_clock::now() + kConnectTime;
  for (grpc_connectivity_state state = channel->GetState(true); state != GRPC_CHANNEL_READY;
       state = channel->GetState(true)) {
    if (interrupt.requested()) return absl::CancelledError("interrupted");
    if (state == GRPC_CHANNEL_TRANSIENT_FAILURE || state == GRPC_CHANNEL_SHUTDOWN) {
      return Unreachable(address, WhyUnreachable(LastError(channel), address, credentials));
    }
    if (system_clock::now() >= deadline) return Unreachable(address, "no answer in 5 s");
    channel->WaitForStateChange(state, system_clock::now() + kConnectStep);
  }
  return std::unique_ptr<Connection>(
      new Connection(std::make_unique<Impl>(address, credentials, std::move(channel), interrupt)));
}

absl::StatusOr<v1::ListDisplaysResponse> Connection::ListDisplays() {
  return impl_->Unary<v1::ListDisplaysResponse>(
      [&](grpc::ClientContext* context, v1::ListDisplaysResponse* response) {
        return impl_->displays().ListDisplays(context, {}, response);
      });
}

absl::StatusOr<v1::DisplayDescription> Connection::UpdateDisplay(
    const v1::UpdateDisplayRequest& request) {
  return impl_->Unary<v1::DisplayDescription>(
      [&](grpc::ClientContext* context, v1::DisplayDescription* response) {
        return impl_->displays().UpdateDisplay(context, request, response);
      });
}

absl::StatusOr<v1::ListAssetsResponse> Connection::ListAssets() {
  return impl_->Unary<v1::ListAssetsResponse>(
      [&](grpc::ClientContext* context, v1::ListAssetsResponse* response) {
        return impl_->scene().ListAssets(context, {}, response);
      });
}

absl::StatusOr<v1::ListOwnersResponse> Connection::ListOwners() {
  return impl_->Unary<v1::ListOwnersResponse>(
      [&](grpc::ClientContext* context, v1::ListOwnersResponse* response) {
        return impl_->scene().ListOwners(context, {}, response);
      });
}

absl::StatusOr<client::Asset> Connection::UploadAsset(
    absl::string_view bytes, std::function<bool(uint64_t stored, uint64_t size)> progress) {
  const absl::StatusOr<client::Asset> asset =
      client::UploadAsset({bytes.data(), bytes.size()}, {.address = impl_->address(),
                                                         .credentials = impl_->credentials(),
                                                         .progress = std::move(progress)});
  if (asset.ok()) return asset;
  return absl::Status(asset.status().code(), EscapeForTerminal(asset.status().message()));
}

absl::StatusOr<v1::ListEntitiesResponse> Connection::ListEntities(v1::ListEntitiesRequest request,
                                                                  bool first_page_only) {
  v1::ListEntitiesResponse all;
  do {
    absl::StatusOr<v1::ListEntitiesResponse> page = impl_->Unary<v1::ListEntitiesResponse>(
        [&](grpc::ClientContext* context, v1::ListEntitiesResponse* response) {
          return impl_->scene().ListEntities(context, request, response);
        });
    if (!page.ok()) return page;
    all.MergeFrom(*page);
    all.set_next_page_token(page->next_page_token());
    request.set_page_token(page->next_page_token());
  } while (!first_page_only && !request.page_token().empty());
  return all;
}

absl::StatusOr<v1::ExplainEntityResponse> Connection::ExplainEntity(
    const v1::ExplainEntityRequest& request, std::optional<milliseconds> limit) {
  return impl_->Unary<v1::ExplainEntityResponse>(
      [&](grpc::ClientContext* context, v1::ExplainEntityResponse* response) {
        return impl_->scene().ExplainEntity(context, request, response);
      },
      limit.value_or(kDrawnTime));
}

absl::StatusOr<v1::ClearLayerResponse> Connection::ClearLayer(
    const v1::ClearLayerRequest& request) {
  return impl_->Unary<v1::ClearLayerResponse>(
      [&](grpc::ClientContext* context, v1::ClearLayerResponse* response) {
        return impl_->scene().ClearLayer(context, request, response);
      });
}

absl::StatusOr<v1::ApplyUpdateResponse> Connection::ApplyUpdate(
    const v1::ApplyUpdateRequest& request) {
  return impl_->Unary<v1::ApplyUpdateResponse>(
      [&](grpc::ClientContext* context, v1::ApplyUpdateResponse* response) {
        return impl_->scene().ApplyUpdate(context, request, response);
      });
}

absl::Status Connection::WatchStats(const v1::WatchStatsRequest& request,
                                    const std::function<bool(const v1::Stats&)>& each) {
  return impl_->Watch<v1::Stats>(
      request.once() ? kCallTime : milliseconds::zero(), each,
      [&](grpc::ClientContext* context) { return impl_->displays().WatchStats(context, request); });
}

absl::Status Connection::WatchScene(
    const v1::WatchSceneRequest& request,
    const std::function<bool(const v1::WatchSceneResponse&)>& each) {
  return impl_->Watch<v1::WatchSceneResponse>(
      milliseconds::zero(), each,
      [&](grpc::ClientContext* context) { return impl_->scene().WatchScene(context, request); });
}

absl::Status Connection::CaptureVolume(
    const v1::CaptureVolumeRequest& request,
    const std::function<absl::Status(const v1::VolumeChunk&)>& each) {
  absl::Status refused;
  // The server's own limit applies first; this one is for a server that hangs.
  const milliseconds limit = kCallTime + milliseconds(request.timeout_ns() / 1'000'000);
  absl::Status status = impl_->Invoke(limit, [&](grpc::ClientContext* context) {
    auto reader = impl_->displays().CaptureVolume(context, request);
    v1::VolumeChunk chunk;
    while (refused.ok() && reader->Read(&chunk)) refused = each(chunk);
    if (!refused.ok()) context->TryCancel();
    return reader->Finish();
  });
  return refused.ok() ? status : refused;
}

absl::StatusOr<std::unique_ptr<RawStream>> Connection::OpenRawStream(v1::Open open) {
  return RawStream::Open(impl_->channel(), impl_->address(), std::move(open), impl_->interrupt());
}

absl::StatusOr<std::unique_ptr<SceneSession>> Connection::OpenSession(client::Options options) {
  options.address = impl_->address();
  options.credentials = impl_->credentials();
  return SceneSession::Open(std::move(options), impl_->interrupt());
}

absl::StatusOr<std::unique_ptr<client::Session>> Connection::OpenLastingSession(
    client::Options options) {
  options.address = impl_->address();
  options.credentials = impl_->credentials();
  return client::Session::Open(std::move(options));
}

}  // namespace voxeld::voxelctl
