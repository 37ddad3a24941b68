// Identifies callers and determines their scopes, by a bearer token, by a client certificate, or by
// the user that the kernel reports for a unix socket. The grants file (grants.h) is reloaded when
// it changes.
//
//   token given           The token must be in the file and not expired. No other credential counts
//                         then.
//   certificate           The grant with its common name applies, or else certificate_scopes.
//   unix socket           Root and the daemon's own user have all scopes. A user in the file has
//                         the scopes listed there, any other user that the socket's mode admits
//                         unix_scopes.
//   none of these         anonymous_scopes
//
// An unreadable or invalid file fails closed: until it is fixed, callers that need it are rejected
// (UNAVAILABLE). They include users of unix sockets other than root and the daemon's user. Running
// calls continue until a valid file revokes their scopes.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "daemon/access/file_stamp.h"
#include "daemon/access/grants.h"
#include "daemon/access/scopes.h"
#include "daemon/log/logger.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::access {

struct AccessOptions {
  std::string grants;  // path of the grants file; empty: no file
  Scopes anonymous = Scopes::All();
  Scopes certificate;
  Scopes unix_users = Scopes::All();
  // Users of unix sockets that have all scopes regardless of the grants file: root and the daemon's
  // own user.
  std::set<uint32_t> trusted = TrustedUsers();

  static std::set<uint32_t> TrustedUsers();
};

// The credentials of a connection and a call.
struct Credentials {
  std::optional<std::string> token;        // from "authorization: Bearer …"
  std::optional<std::string> certificate;  // common name of the verified client certificate
  std::optional<uint32_t> user;            // user id of the peer of a unix socket
};

struct Caller {
  std::string principal;  // name of the token or certificate; owns the caller's layers. Empty: none
  std::string who;        // for logs: "token stage-left", "user 1000", "anonymous"
  Scopes scopes;

  // How the caller was identified, and the key: a token's hash, a certificate's common name or a
  // user id.
  enum class By : uint8_t { kAnonymous, kToken, kCertificate, kUser };
  By by = By::kAnonymous;
  std::string key;
};

// Thread-safe.
class Access {
 public:
  // Unix time in seconds; it may jump.
  using WallClock = std::function<int64_t()>;
  static WallClock SystemWallClock();

  // `log` may be null; otherwise it must outlive this object. The file is first read by Look.
  Access(AccessOptions options, WallClock now, Logger* log);
  Access(const Access&) = delete;
  Access& operator=(const Access&) = delete;

  // Reads the file if it has changed since the last call, or if `again` is true. Calls on_change if
  // the file was read, or if a token has expired since the last call. Errors: FailedPrecondition
  // with the fault of the file.
  absl::Status Look(bool again = false);
  // Replaces the options and reads their file. Calls on_change. Errors: the error of ReadGrants if
  // the file is invalid; the previous options then stay in force.
  absl::Status Change(AccessOptions options);
  // Sets the callback for changes that may have revoked scopes. The thread that calls Look or
  // Change calls it.
  void SetOnChange(std::function<void()> on_change);

  // Errors: Unauthenticated or Unavailable, with the remedy.
  absl::StatusOr<Caller> Identify(const Credentials& credentials) const;
  // Returns OK if `caller` still has every scope that it had when it was identified, or while the
  // file is invalid.
  absl::Status Recheck(const Caller& caller) const;

  // Returns: the fault of the file, or an empty string.
  std::string trouble() const;

 private:
  absl::StatusOr<Caller> Find(Caller::By by, const std::string& key) const VOXELD_REQUIRES(mutex_);

  AccessOptions options_ VOXELD_GUARDED_BY(mutex_);
  const WallClock now_;
  Logger* const log_;
  mutable sync::Mutex mutex_;
  std::function<void()> on_change_ VOXELD_GUARDED_BY(mutex_);
  Grants grants_ VOXELD_GUARDED_BY(mutex_);
  std::optional<FileStamp> stamp_ VOXELD_GUARDED_BY(mutex_);
  bool looked_ VOXELD_GUARDED_BY(mutex_) = false;
  std::string trouble_ VOXELD_GUARDED_BY(mutex_);
  int64_t looked_s_ VOXELD_GUARDED_BY(mutex_) = 0;
};

}  // namespace voxeld::daemon::access
