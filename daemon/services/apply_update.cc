#include "daemon/services/apply_update.h"

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "daemon/wire/decode.h"
#include "daemon/wire/encode.h"
#include "display/sync/mutex.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::daemon::services {
namespace {

class Update final : public SessionSink, public std::enable_shared_from_this<Update> {
 public:
  Update(Core& core, UpdateDone done) : core_(core), done_(std::move(done)) {}

  void Start(OpenOptions open, wire::Decoded decoded, uint64_t bytes) {
    // Charged until the operations are staged or dropped.
    const std::shared_ptr<void> arriving(nullptr, [budget = core_.budget(), bytes](void*) {
      budget->Release(Budget::Use::kArriving, bytes);
    });
    core_.OpenSession(
        std::move(open), bytes, shared_from_this(),
        [self = shared_from_this(), decoded = std::move(decoded),
         arriving](absl::StatusOr<SessionInfo> info) mutable {
          if (!info.ok()) return self->End(info.status());
          {
            sync::MutexLock lock(self->mutex_);
            self->session_ = info->session;
            self->incarnation_ = info->incarnation;
            self->response_.set_owner(info->owner);
          }
          info->intake->Take({std::move(decoded.operations), std::move(decoded.refused)});
        });
  }

  void OnIssue(const Issue& issue) override {
    sync::MutexLock lock(mutex_);
    if (answered_) return;
    wire::Encode(issue, response_.add_issues());
  }

  void OnReceipt(const Receipt& receipt) override {
    absl::Status status;
    SessionId session = 0;
    uint64_t incarnation = 0;
    {
      sync::MutexLock lock(mutex_);
      if (answered_) return;
      if (const auto* accepted = std::get_if<Accepted>(&receipt.what)) {
        response_.set_snapshot(accepted->snapshot);
      } else if (const auto* refused = std::get_if<Refused>(&receipt.what)) {
        status = absl::InvalidArgumentError(refused->message);  // names the first refusal
      } else {
        return;
      }
      answered_ = true;
      session = session_;
      incarnation = incarnation_;
    }
    core_.CloseSession(session, incarnation, true,
                       [self = shared_from_this(), status] { self->Answer(status); });
  }

  void OnEnded(const absl::Status& why) override { End(why); }

 private:
  void End(const absl::Status& status) {
    {
      sync::MutexLock lock(mutex_);
      if (answered_) return;
      answered_ = true;
    }
    Answer(status);
  }

  // Call once and only after `answered_`, when no other thread uses the response.
  void Answer(const absl::Status& status) { done_(status, response_); }

  Core& core_;
  const UpdateDone done_;
  sync::Mutex mutex_;
  v1::ApplyUpdateResponse response_;  // filled until `answered_`
  SessionId session_ VOXELD_GUARDED_BY(mutex_) = 0;
  uint64_t incarnation_ VOXELD_GUARDED_BY(mutex_) = 0;
  bool answered_ VOXELD_GUARDED_BY(mutex_) = false;
};

}  // namespace

void ApplyUpdate(ServiceContext& context, const access::Caller& caller,
                 std::span<const std::string_view> slices, UpdateDone done) {
  wire::Decoded decoded =
      wire::DecodeUpdate(slices, context.core.limits(), &context.core.bulk(),
                         {nullptr, context.assets, context.core.budget().get()}, &context.fonts);
  if (!decoded.open.has_value()) return done(decoded.status, v1::ApplyUpdateResponse());
  uint64_t bytes = 0;
  for (const std::string_view slice : slices) bytes += slice.size();
  bytes += decoded.named_bytes;
  OpenOptions open = *std::move(decoded.open);
  open.principal = caller.principal;
  open.may_erase = caller.scopes.Has(access::Scope::kControl);
  Budget& budget = *context.core.budget();
  if (!budget.Charge(Budget::Use::kArriving, bytes)) {
    return done(absl::ResourceExhaustedError(absl::StrCat(
                    "an update of ", bytes, " bytes would be held beside ", budget.used_bytes(),
                    " of all clients; max_memory_bytes allows ", budget.limit_bytes(),
                    "; try again when others have taken something away")),
                v1::ApplyUpdateResponse());
  }
  std::make_shared<Update>(context.core, std::move(done))
      ->Start(std::move(open), std::move(decoded), bytes);
}

}  // namespace voxeld::daemon::services
