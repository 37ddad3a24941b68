// SceneService.UploadAsset: pieces are written in the assets' own thread, one after another; the next is
// read when the last has been written, so that no call holds more than one.
#include <grpcpp/support/server_callback.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "daemon/services/services.h"
#include "daemon/services/status.h"
#include "voxeld/v1/scene.grpc.pb.h"

namespace voxeld::daemon::services {
namespace {

constexpr size_t kDigestBytes = 32;

absl::Status CheckDigest(const std::string& digest) {
  if (digest.size() == kDigestBytes) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("sha256 has ", digest.size(), " bytes; give the ",
                                                 kDigestBytes, " of the content's SHA-256"));
}

// Owns itself until gRPC is done with it. Reads come one after another; End may come at any time.
class UploadCall final : public grpc::ServerReadReactor<v1::UploadAssetRequest>,
                         public ActiveCall,
                         public std::enable_shared_from_this<UploadCall> {
 public:
  UploadCall(ServiceContext& context, v1::UploadAssetResponse* response)
      : context_(context), budget_(*context.core.budget()), response_(response) {}

  void Start() {
    self_ = shared_from_this();
    context_.calls.Add(self_);
    Read();
  }

  void End(const absl::Status& status) override {
    sync::MutexLock lock(mutex_);
    if (std::exchange(ended_, true)) return;
    Finish(ToGrpc(status));
  }

  void OnReadDone(bool ok) override {
    const uint64_t bytes = ok ? request_.ByteSizeLong() : 0;
    budget_.ChargeAnyway(Budget::Use::kArriving, bytes);
    context_.asset_calls->Post([self = shared_from_this(), ok, bytes](bool cancelled) {
      if (!cancelled) self->Take(ok);
      self->budget_.Release(Budget::Use::kArriving, bytes);
    });
  }

  void OnCancel() override { End(absl::CancelledError("the client is gone")); }

  void OnDone() override {
    context_.calls.Remove(this);
    context_.asset_calls->Post(
        [self = std::move(self_)](bool) { self->context_.assets->Abandon(self->upload_); });
  }

 private:
  void Read() {
    sync::MutexLock lock(mutex_);
    if (!ended_) StartRead(&request_);
  }

  // In the assets' thread.
  void Take(bool ok) {
    {
      sync::MutexLock lock(mutex_);
      if (ended_) return;
    }
    const absl::Status taken = ok ? TakePiece() : Complete();
    if (!taken.ok()) return End(taken);
    if (ok && !here_) return Read();
    sync::MutexLock lock(mutex_);
    if (std::exchange(ended_, true)) return;
    response_->set_sha256(digest_);
    response_->set_stored(size_);
    Finish(grpc::Status::OK);
  }

  absl::Status TakePiece() {
    if (upload_ == 0) {
      if (absl::Status status = CheckDigest(request_.sha256()); !status.ok()) return status;
      digest_ = request_.sha256();
      size_ = request_.size();
      const auto begun = context_.assets->Begin(digest_, size_, request_.offset());
      here_ = absl::IsAlreadyExists(begun.status());
      if (here_) {
        size_ = context_.assets->List({&digest_, 1}).front().stored;
        return absl::OkStatus();
      }
      if (!begun.ok()) return begun.status();
      upload_ = *begun;
    } else if (!request_.sha256().empty() && request_.sha256() != digest_) {
      return absl::InvalidArgumentError(
          "sha256 is another than the first piece's; one call brings one asset");
    }
    return context_.assets->Append(upload_, request_.offset(), request_.data());
  }

  absl::Status Complete() {
    if (upload_ == 0) {
      return absl::InvalidArgumentError(
          "the call ended without a piece; the first tells sha256 and size");
    }
    return context_.assets->Finish(std::exchange(upload_, 0)).status();
  }

  ServiceContext& context_;
  Budget& budget_;
  v1::UploadAssetResponse* const response_;  // while the call has not ended
  v1::UploadAssetRequest request_;           // gRPC's while it reads, else the assets' thread's

  // The assets' thread's.
  std::string digest_;
  uint64_t size_ = 0;
  assets::AssetStore::UploadId upload_ = 0;
  bool here_ = false;  // all of it, already

  sync::Mutex mutex_;
  bool ended_ VOXELD_GUARDED_BY(mutex_) = false;
  std::shared_ptr<UploadCall> self_;
};

}  // namespace

absl::Status CheckAssets(const ServiceContext& context) {
  if (context.assets != nullptr) return absl::OkStatus();
  return absl::FailedPreconditionError(
      "this server keeps no assets: limits.max_assets_bytes is 0; send the bytes themselves");
}

grpc::ServerReadReactor<v1::UploadAssetRequest>* NewUpload(ServiceContext& context,
                                                           access::Caller caller,
                                                           v1::UploadAssetResponse* response) {
  const auto call = std::make_shared<UploadCall>(context, response);
  call->SetCaller(std::move(caller));
  call->Start();
  return call.get();
}

absl::Status ListAssets(ServiceContext& context, const v1::ListAssetsRequest& request,
                        v1::ListAssetsResponse* response) {
  constexpr int kMost = 1000;
  if (absl::Status status = CheckAssets(context); !status.ok()) return status;
  if (request.sha256_size() > kMost) {
    return absl::InvalidArgumentError(
        absl::StrCat("sha256 has ", request.sha256_size(), " entries; give ", kMost, " at most"));
  }
  for (const std::string& digest : request.sha256()) {
    if (absl::Status status = CheckDigest(digest); !status.ok()) return status;
  }
  const std::vector<std::string> digests(request.sha256().begin(), request.sha256().end());
  for (const assets::AssetState& asset :
       digests.empty() ? context.assets->ListAll() : context.assets->List(digests)) {
    v1::AssetInfo* info = response->add_assets();
    info->set_sha256(asset.digest);
    info->set_stored(asset.stored);
    info->set_complete(asset.complete);
  }
  response->set_used_bytes(context.assets->figures().bytes);
  return absl::OkStatus();
}

}  // namespace voxeld::daemon::services
