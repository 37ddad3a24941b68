// Stores content by its hash (voxeld.v1.SceneService.UploadAsset). Content is uploaded once, in
// pieces, and any number of requests can refer to it.
//
//   uploads   can be interrupted and resumed after the last piece that arrived: incomplete assets
//             are stored like complete ones
//   complete  only if the hash matches: it is compared when the last byte arrives, and again when
//             the asset is first used after a start
//   budget    covers complete assets, incomplete ones, and the announced sizes of running uploads.
//             The least recently used assets are dropped; running uploads are not
//   a folder  preserves assets across restarts. They are on the disk before Finish returns:
//             <sha256>, and <sha256>.part if incomplete. Other files are left alone. Without a
//             folder assets are in memory
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
  uint64_t max_asset_bytes = 256u << 20;  // of one asset
  uint64_t max_bytes = 512u << 20;        // of all assets together
  uint64_t max_assets = 4096;             // complete and incomplete
  size_t max_uploads = 16;                // running at once
  // An upload that has sent nothing for this long can be displaced: by another upload of the same
  // content, by one beyond max_uploads, or when its space is needed.
  sync::TimeNs idle_limit_ns = 30 * sync::kSecond;
};

struct AssetState {
  std::string digest;
  uint64_t stored = 0;  // bytes received so far
  bool complete = false;
};

// Thread-safe, except that Begin, Append, Finish and Abandon must not run concurrently. Digests
// must have 32 bytes.
class AssetStore final : public wire::AssetSource {
 public:
  using UploadId = uint64_t;
  // Minimum charge of an asset against the budget: its bookkeeping and one disk block.
  static constexpr uint64_t kLeastCost = 4096;

  // Reads the folder, and creates it (mode 0700) if it does not exist; an empty path means none. If
  // the folder is unusable, this is logged and reported by figures(), and assets are kept in
  // memory. The clock and the log must outlive the store; the log may be null.
  static std::unique_ptr<AssetStore> Open(const std::string& folder, const AssetLimits& limits,
                                          sync::Clock& clock, Logger* log);

  // Starts an upload of `size` bytes at `offset`, which is 0 (from the start) or the number of
  // bytes already stored. Makes room. Errors: AlreadyExists if the asset is complete;
  // InvalidArgument or OutOfRange if the size or offset is wrong; Aborted if another upload of it
  // is running; ResourceExhausted if running uploads leave no room, their number is at its limit,
  // or the disk is full; Unavailable if reading or opening a file fails. A refused upload
  // drops no other asset.
  absl::StatusOr<UploadId> Begin(std::string_view digest, uint64_t size, uint64_t offset);

  // Appends the next bytes. Errors: InvalidArgument if `bytes` is empty; OutOfRange if `offset` is
  // not where the last piece ended, or if the announced size would be exceeded; Aborted if the
  // upload was idle and has been displaced; ResourceExhausted or Unavailable if the bytes cannot be
  // written, which ends the upload.
  absl::Status Append(UploadId upload, uint64_t offset, std::string_view bytes);

  // Completes the upload. Returns: the size. Errors: OutOfRange if bytes are missing, which keeps
  // the stored ones; DataLoss if the hash differs, which drops the asset.
  absl::StatusOr<uint64_t> Finish(UploadId upload);

  // Ends an upload and keeps its bytes. Does nothing if the upload has already ended.
  void Abandon(UploadId upload);

  // Reports that a piece has arrived and waits to be appended. May be called on any thread.
  void Heard(UploadId upload);

  absl::StatusOr<wire::MappedRange> FindAsset(std::string_view digest, uint64_t offset,
                                              uint64_t size) override;

  // Returns: the states of these assets, in this order. ListAll returns all stored ones, most
  // recently used first.
  std::vector<AssetState> List(std::span<const std::string> digests) const;
  std::vector<AssetState> ListAll() const;

  AssetFigures figures() const;

 private:
  struct Asset {
    uint64_t size = 0;  // announced size; without a running upload the stored size
    uint64_t stored = 0;
    bool complete = false;
    bool checked = false;            // since the start
    uint64_t used = 0;               // increases with each use
    UploadId brought = 0;            // the upload that completed it; 0: it existed at the start
    UploadId upload = 0;             // the running upload; 0: none
    sync::TimeNs heard = 0;          // when the upload last sent something
    std::shared_ptr<char[]> memory;  // without a folder: `size` bytes
  };
  using Assets = std::map<std::string, Asset, std::less<>>;
  using Paths = std::vector<std::string>;

  AssetStore(const AssetLimits& limits, sync::Clock& clock, Logger* log)
      : limits_(limits), clock_(clock), log_(log) {}
  absl::Status ReadFolder(const std::string& folder);
  std::string PathOf(std::string_view digest, bool complete) const;

  // Functions that add or drop Assets collect the files to remove in `gone`. Remove these without
  // the lock.
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

  // Hashes a complete asset in the folder, unless that has been done since the start. Returns:
  // false if it is damaged or missing.
  absl::StatusOr<bool> Check(std::string_view digest) VOXELD_EXCLUDES(mutex_, check_mutex_);
  // Drops the asset unless a newer upload has replaced it.
  void DropDamaged(std::string_view digest, UploadId brought) VOXELD_EXCLUDES(mutex_);

  std::string folder_;  // constant after Open
  const AssetLimits limits_;
  sync::Clock& clock_;
  Logger* const log_;

  std::map<UploadId, AssetFile> files_;  // of uploads, with a folder; only their thread uses it

  sync::Mutex check_mutex_;  // one asset is hashed at a time; lock before mutex_
  mutable sync::Mutex mutex_;
  Assets assets_ VOXELD_GUARDED_BY(mutex_);
  std::map<UploadId, std::string> uploads_ VOXELD_GUARDED_BY(mutex_);  // digests
  uint64_t reserved_ VOXELD_GUARDED_BY(mutex_) = 0;                    // sum of the costs
  uint64_t uses_ VOXELD_GUARDED_BY(mutex_) = 0;
  UploadId last_upload_ VOXELD_GUARDED_BY(mutex_) = 0;
  AssetFigures figures_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace voxeld::daemon::assets
