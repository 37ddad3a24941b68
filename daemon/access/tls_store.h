// Holds the daemon's certificate and key, and the authorities for client certificates. The PEM
// files are reloaded when they change. An invalid set is rejected as a whole and the last valid one
// stays in force, so new connections are never checked less strictly.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "daemon/access/access.h"
#include "daemon/access/file_stamp.h"
#include "daemon/log/logger.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::access {

struct TlsFiles {
  std::string certificate;  // the daemon's certificate, then its intermediates
  std::string key;          // must not be readable by everybody
  std::string client_ca;    // authorities whose client certificates are accepted
  bool any() const { return !certificate.empty() || !key.empty() || !client_ca.empty(); }
};

struct TlsMaterial {
  std::string certificate, key, client_ca;  // PEM
  int64_t expires_s = 0;                    // expiry of the daemon's certificate, Unix time
};

// Errors: InvalidArgument or FailedPrecondition, which names the file, the fault and the remedy: no
// certificate, a key that does not match, a certificate that is not valid at `now_s`, or a key that
// everybody can read.
absl::StatusOr<TlsMaterial> ReadTls(const TlsFiles& files, int64_t now_s);

// Thread-safe.
class TlsStore {
 public:
  // trouble() reports an expiring certificate this long in advance.
  static constexpr int64_t kWarnSeconds = 14 * 24 * 3600;

  // Fails if the files are invalid now. `log` may be null; otherwise it must outlive this object.
  static absl::StatusOr<std::unique_ptr<TlsStore>> Open(TlsFiles files, Access::WallClock now,
                                                        Logger* log);

  // Reads the files if one has changed, or if `again` is true. Errors: FailedPrecondition with the
  // fault of the files.
  absl::Status Look(bool again = false);

  struct Current {
    std::shared_ptr<const TlsMaterial> material;
    uint64_t generation = 0;  // increases by one with each accepted set
  };
  Current current() const;

  // How often the files were read and accepted (including the first time), and how often they were
  // rejected.
  struct Counts {
    uint64_t taken = 0, refused = 0;
  };
  Counts counts() const;

  // Returns: the current or upcoming fault, or an empty string.
  std::string trouble() const;

 private:
  using Stamps = std::array<std::optional<FileStamp>, 3>;
  TlsStore(TlsFiles files, Access::WallClock now, Logger* log)
      : files_(std::move(files)), now_(std::move(now)), log_(log) {}
  Stamps StampAll() const;

  const TlsFiles files_;
  const Access::WallClock now_;
  Logger* const log_;
  mutable sync::Mutex mutex_;
  Stamps stamps_ VOXELD_GUARDED_BY(mutex_);
  Current current_ VOXELD_GUARDED_BY(mutex_);
  uint64_t refused_ VOXELD_GUARDED_BY(mutex_) = 0;
  std::string wrong_ VOXELD_GUARDED_BY(mutex_);
  bool warned_ VOXELD_GUARDED_BY(mutex_) = false;
};

}  // namespace voxeld::daemon::access
