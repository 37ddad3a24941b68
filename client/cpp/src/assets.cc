#include "voxeld/assets.h"

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>
#include <grpcpp/support/channel_arguments.h>
#include <openssl/evp.h>

#include <algorithm>
#include <memory>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "voxeld/channel.h"
#include "voxeld/v1/scene.grpc.pb.h"

namespace voxeld::client {
namespace {

// Small enough for progress, large enough to cost nothing, and for every server's max_message_bytes.
constexpr size_t kPieceBytes = 1u << 20;

constexpr int kKeepaliveMs = 20'000;  // a dead connection is noticed

using Clock = std::chrono::system_clock;

// Between two attempts.
constexpr std::chrono::milliseconds kPause(100);

absl::Status FromGrpc(const grpc::Status& status) {
  return absl::Status(static_cast<absl::StatusCode>(status.error_code()), status.error_message());
}

bool MayGoOn(const absl::Status& status) {
  return absl::IsUnavailable(status) || absl::IsAborted(status) || absl::IsOutOfRange(status);
}

// One asset on its way.
class Upload {
 public:
  Upload(v1::SceneService::Stub& stub, std::string_view bytes, const Asset& asset,
         const UploadOptions& options)
      : stub_(stub), bytes_(bytes), asset_(asset), options_(options) {}

  // How much is there.
  absl::StatusOr<v1::AssetInfo> Ask(Clock::time_point until) {
    grpc::ClientContext context;
    context.set_wait_for_ready(true);
    context.set_deadline(until);
    v1::ListAssetsRequest request;
    request.add_sha256(asset_.sha256);
    v1::ListAssetsResponse response;
    const absl::Status status = FromGrpc(stub_.ListAssets(&context, request, &response));
    if (!status.ok()) return status;
    if (response.assets_size() != 1) return absl::InternalError("the server told of no asset");
    return response.assets(0);
  }

  // From there to the end, in one call.
  absl::Status Send(uint64_t from) {
    grpc::ClientContext context;
    context.set_wait_for_ready(true);
    v1::UploadAssetResponse response;
    const auto call = stub_.UploadAsset(&context, &response);
    bool stopped = false;
    for (uint64_t at = from; at < bytes_.size() && !stopped; at += kPieceBytes) {
      v1::UploadAssetRequest request;
      if (at == from) {
        request.set_sha256(asset_.sha256);
        request.set_size(bytes_.size());
      }
      request.set_offset(at);
      const std::string_view piece = bytes_.substr(at, kPieceBytes);
      request.set_data(piece.data(), piece.size());
      if (!call->Write(request)) break;
      stopped = options_.progress && !options_.progress(at + piece.size(), bytes_.size());
    }
    if (stopped) context.TryCancel();
    call->WritesDone();
    const absl::Status status = FromGrpc(call->Finish());
    return stopped ? absl::CancelledError("the upload was stopped; what came stays") : status;
  }

 private:
  v1::SceneService::Stub& stub_;
  const std::string_view bytes_;
  const Asset& asset_;
  const UploadOptions& options_;
};

}  // namespace

Asset AssetOf(std::string_view bytes) {
  Asset asset{.sha256 = std::string(static_cast<size_t>(EVP_MD_size(EVP_sha256())), '\0'),
              .size = bytes.size()};
  EVP_Digest(bytes.data(), bytes.size(), reinterpret_cast<unsigned char*>(asset.sha256.data()),
             nullptr, EVP_sha256(), nullptr);
  return asset;
}

absl::StatusOr<Asset> UploadAsset(std::string_view bytes, const UploadOptions& options) {
  if (bytes.empty()) return absl::InvalidArgumentError("an asset has 1 byte at least; give more");
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepaliveMs);
  const auto channel = MakeChannel(options.address.empty() ? DefaultAddress() : options.address,
                                   options.credentials.value_or(DefaultCredentials()), arguments);
  if (!channel.ok()) return channel.status();
  const auto stub = v1::SceneService::NewStub(*channel);
  const Asset asset = AssetOf(bytes);
  Upload upload(*stub, bytes, asset, options);

  uint64_t before = 0;
  auto until = Clock::now() + options.patience;
  for (;;) {
    const absl::StatusOr<v1::AssetInfo> there = upload.Ask(until);
    if (!there.ok()) return there.status();
    if (there->complete()) return asset;
    if (there->stored() > before) until = Clock::now() + options.patience;  // it moves
    before = there->stored();
    const uint64_t from = before < bytes.size() ? before : 0;
    const absl::Status sent = upload.Send(from);
    if (sent.ok()) return asset;
    if (!MayGoOn(sent) || Clock::now() >= until) return sent;
    std::this_thread::sleep_for(kPause);
  }
}

}  // namespace voxeld::client
