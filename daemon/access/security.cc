#include "daemon/access/security.h"

#include <utility>

namespace voxeld::daemon::access {

absl::StatusOr<std::unique_ptr<Security>> Security::Open(const AccessOptions& options,
                                                         const TlsFiles& tls,
                                                         const std::string& audit, Logger& log) {
  std::unique_ptr<Security> security(new Security);
  security->access_ = std::make_unique<Access>(options, Access::SystemWallClock(), &log);
  if (absl::Status status = security->access_->Look(); !status.ok()) return status;
  if (tls.any()) {
    auto store = TlsStore::Open(tls, Access::SystemWallClock(), &log);
    if (!store.ok()) return store.status();
    security->tls_ = *std::move(store);
  }
  auto opened = Audit::Open(audit, &log);
  if (!opened.ok()) return opened.status();
  security->audit_ = *std::move(opened);
  return security;
}

void Security::LookAt(bool again) {
  (void)access_->Look(again);
  if (tls_ != nullptr) (void)tls_->Look(again);
}

void Security::Reload() {
  audit_->Reopen();
  LookAt(true);
}

std::string Security::trouble() const {
  std::string trouble = access_->trouble();
  const std::string of_tls = tls_ == nullptr ? "" : tls_->trouble();
  if (!trouble.empty() && !of_tls.empty()) trouble += "; ";
  return trouble + of_tls;
}

}  // namespace voxeld::daemon::access
