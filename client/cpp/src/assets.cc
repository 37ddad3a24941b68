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

// Small enough for progress over slow links, large enough for negligible overhead.
constexpr size_t kPieceBytes = 256u << 10;
constexpr int kKeepaliveMs = 20'000;  // detects dead connections

using Clock = std::chrono::steady_clock;

// Limits one query, so that a request to stop is noticed.
constexpr std::chrono::milliseconds kAskTime(1000);
// Pause between two attempts.
constexpr std::chrono::milliseconds kPause(100);

absl::Status FromGrpc(const grpc::Status& status) {
  return absl::Status(static_cast<absl::StatusCode>(status.error_code()), status.error_message());
}

bool MayGoOn(const absl::Status& status) {
  return absl::IsUnavailable(status) || absl::IsAborted(status) || absl::IsOutOfRange(status) ||
         absl::IsDeadlineExceeded(status);
}

// One upload in progress.
class Upload {
 public:
  Upload(v1::SceneService::Stub& stub, std::string_view bytes, const Asset& asset,
         const UploadOptions& options)
      : stub_(stub), bytes_(bytes), asset_(asset), options_(options) {}

  // Returns when the asset is stored, or when there was no progress for the patience.
  absl::Status Run() {
    uint64_t stored = 0;
    bool restart = false;  // the stored part is wrong: start again from 0
    absl::Status last = absl::UnavailableError("the server does not answer");
    Clock::time_point moved = Clock::now();
    for (;; std::this_thread::sleep_for(kPause)) {
      const absl::StatusOr<v1::ListAssetsResponse> there = Ask();
      if (there.ok() && there->assets_size() == 1) {
        if (there->assets(0).complete()) return absl::OkStatus();
        if (there->assets(0).stored() > stored) moved = Clock::now();
        stored = there->assets(0).stored();
        const uint64_t from = restart || stored >= bytes_.size() ? 0 : stored;
        last = Send(
            from, std::max<uint64_t>(1, std::min<uint64_t>(kPieceBytes, there->max_piece_bytes())));
        if (last.ok()) return last;
        // Another client began this part with other bytes: send all of it once more.
        if (absl::IsDataLoss(last) && from > 0) {
          restart = true;
          continue;
        }
      } else if (!there.ok()) {
        last = there.status();
      }
      if (!MayGoOn(last)) return last;
      if (Clock::now() - moved >= options_.patience) return last;
      if (!Told(stored)) return absl::CancelledError("the upload was stopped; what came stays");
    }
  }

 private:
  bool Told(uint64_t stored) const {
    return !options_.progress || options_.progress(stored, bytes_.size());
  }

  // Asks how much is stored.
  absl::StatusOr<v1::ListAssetsResponse> Ask() {
    grpc::ClientContext context;
    context.set_wait_for_ready(true);
    context.set_deadline(std::chrono::system_clock::now() + kAskTime);
    v1::ListAssetsRequest request;
    request.add_sha256(asset_.sha256);
    v1::ListAssetsResponse response;
    const absl::Status status = FromGrpc(stub_.ListAssets(&context, request, &response));
    if (!status.ok()) return status;
    return response;
  }

  // Sends everything from `from` to the end, in one call.
  absl::Status Send(uint64_t from, uint64_t piece_bytes) {
    grpc::ClientContext context;
    v1::UploadAssetResponse response;
    const auto call = stub_.UploadAsset(&context, &response);
    bool stopped = false;
    for (uint64_t at = from; at < bytes_.size() && !stopped; at += piece_bytes) {
      v1::UploadAssetRequest request;
      if (at == from) {
        request.set_sha256(asset_.sha256);
        request.set_size(bytes_.size());
      }
      request.set_offset(at);
      const std::string_view piece = bytes_.substr(at, piece_bytes);
      request.set_data(piece.data(), piece.size());
      if (!call->Write(request)) break;
      stopped = !Told(at + piece.size());
    }
    if (stopped) context.TryCancel();
    call->WritesDone();
    const absl::Status status = FromGrpc(call->Finish());
    return stopped ? absl::CancelledError("the upload was stopped; what came stays") : status;
  }

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
  if (absl::Status status = Upload(*stub, bytes, asset, options).Run(); !status.ok()) return status;
  return asset;
}

}  // namespace voxeld::client
