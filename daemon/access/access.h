// Who a caller is and what they may do: by a bearer token, by a client certificate, by the kernel's
// word on a unix socket; by the grants file (grants.h), which is read again when it changes.
//
//   token given           it must be in the file and not expired; nothing else counts then
//   certificate           in the file by its common name; else certificate_scopes
//   unix socket           root and the daemon's own user may do everything; a user in the file what
//                         is said there; any other (whom the socket's mode lets in) unix_scopes
//   none of these         anonymous_scopes
//
// A file that cannot be read, or is wrong, fails closed: until it is right again whoever needs it is
// turned away (UNAVAILABLE), and so is a user of a unix socket that is not root's or the daemon's.
// Calls under way go on, until a file that is right says otherwise.
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
  std::string grants;  // the file; empty: there is none
  Scopes anonymous = Scopes::All();
  Scopes certificate;
  Scopes unix_users = Scopes::All();
  // Users of unix sockets who may do everything, whatever any file says: root and the daemon's own.
  std::set<uint32_t> trusted = TrustedUsers();

  static std::set<uint32_t> TrustedUsers();
};

// What a connection and a call say of who is calling.
struct Credentials {
  std::optional<std::string> token;        // of "authorization: Bearer …"
  std::optional<std::string> certificate;  // the verified one's common name
  std::optional<uint32_t> user;            // of a unix socket
};

struct Caller {
  std::string
      principal;    // a token's or a certificate's name: whose layers are whose. Empty: nobody's
  std::string who;  // for logs: "token stage-left", "user 1000", "anonymous"
  Scopes scopes;

  // What it was known by; of a token the hash.
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

  // `log` may be none, else it outlives this. Nothing is read until the first Look.
  Access(AccessOptions options, WallClock now, Logger* log);
  Access(const Access&) = delete;
  Access& operator=(const Access&) = delete;

  // Reads the file if it is another than last time, or `again`. Answers what is wrong with it. Tells
  // on_change if the file was read, or if a token has expired since the last look.
  absl::Status Look(bool again = false);
  // Other options, with their file as it is now: InvalidArgument or so if that is wrong, and those in force
  // stay. Tells on_change.
  absl::Status Change(AccessOptions options);
  // After a Look that may have taken something from somebody. Called by whoever calls Look.
  void SetOnChange(std::function<void()> on_change);

  // Unauthenticated, PermissionDenied or Unavailable, with what would help.
  absl::StatusOr<Caller> Identify(const Credentials& credentials) const;
  // OK if `caller` may still do all that it could when it was identified. Also while the file is wrong.
  absl::Status Recheck(const Caller& caller) const;

  // What is wrong with the file; empty: nothing.
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
