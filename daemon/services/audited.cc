#include "daemon/services/audited.h"

#include <google/protobuf/message.h>

#include "daemon/services/caller.h"

namespace voxeld::daemon::services {
namespace {

constexpr size_t kMostOfRequest = 512;

}  // namespace

Audited::Audited(ServiceContext& context, const grpc::CallbackServerContext& call,
                 const char* method, const google::protobuf::Message& request,
                 const char* without_fields)
    : audit_(context.audit), peer_(PeerOf(call)), method_(method) {
  if (audit_ == nullptr) return;
  what_ = request.ByteSizeLong() == 0 ? without_fields : request.ShortDebugString();
  if (what_.size() > kMostOfRequest) what_.resize(kMostOfRequest);
}

absl::Status Audited::MayAct() const {
  return audit_ == nullptr ? absl::OkStatus() : audit_->MayAct();
}

absl::Status Audited::Done(const absl::Status& result) const {
  if (audit_ != nullptr) audit_->Record(who_, peer_, method_, what_, result);
  return result;
}

}  // namespace voxeld::daemon::services
