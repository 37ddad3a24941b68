#include "daemon/assets/asset_store.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <functional>
#include <optional>
#include <system_error>
#include <tuple>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"

namespace voxeld::daemon::assets {
namespace {

constexpr absl::string_view kPart = ".part";

std::string Hex(std::string_view digest) {
  return absl::BytesToHexString(absl::string_view(digest.data(), digest.size()));
}

uint64_t CostOf(uint64_t size) { return std::max(size, AssetStore::kLeastCost); }

// Parses a file name that the store has assigned. Returns: nothing for any other name.
struct Name {
  std::string digest;
  bool complete = false;
};
std::optional<Name> ReadName(absl::string_view name) {
  const bool part = absl::ConsumeSuffix(&name, kPart);
  const auto is_hex = [](char c) { return absl::ascii_isdigit(c) || (c >= 'a' && c <= 'f'); };
  if (name.size() != 2 * wire::AssetSource::kDigestBytes || !std::ranges::all_of(name, is_hex))
    return std::nullopt;
  return Name{absl::HexStringToBytes(name), !part};
}

absl::Status Because(const absl::Status& status, std::string_view digest) {
  return absl::Status(status.code(), absl::StrCat("asset ", Hex(digest), " ", status.message()));
}

void RemoveFiles(const std::vector<std::string>& paths) {
  for (const std::string& path : paths) (void)unlink(path.c_str());
}

absl::Status GaveWay() {
  return absl::AbortedError(
      "the upload brought nothing for long, and another had its place or its room; ask ListAssets "
      "where to go on");
}

}  // namespace

std::unique_ptr<AssetStore> AssetStore::Open(const std::string& folder, const AssetLimits& limits,
                                             sync::Clock& clock, Logger* log) {
  std::unique_ptr<AssetStore> store(new AssetStore(limits, clock, log));
  if (folder.empty()) return store;
  if (absl::Status status = store->ReadFolder(folder); !status.ok()) {
    const std::string why = absl::StrCat(std::string(status.message()),
                                         "; assets are in memory, and go with the daemon");
    if (log != nullptr) log->Error("the folder of assets cannot be used", {{"why", why}});
    sync::MutexLock lock(store->mutex_);
    store->figures_.trouble = why;
  }
  return store;
}

std::string AssetStore::PathOf(std::string_view digest, bool complete) const {
  return absl::StrCat(folder_, "/", Hex(digest), complete ? "" : kPart);
}

absl::Status AssetStore::ReadFolder(const std::string& folder) {
  const auto failed = [&folder](const std::error_code& error) {
    return absl::UnavailableError(absl::StrCat(folder, ": ", error.message()));
  };
  if ((mkdir(folder.c_str(), S_IRWXU) != 0 && errno != EEXIST) ||
      access(folder.c_str(), R_OK | W_OK | X_OK) != 0) {
    return failed(std::error_code(errno, std::generic_category()));
  }
  struct Found {
    std::pair<time_t, long> used;
    Name name;
    uint64_t size = 0;
  };
  std::vector<Found> found;
  std::error_code error;
  for (std::filesystem::directory_iterator at(folder, error), end; !error && at != end;
       at.increment(error)) {
    auto name = ReadName(at->path().filename().string());
    struct stat file = {};
    (void)lstat(at->path().c_str(), &file);
    if (!name.has_value() || !S_ISREG(file.st_mode)) continue;
    found.push_back({{file.st_mtim.tv_sec, file.st_mtim.tv_nsec},
                     *std::move(name),
                     static_cast<uint64_t>(file.st_size)});
  }
  if (error) return failed(error);
  std::ranges::sort(found, {}, [](const Found& f) { return std::tie(f.used, f.name.digest); });
  folder_ = folder;

  Paths gone;
  {
    sync::MutexLock lock(mutex_);
    for (const auto& [used, name, size] : found) {
      Asset& asset = assets_[name.digest];
      const bool better = name.complete || !asset.complete;
      if (size == 0 || !better) gone.push_back(PathOf(name.digest, name.complete));
      if (size == 0 || !better) continue;
      if (asset.stored > 0) gone.push_back(PathOf(name.digest, false));
      SetSize(&asset, size);
      asset.stored = size;
      asset.complete = name.complete;
      asset.used = ++uses_;
    }
    std::erase_if(assets_, [](const auto& entry) { return entry.second.stored == 0; });
    (void)MakeRoom("", 0, 0, &gone);  // if the limits are lower than before
  }
  RemoveFiles(gone);
  return absl::OkStatus();
}

bool AssetStore::IsIdle(const Asset& asset) const {
  return asset.upload == 0 || clock_.Now() - asset.heard >= limits_.idle_limit_ns;
}

void AssetStore::SetSize(Asset* asset, uint64_t size) {
  if (asset->size > 0) reserved_ -= CostOf(asset->size);
  if (size > 0) reserved_ += CostOf(size);
  asset->size = size;
}

void AssetStore::Drop(Assets::iterator at, Paths* gone) {
  uploads_.erase(at->second.upload);
  SetSize(&at->second, 0);
  if (!folder_.empty()) gone->push_back(PathOf(at->first, at->second.complete));
  assets_.erase(at);
}

void AssetStore::EndUpload(Assets::iterator at, Paths* gone) {
  Asset& asset = at->second;
  uploads_.erase(std::exchange(asset.upload, 0));
  if (asset.stored == 0) return Drop(at, gone);
  if (!asset.complete) SetSize(&asset, asset.stored);
}

absl::Status AssetStore::MakeRoom(std::string_view digest, uint64_t cost, uint64_t more,
                                  Paths* gone) {
  std::vector<Assets::iterator> idle;
  for (auto at = assets_.begin(); at != assets_.end(); ++at) {
    if (at->first != digest && IsIdle(at->second)) idle.push_back(at);
  }
  std::ranges::sort(idle, {}, [](Assets::iterator at) { return at->second.used; });
  uint64_t bytes = reserved_ + cost, count = assets_.size() + more;
  size_t goes = 0;
  const auto fits = [&] { return bytes <= limits_.max_bytes && count <= limits_.max_assets; };
  for (; !fits() && goes < idle.size(); ++goes, --count) bytes -= CostOf(idle[goes]->second.size);
  if (!fits()) {
    return absl::ResourceExhaustedError(
        absl::StrCat(cost, " bytes more do not fit beside ", bytes - cost, " of ", count - more,
                     " uploads under way; max_assets_bytes allows ", limits_.max_bytes,
                     ", max_assets ", limits_.max_assets, ": try again when they are done"));
  }
  for (size_t i = 0; i < goes; ++i) Drop(idle[i], gone);
  figures_.evicted += goes;
  return absl::OkStatus();
}

absl::StatusOr<AssetStore::Assets::iterator> AssetStore::UploadToDisplace() {
  if (uploads_.size() < limits_.max_uploads) return assets_.end();
  auto idle = assets_.end();
  for (const auto& [id, digest] : uploads_) {
    const auto at = assets_.find(digest);
    if (!IsIdle(at->second)) continue;
    if (idle == assets_.end() || at->second.heard < idle->second.heard) idle = at;
  }
  if (idle != assets_.end()) return idle;
  return absl::ResourceExhaustedError(absl::StrCat(
      uploads_.size(), " uploads are under way, which is the most; try again when one is done"));
}

absl::StatusOr<AssetStore::UploadId> AssetStore::Admit(std::string_view digest, uint64_t size,
                                                       uint64_t offset, Paths* gone) {
  sync::MutexLock lock(mutex_);
  auto at = assets_.find(digest);
  const uint64_t stored = at == assets_.end() ? 0 : at->second.stored;
  if (at != assets_.end() && !IsIdle(at->second)) {
    return absl::AbortedError(
        absl::StrCat("another upload of asset ", Hex(digest),
                     " is under way; ask ListAssets how far it is, and wait, or try again"));
  }
  if (offset != 0 && (offset != stored || offset >= size)) {
    return absl::OutOfRangeError(
        stored < size
            ? absl::StrCat("offset is ", offset, ", and ", stored,
                           " bytes of it are here; go on at ", stored, ", or begin anew at 0")
            : absl::StrCat("offset is ", offset, ", and ", stored, " bytes are here for a size of ",
                           size, "; begin anew at 0"));
  }
  const absl::StatusOr<Assets::iterator> displaced = UploadToDisplace();
  if (!displaced.ok()) return displaced.status();
  const uint64_t had = at == assets_.end() ? 0 : CostOf(at->second.size);
  const uint64_t cost = CostOf(size) > had ? CostOf(size) - had : 0;
  if (absl::Status status = MakeRoom(digest, cost, at == assets_.end() ? 1 : 0, gone);
      !status.ok()) {
    return status;
  }
  // If MakeRoom has dropped the displaced upload, the count is already below the limit.
  if (uploads_.size() >= limits_.max_uploads) EndUpload(*displaced, gone);
  at = assets_.try_emplace(std::string(digest)).first;
  Asset& asset = at->second;
  uploads_.erase(asset.upload);
  if (offset == 0) asset.stored = 0;
  if (folder_.empty() && (asset.memory == nullptr || asset.size != size)) {
    const std::shared_ptr<char[]> memory = std::make_shared_for_overwrite<char[]>(size);
    if (asset.stored > 0) std::memcpy(memory.get(), asset.memory.get(), asset.stored);
    asset.memory = memory;
  }
  SetSize(&asset, size);
  asset.used = ++uses_;
  asset.heard = clock_.Now();
  asset.upload = ++last_upload_;
  uploads_[asset.upload] = std::string(digest);
  return asset.upload;
}

absl::StatusOr<AssetStore::UploadId> AssetStore::Begin(std::string_view digest, uint64_t size,
                                                       uint64_t offset) {
  bool whole = false;
  {
    sync::MutexLock lock(mutex_);
    const auto at = FindWhole(digest);
    whole = at != assets_.end();
    if (whole) at->second.used = ++uses_;
  }
  if (whole) {
    const absl::StatusOr<bool> right = Check(digest);
    if (!right.ok()) return Because(right.status(), digest);
    if (*right) return absl::AlreadyExistsError("it is here");
  }
  const uint64_t most = std::min(limits_.max_asset_bytes, limits_.max_bytes);
  if (size == 0 || size > most) {
    return absl::InvalidArgumentError(absl::StrCat("size is ", size, "; an asset has 1 to ", most,
                                                   limits_.max_asset_bytes <= limits_.max_bytes
                                                       ? " bytes, which is max_asset_bytes"
                                                       : " bytes, which is max_assets_bytes"));
  }
  Paths gone;
  const absl::StatusOr<UploadId> upload = Admit(digest, size, offset, &gone);
  RemoveFiles(gone);
  if (!upload.ok() || folder_.empty()) return upload;
  absl::StatusOr<AssetFile> file = AssetFile::Open(PathOf(digest, false), offset == 0);
  if (!file.ok()) {
    Abandon(*upload);
    return Because(file.status(), digest);
  }
  files_.emplace(*upload, *std::move(file));
  return upload;
}

AssetStore::Assets::iterator AssetStore::FindUpload(UploadId upload) {
  const auto at = uploads_.find(upload);
  return at == uploads_.end() ? assets_.end() : assets_.find(at->second);
}

AssetStore::Assets::iterator AssetStore::FindWhole(std::string_view digest) {
  const auto at = assets_.find(digest);
  return at == assets_.end() || at->second.complete ? at : assets_.end();
}

absl::Status AssetStore::Append(UploadId upload, uint64_t offset, std::string_view bytes) {
  std::string digest;
  std::shared_ptr<char[]> memory;
  {
    sync::MutexLock lock(mutex_);
    const auto at = FindUpload(upload);
    if (at == assets_.end()) return GaveWay();
    const Asset& asset = at->second;
    if (bytes.empty()) {
      return absl::InvalidArgumentError("a piece is empty; each brings one byte or more");
    }
    if (offset != asset.stored) {
      return absl::OutOfRangeError(absl::StrCat("offset is ", offset, " after ", asset.stored,
                                                " bytes; pieces follow one another"));
    }
    if (bytes.size() > asset.size - asset.stored) {
      return absl::OutOfRangeError(absl::StrCat("the piece at ", offset, " has ", bytes.size(),
                                                " bytes, and the size was said to be ",
                                                asset.size));
    }
    digest = at->first;
    memory = asset.memory;
  }
  absl::Status written;
  if (folder_.empty()) {
    std::memcpy(memory.get() + offset, bytes.data(), bytes.size());
  } else {
    written = files_.at(upload).Write(offset, bytes);
  }
  if (!written.ok()) {
    Abandon(upload);
    return Because(written, digest);
  }
  sync::MutexLock lock(mutex_);
  // The asset still exists: only this thread ends running uploads.
  Asset& asset = assets_.find(digest)->second;
  asset.stored += bytes.size();
  asset.heard = clock_.Now();
  figures_.bytes_in += bytes.size();
  return absl::OkStatus();
}

absl::StatusOr<uint64_t> AssetStore::Finish(UploadId upload) {
  std::string digest;
  uint64_t size = 0, stored = 0;
  std::shared_ptr<char[]> memory;
  {
    sync::MutexLock lock(mutex_);
    const auto at = FindUpload(upload);
    if (at == assets_.end()) return GaveWay();
    digest = at->first;
    size = at->second.size;
    stored = at->second.stored;
    memory = at->second.memory;
  }
  if (stored < size) {
    Abandon(upload);
    return absl::OutOfRangeError(
        absl::StrCat("the upload ends after ", stored, " of ", size, " bytes; go on there"));
  }
  const absl::StatusOr<std::string> hash = folder_.empty()
                                               ? HashBytes({memory.get(), size})
                                               : HashAssetFile(PathOf(digest, false), size);
  const bool right = hash.ok() && *hash == digest;
  absl::Status kept = hash.status();
  if (right && !folder_.empty()) kept = files_.at(upload).Keep(PathOf(digest, true));
  files_.erase(upload);

  Paths gone;
  absl::Status result;
  {
    sync::MutexLock lock(mutex_);
    const auto at = assets_.find(digest);
    if (!kept.ok()) {
      EndUpload(at, &gone);
      result = Because(kept, digest);
    } else if (!right) {
      Drop(at, &gone);
      result = absl::DataLossError(absl::StrCat("what came has the SHA-256 ", Hex(*hash),
                                                " and was said to have ", Hex(digest),
                                                "; it is not kept: send it anew"));
    } else {
      at->second.complete = at->second.checked = true;
      at->second.brought = upload;
      EndUpload(at, &gone);
      ++figures_.uploaded;
    }
  }
  RemoveFiles(gone);
  if (!result.ok()) return result;
  return size;
}

void AssetStore::Abandon(UploadId upload) {
  files_.erase(upload);
  Paths gone;
  {
    sync::MutexLock lock(mutex_);
    const auto at = FindUpload(upload);
    if (at != assets_.end()) EndUpload(at, &gone);
  }
  RemoveFiles(gone);
}

void AssetStore::Heard(UploadId upload) {
  sync::MutexLock lock(mutex_);
  const auto at = FindUpload(upload);
  if (at != assets_.end()) at->second.heard = clock_.Now();
}

void AssetStore::DropDamaged(std::string_view digest, UploadId brought) {
  {
    sync::MutexLock lock(mutex_);
    const auto at = FindWhole(digest);
    if (at == assets_.end() || at->second.brought != brought) return;
    ++figures_.damaged;
    Paths gone;
    Drop(at, &gone);
    RemoveFiles(gone);  // before a new upload can create them again
  }
  if (log_ != nullptr) {
    log_->Error("an asset was damaged, and is gone", {{"sha256", Hex(digest)}});
  }
}

absl::StatusOr<bool> AssetStore::Check(std::string_view digest) {
  if (folder_.empty()) return true;
  sync::MutexLock one(check_mutex_);
  uint64_t size = 0;
  UploadId brought = 0;
  {
    sync::MutexLock lock(mutex_);
    const auto at = FindWhole(digest);
    if (at == assets_.end()) return false;
    if (at->second.checked) return true;
    size = at->second.size;
    brought = at->second.brought;
  }
  const absl::StatusOr<std::string> hash = HashAssetFile(PathOf(digest, true), size);
  if (!hash.ok() && !absl::IsOutOfRange(hash.status())) return hash.status();
  if (!hash.ok() || *hash != digest) {
    DropDamaged(digest, brought);
    return false;
  }
  sync::MutexLock lock(mutex_);
  const auto at = FindWhole(digest);
  if (at != assets_.end()) at->second.checked = true;
  return true;
}

absl::StatusOr<wire::MappedRange> AssetStore::FindAsset(std::string_view digest, uint64_t offset,
                                                        uint64_t size) {
  const auto missing = [&digest](absl::string_view why) {
    return absl::NotFoundError(absl::StrCat("is ", Hex(digest), ", which is ", why));
  };
  Asset asset;
  {
    sync::MutexLock lock(mutex_);
    const auto at = assets_.find(digest);
    if (at == assets_.end()) return missing("not here, or not any more; bring it by UploadAsset");
    if (at->second.complete) at->second.used = ++uses_;
    asset = at->second;
  }
  if (!asset.complete) {
    return missing(absl::StrCat("not whole: ", asset.stored, " bytes are here; bring the rest"));
  }
  if (offset > asset.size || size > asset.size - offset) {
    return absl::OutOfRangeError(
        absl::StrCat("is ", size, " from ", offset, " on; the asset has ", asset.size, " bytes"));
  }
  if (folder_.empty()) {
    return wire::MappedRange{{asset.memory.get() + offset, size}, asset.memory};
  }
  const std::string path = PathOf(digest, true);
  const absl::StatusOr<bool> right = Check(digest);
  if (!right.ok()) return right.status();
  absl::StatusOr<wire::MappedRange> bytes = absl::OutOfRangeError("");
  if (*right) bytes = ReadAssetFile(path, offset, size);
  if (absl::IsOutOfRange(
          bytes.status())) {  // truncated while the daemon was running, or removed to make room
    DropDamaged(digest, asset.brought);
    return missing("damaged on the disk, or gone meanwhile; bring it anew by UploadAsset");
  }
  if (bytes.ok()) TouchAssetFile(path);
  return bytes;
}

std::vector<AssetState> AssetStore::List(std::span<const std::string> digests) const {
  sync::MutexLock lock(mutex_);
  std::vector<AssetState> out;
  out.reserve(digests.size());
  for (const std::string& digest : digests) {
    const auto at = assets_.find(digest);
    out.push_back({digest, 0, false});
    if (at != assets_.end()) out.back() = {digest, at->second.stored, at->second.complete};
  }
  return out;
}

std::vector<AssetState> AssetStore::ListAll() const {
  std::vector<std::pair<uint64_t, AssetState>> all;
  {
    sync::MutexLock lock(mutex_);
    for (const auto& [digest, asset] : assets_) {
      all.push_back({asset.used, {digest, asset.stored, asset.complete}});
    }
  }
  std::ranges::sort(all, std::greater(), [](const auto& entry) { return entry.first; });
  std::vector<AssetState> out;
  out.reserve(all.size());
  for (auto& [used, state] : all) out.push_back(std::move(state));
  return out;
}

AssetFigures AssetStore::figures() const {
  sync::MutexLock lock(mutex_);
  AssetFigures figures = figures_;
  figures.count = static_cast<uint64_t>(
      std::ranges::count_if(assets_, [](const auto& entry) { return entry.second.complete; }));
  figures.bytes = reserved_;
  return figures;
}

}  // namespace voxeld::daemon::assets
