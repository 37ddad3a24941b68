// Content by its hash (voxeld.v1.SceneService.UploadAsset): brought once, piece by piece, and named by
// any number of requests.
//
//   uploads   may break off, and go on behind the last piece that came: parts are kept like what is whole
//   whole     only what has its hash: compared when the last byte is here, and again when it is first
//             used after a start
//   budget    for what is whole, for parts, and for what uploads under way said they would bring: what
//             was used least recently goes, uploads under way stay
//   a folder  keeps it over the daemon's end, on the disk before Finish answers: <sha256>, and
//             <sha256>.part for parts. Files of other names are left alone. Without one it is in memory
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "daemon/assets/asset_file.h"
#include "daemon/core/stats.h"
#include "daemon/log/logger.h"
#include "daemon/wire/memory_source.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::assets {

struct AssetLimits {
  uint64_t max_asset_bytes = 256u << 20;  // of one
  uint64_t max_bytes = 512u << 20;        // of all
  uint64_t max_assets = 4096;             // whole ones and parts
  size_t max_uploads = 16;                // under way at once
  // An upload that brought nothing for so long gives way to another of the same content, to one beyond
  // max_uploads, and to whoever needs its room.
  sync::TimeNs idle_limit_ns = 30 * sync::kSecond;
};

struct AssetState {
  std::string digest;
  uint64_t stored = 0;  // bytes that are here
  bool complete = false;
};

// Thread-safe; Begin, Append, Finish and Abandon one at a time. What a function is given as a digest has
// 32 bytes.
class AssetStore final : public wire::AssetSource {
 public:
  using UploadId = uint64_t;
  // Of the budget an asset has at least this: what knowing of it costs, and a disk's block.
  static constexpr uint64_t kLeastCost = 4096;

  // Reads what the folder has, which is made (mode 0700) if it is not there; empty: none. One that cannot
  // be used is logged, and told by figures(): assets are in memory then. Clock and log outlive the store;
  // the log may be none.
  static std::unique_ptr<AssetStore> Open(const std::string& folder, const AssetLimits& limits,
                                          sync::Clock& clock, Logger* log);

  // Content of `size` bytes is brought from `offset` on, which is 0 (anew) or where what is here ends.
  // Makes room. AlreadyExists: it is here. InvalidArgument, OutOfRange: size or offset is wrong.
  // Aborted: another upload of it is under way. ResourceExhausted: uploads under way leave no room, or
  // are as many as there may be; or the disk is full. Unavailable: it fails. Where it fails nothing of
  // others has gone.
  absl::StatusOr<UploadId> Begin(std::string_view digest, uint64_t size, uint64_t offset);

  // The next bytes, one at least. InvalidArgument: there are none. OutOfRange: `offset` is not where the
  // last ones ended, or there are more than were said. Aborted: the upload brought nothing for long, and
  // gave way. ResourceExhausted, Unavailable: they cannot be written; the upload is over.
  absl::Status Append(UploadId upload, uint64_t offset, std::string_view bytes);

  // All has been brought. OutOfRange: it has not; what is here stays. DataLoss: it has another hash, and
  // is gone. Answers the size.
  absl::StatusOr<uint64_t> Finish(UploadId upload);

  // Ends an upload; what it brought stays. One that has ended is none.
  void Abandon(UploadId upload);

  // Something has come for it, and waits to be appended. Any thread.
  void Heard(UploadId upload);

  absl::StatusOr<wire::MappedRange> FindAsset(std::string_view digest, uint64_t offset,
                                              uint64_t size) override;

  // Those, or all that are here, what was used most recently first.
  std::vector<AssetState> List(std::span<const std::string> digests) const;
  std::vector<AssetState> ListAll() const;

  AssetFigures figures() const;

 private:
  struct Asset {
    uint64_t size = 0;  // as it was said; when no upload is under way what is here
    uint64_t stored = 0;
    bool complete = false;
    bool checked = false;            // since the start
    uint64_t used = 0;               // a number that grows with each use
    UploadId brought = 0;            // by whom it is whole; 0: it was at the start
    UploadId upload = 0;             // under way; 0: none
    sync::TimeNs heard = 0;          // of it
    std::shared_ptr<char[]> memory;  // without a folder, of `size` bytes
  };
  using Assets = std::map<std::string, Asset, std::less<>>;
  using Paths = std::vector<std::string>;

  AssetStore(const AssetLimits& limits, sync::Clock& clock, Logger* log)
      : limits_(limits), clock_(clock), log_(log) {}
  absl::Status ReadFolder(const std::string& folder);
  std::string PathOf(std::string_view digest, bool complete) const;

  // Those that make or take away Assets add the files that are to be removed without the lock.
  bool IsIdle(const Asset& asset) const VOXELD_REQUIRES(mutex_);
  absl::Status MakeRoom(std::string_view digest, uint64_t cost, uint64_t more, Paths* gone)
      VOXELD_REQUIRES(mutex_);
  absl::StatusOr<Assets::iterator> UploadToDisplace() VOXELD_REQUIRES(mutex_);
  Assets::iterator FindUpload(UploadId upload) VOXELD_REQUIRES(mutex_);
  Assets::iterator FindWhole(std::string_view digest) VOXELD_REQUIRES(mutex_);
  void SetSize(Asset* asset, uint64_t size) VOXELD_REQUIRES(mutex_);
  void EndUpload(Assets::iterator at, Paths* gone) VOXELD_REQUIRES(mutex_);
  void Drop(Assets::iterator at, Paths* gone) VOXELD_REQUIRES(mutex_);
  absl::StatusOr<UploadId> Admit(std::string_view digest, uint64_t size, uint64_t offset,
                                 Paths* gone) VOXELD_EXCLUDES(mutex_);

  // Of a whole one in the folder: hashes it, unless that has been done. False: it was damaged, or is gone.
  absl::StatusOr<bool> Check(std::string_view digest) VOXELD_EXCLUDES(mutex_, check_mutex_);
  // Unless another has brought it anew meanwhile.
  void DropDamaged(std::string_view digest, UploadId brought) VOXELD_EXCLUDES(mutex_);

  std::string folder_;  // constant once it is open
  const AssetLimits limits_;
  sync::Clock& clock_;
  Logger* const log_;

  std::map<UploadId, AssetFile> files_;  // of uploads, with a folder; theirs who bring them

  sync::Mutex check_mutex_;  // one is hashed at a time; before mutex_
  mutable sync::Mutex mutex_;
  Assets assets_ VOXELD_GUARDED_BY(mutex_);
  std::map<UploadId, std::string> uploads_ VOXELD_GUARDED_BY(mutex_);  // their digests
  uint64_t reserved_ VOXELD_GUARDED_BY(mutex_) = 0;                    // sum of the costs
  uint64_t uses_ VOXELD_GUARDED_BY(mutex_) = 0;
  UploadId last_upload_ VOXELD_GUARDED_BY(mutex_) = 0;
  AssetFigures figures_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace voxeld::daemon::assets
