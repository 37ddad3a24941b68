// Opens and checks everything that decides who may do what: grants, TLS files and the audit log.
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
  // Recommended interval between calls of Look.
  static constexpr sync::TimeNs kLookInterval = sync::kSecond;

  // Fails if any of the files is invalid now, so that the daemon never starts with less security
  // than configured. If `tls` names no file, no address can use TLS. `log` must outlive this
  // object.
  static absl::StatusOr<std::unique_ptr<Security>> Open(const AccessOptions& options,
                                                        const TlsFiles& tls, AuditOptions audit,
                                                        Logger& log);

  // Reads the files that have changed. Faults are logged and reported by trouble().
  void Look() { LookAt(false); }
  // Reads all files again and reopens the audit log.
  void Reload();

  Access& access() { return *access_; }
  const TlsStore* tls() const { return tls_.get(); }  // null without TLS
  TlsStore::Counts tls_counts() const {
    return tls_ == nullptr ? TlsStore::Counts() : tls_->counts();
  }
  Audit& audit() { return *audit_; }

  // Returns: current faults and upcoming ones (expiring certificates); empty if there are none.
  std::string trouble() const;

 private:
  Security() = default;
  void LookAt(bool again);

  std::unique_ptr<Access> access_;
  std::unique_ptr<TlsStore> tls_;
  std::unique_ptr<Audit> audit_;
};

}  // namespace voxeld::daemon::access
