#include "daemon/access/security.h"

#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace voxeld::daemon::access {

absl::StatusOr<std::unique_ptr<Security>> Security::Open(const AccessOptions& options,
                                                         const TlsFiles& tls, AuditOptions audit,
                                                         Logger& log) {
  std::unique_ptr<Security> security(new Security);
  security->access_ = std::make_unique<Access>(options, Access::SystemWallClock(), &log);
  if (absl::Status status = security->access_->Look(); !status.ok()) return status;
  if (tls.any()) {
    auto store = TlsStore::Open(tls, Access::SystemWallClock(), &log);
    if (!store.ok()) return store.status();
    security->tls_ = *std::move(store);
  }
  auto opened = Audit::Open(std::move(audit), &log);
  if (!opened.ok()) return opened.status();
  security->audit_ = *std::move(opened);
  return security;
}

void Security::LookAt(bool again) {
  (void)access_->Look(again);
  audit_->Retry();
  if (tls_ != nullptr) (void)tls_->Look(again);
}

void Security::Reload() {
  audit_->Reopen();
  LookAt(true);
}

std::string Security::trouble() const {
  std::vector<std::string> wrong = {access_->trouble(), tls_ == nullptr ? "" : tls_->trouble()};
  if (const AuditStats audit = audit_->stats(); !audit.error.empty()) {
    wrong.push_back(absl::StrCat("the audit log cannot be written (", audit.error,
                                 "): ", audit.pending, " entries are pending, ", audit.lost,
                                 " were lost"));
  }
  std::erase(wrong, "");
  return absl::StrJoin(wrong, "; ");
}

}  // namespace voxeld::daemon::access
