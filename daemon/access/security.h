// All that decides who may do what, opened together and looked at together.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "daemon/access/access.h"
#include "daemon/access/audit.h"
#include "daemon/access/tls_store.h"
#include "daemon/log/logger.h"
#include "display/sync/clock.h"

namespace voxeld::daemon::access {

// Thread-safe.
class Security {
 public:
  // How often files should be looked at.
  static constexpr sync::TimeNs kLookInterval = sync::kSecond;

  // Fails if what is there now is not right: nothing is begun with less than was asked for. `tls` without
  // any file: no address speaks it. `log` outlives this.
  static absl::StatusOr<std::unique_ptr<Security>> Open(const AccessOptions& options,
                                                        const TlsFiles& tls, AuditOptions audit,
                                                        Logger& log);

  // Reads what has changed. What is wrong is logged, and in trouble().
  void Look() { LookAt(false); }
  // Reads all of it, and opens the audit log anew.
  void Reload();

  Access& access() { return *access_; }
  const TlsStore* tls() const { return tls_.get(); }  // may be none
  TlsStore::Counts tls_counts() const {
    return tls_ == nullptr ? TlsStore::Counts() : tls_->counts();
  }
  Audit& audit() { return *audit_; }

  // What is wrong with any of it, or will soon be; empty: nothing.
  std::string trouble() const;

 private:
  Security() = default;
  void LookAt(bool again);

  std::unique_ptr<Access> access_;
  std::unique_ptr<TlsStore> tls_;
  std::unique_ptr<Audit> audit_;
};

}  // namespace voxeld::daemon::access
