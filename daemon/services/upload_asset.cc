// Implements SceneService.UploadAsset. Pieces are written on the assets' thread in order. The next
// piece is read when the last one has been written, so that each call holds only one.
#include <grpcpp/alarm.h>
#include <grpcpp/support/server_callback.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "daemon/services/services.h"
#include "daemon/services/status.h"
#include "voxeld/v1/scene.grpc.pb.h"

namespace voxeld::daemon::services {
namespace {

constexpr size_t kDigestBytes = wire::AssetSource::kDigestBytes;
constexpr uint64_t kBesideData = 256;  // maximum size of a message without its data

absl::Status CheckDigest(const std::string& digest) {
  if (digest.size() == kDigestBytes) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("sha256 has ", digest.size(), " bytes; give the ",
                                                 kDigestBytes, " of the content's SHA-256"));
}

// Owns itself until gRPC has finished with it. Reads are sequential. End may be called at any time;
// the assets' thread sends its status.
class UploadCall final : public grpc::ServerReadReactor<v1::UploadAssetRequest>,
                         public ActiveCall,
                         public std::enable_shared_from_this<UploadCall> {
 public:
  UploadCall(ServiceContext& context, v1::UploadAssetResponse* response)
      : context_(context), budget_(context.core.budget()), response_(response) {}

  void Start() {
    self_ = shared_from_this();
    const bool too_many = ++context_.uploads > ServiceContext::kMostUploads;
    context_.calls.Add(self_);  // ends it at once during a shutdown
    if (too_many) {
      return End(absl::ResourceExhaustedError(
          absl::StrCat(ServiceContext::kMostUploads,
                       " uploads are open, which is the most; try again when one has ended")));
    }
    Read();
    sync::MutexLock lock(mutex_);
    LookForSilenceAt(context_.clock.Now() + SilenceLimit());
  }

  void End(const absl::Status& status) override {
    {
      sync::MutexLock lock(mutex_);
      if (std::exchange(ended_, true)) return;
    }
    context_.asset_calls->Post([self = shared_from_this(), status = ToGrpc(status)](bool) {
      self->LetGoAndFinish(status);
    });
  }

  void OnReadDone(bool ok) override {
    const uint64_t bytes = ok ? request_.ByteSizeLong() : 0;
    heard_ = context_.clock.Now();
    if (ok && !budget_->Charge(Budget::Use::kArriving, bytes)) {
      return End(absl::ResourceExhaustedError(
          absl::StrCat("a piece of ", bytes, " bytes would be held beside ", budget_->used_bytes(),
                       " of all clients; max_memory_bytes allows ", budget_->limit_bytes(),
                       "; go on when others have taken something away")));
    }
    context_.assets->Heard(upload_);
    context_.asset_calls->Post([self = shared_from_this(), ok, bytes](bool) {
      const bool more = self->Take(ok);  // false during a shutdown: calls have ended before
      v1::UploadAssetRequest().Swap(&self->request_);  // frees its memory
      self->budget_->Release(Budget::Use::kArriving, bytes);
      if (more) self->Read();
    });
  }

  void OnCancel() override { End(absl::CancelledError("the client is gone")); }

  void OnDone() override {
    std::unique_ptr<grpc::Alarm> alarm;
    {
      sync::MutexLock lock(mutex_);
      alarm = std::move(alarm_);
    }
    alarm.reset();
    context_.calls.Remove(this);
    const auto self = std::move(self_);  // may be the last reference
  }

 private:
  sync::TimeNs SilenceLimit() const { return context_.limits.upload_silence_limit_ns; }

  void Read() {
    sync::MutexLock lock(mutex_);
    if (!ended_) StartRead(&request_);
  }

  void LookForSilenceAt(sync::TimeNs at) VOXELD_REQUIRES(mutex_) {
    if (ended_) return;
    const sync::TimeNs wait = std::max<sync::TimeNs>(0, at - context_.clock.Now());
    alarm_ = std::make_unique<grpc::Alarm>();
    alarm_->Set(gpr_time_add(gpr_now(GPR_CLOCK_MONOTONIC), gpr_time_from_nanos(wait, GPR_TIMESPAN)),
                [self = shared_from_this()](bool due) {
                  if (due) self->LookForSilence();
                });
  }

  void LookForSilence() {
    const sync::TimeNs due = heard_ + SilenceLimit();
    if (context_.clock.Now() >= due) {
      return End(absl::DeadlineExceededError(
          absl::StrCat("nothing came for ", SilenceLimit() / sync::kMillisecond,
                       " ms, which is upload_silence_limit_ns; what came before stays for a while: "
                       "ask ListAssets where to go on")));
    }
    std::unique_ptr<grpc::Alarm> fired;  // destroyed without the lock
    sync::MutexLock lock(mutex_);
    fired = std::move(alarm_);
    LookForSilenceAt(due);
  }

  // Call on the assets' thread. Returns: true if the next piece may be read.
  bool Take(bool ok) {
    {
      sync::MutexLock lock(mutex_);
      if (ended_) return false;
    }
    const absl::Status taken = ok ? TakePiece() : Complete();
    if (!taken.ok()) {
      End(taken);
      return false;
    }
    if (ok && !here_) return true;
    {
      sync::MutexLock lock(mutex_);
      if (std::exchange(ended_, true)) return false;
      response_->set_sha256(digest_);
      response_->set_stored(size_);
    }
    LetGoAndFinish(grpc::Status::OK);
    return false;
  }

  // Call on the assets' thread, once. When the client learns of the end, the content and the call's
  // place are already free for others.
  void LetGoAndFinish(const grpc::Status& status) {
    context_.assets->Abandon(upload_);
    --context_.uploads;
    Finish(status);
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
    return context_.assets->Finish(upload_).status();
  }

  ServiceContext& context_;
  const std::shared_ptr<Budget> budget_;
  v1::UploadAssetResponse* const response_;  // valid while the call has not ended
  v1::UploadAssetRequest request_;  // used by gRPC while it reads, else by the assets' thread
  std::atomic<sync::TimeNs> heard_ = context_.clock.Now();

  // Used by the assets' thread; any thread may read upload_.
  std::string digest_;
  uint64_t size_ = 0;
  std::atomic<assets::AssetStore::UploadId> upload_ = 0;
  bool here_ = false;  // the asset was already complete

  sync::Mutex mutex_;
  bool ended_ VOXELD_GUARDED_BY(mutex_) = false;
  std::unique_ptr<grpc::Alarm> alarm_ VOXELD_GUARDED_BY(mutex_);
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
  response->set_max_piece_bytes(context.core.limits().max_message_bytes - kBesideData);
  return absl::OkStatus();
}

}  // namespace voxeld::daemon::services
