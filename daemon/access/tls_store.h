// The daemon's certificate and key, and whose clients' certificates it takes: PEM files, read again
// when they change. What is not right is refused whole, and the last that was right stays in force: new
// connections never have less than it asks of them.
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
  std::string certificate;  // the daemon's, then those between it and its authority's
  std::string key;          // not readable by all
  std::string client_ca;    // authorities whose clients are let in
  bool any() const { return !certificate.empty() || !key.empty() || !client_ca.empty(); }
};

struct TlsMaterial {
  std::string certificate, key, client_ca;  // PEM
  int64_t expires_s = 0;                    // the daemon's certificate, Unix time
};

// InvalidArgument or FailedPrecondition says which file, what is wrong, and what would be right: no
// certificate in it, a key of another, one that is not valid at `now_s`, one that all may read.
absl::StatusOr<TlsMaterial> ReadTls(const TlsFiles& files, int64_t now_s);

// Thread-safe.
class TlsStore {
 public:
  // So long before the certificate expires trouble() says so.
  static constexpr int64_t kWarnSeconds = 14 * 24 * 3600;

  // Fails if what is there now is not right. `log` may be none, else it outlives this.
  static absl::StatusOr<std::unique_ptr<TlsStore>> Open(TlsFiles files, Access::WallClock now,
                                                        Logger* log);

  // Reads the files if one is another than last time, or `again`. Answers what is wrong with them.
  absl::Status Look(bool again = false);

  struct Current {
    std::shared_ptr<const TlsMaterial> material;
    uint64_t generation = 0;  // greater by one with each that was taken
  };
  Current current() const;

  // Times that the files were read and taken, the first included, and that they were wrong.
  struct Counts {
    uint64_t taken = 0, refused = 0;
  };
  Counts counts() const;

  // What is wrong, or will soon be; empty: nothing.
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
