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
  Update(ServiceContext& context, v1::ApplyUpdateResponse* response,
         std::function<void(const absl::Status&)> done)
      : context_(context), response_(response), done_(std::move(done)) {}

  void Start(OpenOptions open, wire::Decoded decoded, uint64_t bytes) {
    context_.core.OpenSession(std::move(open), shared_from_this(),
                              [self = shared_from_this(), decoded = std::move(decoded),
                               bytes](absl::StatusOr<SessionInfo> info) mutable {
                                if (!info.ok()) return self->done_(info.status());
                                {
                                  sync::MutexLock lock(self->mutex_);
                                  self->session_ = info->session;
                                }
                                self->context_.core.Handle(
                                    info->session, std::move(decoded.operations),
                                    std::move(decoded.issues), bytes, nullptr);
                              });
  }

  void OnIssue(const Issue& issue) override {
    sync::MutexLock lock(mutex_);
    if (answered_) return;
    if (first_issue_.empty()) first_issue_ = issue.message;
    wire::Encode(issue, response_->add_issues());
  }

  void OnReceipt(const Receipt& receipt) override {
    absl::Status status;
    SessionId session = 0;
    {
      sync::MutexLock lock(mutex_);
      if (answered_) return;
      if (const auto* accepted = std::get_if<Accepted>(&receipt.what)) {
        response_->set_snapshot(accepted->snapshot);
      } else if (const auto* refused = std::get_if<Refused>(&receipt.what)) {
        status = absl::InvalidArgumentError(
            absl::StrCat(refused->message, first_issue_.empty() ? "" : ": ", first_issue_));
      } else {
        return;
      }
      answered_ = true;
      session = session_;
    }
    context_.core.CloseSession(session,
                               [self = shared_from_this(), status] { self->done_(status); });
  }

 private:
  ServiceContext& context_;
  v1::ApplyUpdateResponse* const response_;  // the sink's until `answered_`
  const std::function<void(const absl::Status&)> done_;
  sync::Mutex mutex_;
  SessionId session_ VOXELD_GUARDED_BY(mutex_) = 0;
  bool answered_ VOXELD_GUARDED_BY(mutex_) = false;
  std::string first_issue_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace

void ApplyUpdate(ServiceContext& context, const v1::ApplyUpdateRequest& request,
                 v1::ApplyUpdateResponse* response, std::function<void(const absl::Status&)> done) {
  wire::Decoded decoded = wire::DecodeUpdate(request, context.core.limits());
  if (!decoded.open.has_value()) return done(decoded.status);
  OpenOptions open = *std::move(decoded.open);
  std::make_shared<Update>(context, response, std::move(done))
      ->Start(std::move(open), std::move(decoded), request.ByteSizeLong());
}

}  // namespace voxeld::daemon::services
