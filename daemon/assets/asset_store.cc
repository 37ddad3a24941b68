#include "daemon/assets/asset_store.h"

#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <optional>
#include <system_error>
#include <tuple>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"

namespace voxeld::daemon::assets {
namespace {

constexpr absl::string_view kPart = ".part";
constexpr size_t kDigestBytes = 32;

std::string Hex(std::string_view digest) {
  return absl::BytesToHexString(absl::string_view(digest.data(), digest.size()));
}

// A file's name as the store gives it; nothing: it is none of ours.
struct Name {
  std::string digest;
  bool complete = false;
};
std::optional<Name> ReadName(absl::string_view name) {
  const bool part = absl::ConsumeSuffix(&name, kPart);
  if (name.size() != 2 * kDigestBytes || !std::ranges::all_of(name, [](char c) {
        return absl::ascii_isdigit(c) || (c >= 'a' && c <= 'f');
      })) {
    return std::nullopt;
  }
  return Name{absl::HexStringToBytes(name), !part};
}

absl::Status Because(const absl::Status& status, std::string_view digest) {
  return absl::Status(status.code(), absl::StrCat("asset ", Hex(digest), " ", status.message()));
}

}  // namespace

absl::StatusOr<std::unique_ptr<AssetStore>> AssetStore::Open(const std::string& folder,
                                                             const AssetLimits& limits,
                                                             sync::Clock& clock, Logger* log) {
  std::unique_ptr<AssetStore> store(new AssetStore(folder, limits, clock, log));
  if (absl::Status status = store->ReadFolder(); !status.ok()) return status;
  return store;
}

std::string AssetStore::PathOf(std::string_view digest, bool complete) const {
  if (folder_.empty()) return "";
  return absl::StrCat(folder_, "/", Hex(digest), complete ? "" : kPart);
}

absl::Status AssetStore::ReadFolder() {
  if (folder_.empty()) return absl::OkStatus();
  const auto failed = [this](const std::error_code& error) {
    return absl::UnavailableError(
        absl::StrCat("the folder of assets, ", folder_, ", cannot be used: ", error.message()));
  };
  std::error_code error;
  if (mkdir(folder_.c_str(), S_IRWXU) != 0 && errno != EEXIST) {
    return failed(std::error_code(errno, std::generic_category()));
  }
  struct Found {
    std::filesystem::file_time_type used;
    Name name;
  };
  std::vector<Found> found;
  for (std::filesystem::directory_iterator at(folder_, error), end; !error && at != end;
       at.increment(error)) {
    const std::string name = at->path().filename();
    std::error_code gone;
    const auto used = at->last_write_time(gone);
    if (auto read = ReadName(name); read.has_value() && !gone) {
      found.push_back({used, *std::move(read)});
    }
  }
  if (error) return failed(error);
  std::ranges::sort(found, {}, [](const Found& f) { return std::tie(f.used, f.name.digest); });

  sync::MutexLock lock(mutex_);
  for (const auto& [used, name] : found) {
    uint64_t size = 0;
    auto file = AssetFile::Open(PathOf(name.digest, name.complete), &size);
    if (!file.ok()) {
      if (log_ != nullptr) {
        log_->Warn("an asset cannot be had",
                   {{"sha256", Hex(name.digest)}, {"why", std::string(file.status().message())}});
      }
      continue;
    }
    auto& asset = assets_[name.digest];
    if (asset.file != nullptr && asset.complete) {  // and a part of it
      (*file)->Remove();
      continue;
    }
    reserved_ += size - asset.size;
    if (asset.file != nullptr) asset.file->Remove();
    asset = {.file = *std::move(file),
             .size = size,
             .stored = size,
             .complete = name.complete,
             .used = ++uses_};
  }
  return MakeRoom("", 0);
}

bool AssetStore::IsIdle(const Asset& asset) const {
  return asset.upload == 0 || clock_.Now() - asset.heard >= limits_.idle_limit_ns;
}

void AssetStore::Drop(Assets::iterator at) {
  reserved_ -= at->second.size;
  at->second.file->Remove();
  assets_.erase(at);
}

absl::Status AssetStore::MakeRoom(std::string_view digest, uint64_t bytes) {
  while (reserved_ + bytes > limits_.max_bytes) {
    auto oldest = assets_.end();
    for (auto at = assets_.begin(); at != assets_.end(); ++at) {
      if (at->first == digest || !IsIdle(at->second)) continue;
      if (oldest == assets_.end() || at->second.used < oldest->second.used) oldest = at;
    }
    if (oldest == assets_.end()) {
      return absl::ResourceExhaustedError(
          absl::StrCat(bytes, " bytes more do not fit beside ", reserved_,
                       " of uploads under way; max_assets_bytes allows ", limits_.max_bytes,
                       ": try again when they are done"));
    }
    ++figures_.evicted;
    Drop(oldest);
  }
  return absl::OkStatus();
}

absl::Status AssetStore::CheckUploads() {
  size_t under_way = 0;
  Asset* idle = nullptr;
  for (auto& [digest, asset] : assets_) {
    if (asset.upload == 0) continue;
    ++under_way;
    if (IsIdle(asset) && (idle == nullptr || asset.heard < idle->heard)) idle = &asset;
  }
  if (under_way < limits_.max_uploads) return absl::OkStatus();
  if (idle == nullptr) {
    return absl::ResourceExhaustedError(absl::StrCat(
        under_way, " uploads are under way, which is the most; try again when one is done"));
  }
  idle->upload = 0;
  return absl::OkStatus();
}

absl::StatusOr<AssetStore::UploadId> AssetStore::Begin(std::string_view digest, uint64_t size,
                                                       uint64_t offset) {
  sync::MutexLock lock(mutex_);
  auto at = assets_.find(digest);
  const bool known = at != assets_.end();
  if (known && at->second.complete) {
    at->second.used = ++uses_;
    at->second.file->Touch();
    return absl::AlreadyExistsError("it is here");
  }
  const uint64_t most = std::min(limits_.max_asset_bytes, limits_.max_bytes);
  if (size == 0 || size > most) {
    return absl::InvalidArgumentError(absl::StrCat("size is ", size, "; an asset has 1 to ", most,
                                                   limits_.max_asset_bytes <= limits_.max_bytes
                                                       ? " bytes, which is max_asset_bytes"
                                                       : " bytes, which is max_assets_bytes"));
  }
  if (known && !IsIdle(at->second)) {
    return absl::AbortedError(
        absl::StrCat("another upload of asset ", Hex(digest),
                     " is under way; ask ListAssets how far it is, and wait, or try again"));
  }
  const uint64_t stored = known ? at->second.stored : 0;
  if (offset != 0 && (offset != stored || offset > size)) {
    return absl::OutOfRangeError(absl::StrCat("offset is ", offset, ", and ", stored,
                                              " bytes of it are here; go on at ", stored,
                                              ", or begin anew at 0"));
  }
  if (absl::Status status = CheckUploads(); !status.ok()) return status;
  const uint64_t had = known ? at->second.size : 0;
  if (size > had) {
    if (absl::Status status = MakeRoom(digest, size - had); !status.ok()) return status;
  }
  if (!known) {
    uint64_t there = 0;
    auto file = AssetFile::Open(PathOf(digest, false), &there);
    if (!file.ok()) return Because(file.status(), digest);
    at = assets_.emplace(std::string(digest), Asset{.file = *std::move(file)}).first;
  }
  Asset& asset = at->second;
  if (offset == 0) {
    if (absl::Status status = asset.file->Empty(); !status.ok()) return Because(status, digest);
    asset.stored = 0;
  }
  reserved_ += size - asset.size;
  asset.size = size;
  asset.used = ++uses_;
  asset.heard = clock_.Now();
  return asset.upload = ++last_upload_;
}

AssetStore::Assets::iterator AssetStore::FindUpload(UploadId upload) {
  return std::ranges::find_if(assets_, [upload](const auto& entry) {
    return upload != 0 && entry.second.upload == upload;
  });
}

absl::Status AssetStore::Append(UploadId upload, uint64_t offset, std::string_view bytes) {
  std::shared_ptr<AssetFile> file;
  std::string digest;
  {
    sync::MutexLock lock(mutex_);
    const auto at = FindUpload(upload);
    if (at == assets_.end()) {
      return absl::AbortedError(
          "another upload took this one's place, as it brought nothing for long; ask ListAssets "
          "where to go on");
    }
    Asset& asset = at->second;
    if (offset != asset.stored) {
      return absl::OutOfRangeError(absl::StrCat("offset is ", offset, " after ", asset.stored,
                                                " bytes; pieces follow one another"));
    }
    if (bytes.size() > asset.size - asset.stored) {
      return absl::OutOfRangeError(absl::StrCat("the piece at ", offset, " has ", bytes.size(),
                                                " bytes, and the size was said to be ",
                                                asset.size));
    }
    asset.heard = clock_.Now();
    file = asset.file;
    digest = at->first;
  }
  const absl::Status written = file->Write(offset, bytes);
  sync::MutexLock lock(mutex_);
  const auto at = FindUpload(upload);
  if (at == assets_.end()) return absl::AbortedError("its room was needed; begin anew");
  if (!written.ok()) {
    at->second.upload = 0;
    return Because(written, digest);
  }
  at->second.stored += bytes.size();
  at->second.heard = clock_.Now();
  figures_.bytes_in += bytes.size();
  return absl::OkStatus();
}

absl::StatusOr<uint64_t> AssetStore::Finish(UploadId upload) {
  std::shared_ptr<AssetFile> file;
  std::string digest;
  uint64_t size = 0;
  {
    sync::MutexLock lock(mutex_);
    const auto at = FindUpload(upload);
    if (at == assets_.end()) return absl::AbortedError("its room was needed; begin anew");
    Asset& asset = at->second;
    if (asset.stored < asset.size) {
      asset.upload = 0;
      return absl::OutOfRangeError(absl::StrCat("the upload ends after ", asset.stored, " of ",
                                                asset.size, " bytes; go on there"));
    }
    asset.heard = clock_.Now();
    file = asset.file;
    digest = at->first;
    size = asset.size;
  }
  const absl::StatusOr<std::string> hash = file->Hash(size);
  const bool right = hash.ok() && *hash == digest;
  absl::Status kept = hash.status();
  if (right) kept = file->Keep(PathOf(digest, true));

  sync::MutexLock lock(mutex_);
  const auto at = FindUpload(upload);
  if (at == assets_.end()) {
    file->Remove();  // also what has got another name meanwhile
    return absl::AbortedError("its room was needed; begin anew");
  }
  at->second.upload = 0;
  if (!kept.ok()) return Because(kept, digest);
  if (!right) {
    Drop(at);
    return absl::DataLossError(absl::StrCat("what came has the SHA-256 ", Hex(*hash),
                                            " and was said to have ", Hex(digest),
                                            "; it is not kept: send it anew"));
  }
  at->second.complete = at->second.checked = true;
  ++figures_.uploaded;
  return size;
}

void AssetStore::Abandon(UploadId upload) {
  sync::MutexLock lock(mutex_);
  const auto at = FindUpload(upload);
  if (at != assets_.end()) at->second.upload = 0;
}

absl::StatusOr<wire::MappedRange> AssetStore::FindAsset(std::string_view digest, uint64_t offset,
                                                        uint64_t size) {
  std::shared_ptr<AssetFile> file;
  uint64_t has = 0;
  bool checked = false;
  const auto missing = [&digest](absl::string_view why) {
    return absl::NotFoundError(absl::StrCat("is ", Hex(digest), ", which is ", why));
  };
  {
    sync::MutexLock lock(mutex_);
    const auto at = assets_.find(digest);
    if (at == assets_.end()) return missing("not here, or not any more; bring it by UploadAsset");
    Asset& asset = at->second;
    if (!asset.complete) {
      return missing(absl::StrCat("not whole: ", asset.stored, " bytes are here; bring the rest"));
    }
    asset.used = ++uses_;
    file = asset.file;
    has = asset.size;
    checked = asset.checked;
  }
  if (offset > has || size > has - offset) {
    return absl::OutOfRangeError(
        absl::StrCat("is ", size, " from ", offset, " on; the asset has ", has, " bytes"));
  }
  if (!checked) {
    const absl::StatusOr<std::string> hash = file->Hash(has);
    if (!hash.ok()) return hash.status();
    sync::MutexLock lock(mutex_);
    const auto at = assets_.find(digest);
    if (*hash != digest) {
      if (at != assets_.end() && at->second.file == file) Drop(at);
      ++figures_.damaged;
      if (log_ != nullptr)
        log_->Error("an asset was damaged, and is gone", {{"sha256", Hex(digest)}});
      return missing("damaged on the disk; bring it anew by UploadAsset");
    }
    if (at != assets_.end() && at->second.file == file) at->second.checked = true;
  }
  file->Touch();
  return file->Read(offset, size);
}

std::vector<AssetState> AssetStore::List(std::span<const std::string> digests) const {
  sync::MutexLock lock(mutex_);
  std::vector<AssetState> out;
  for (const std::string& digest : digests) {
    const auto at = assets_.find(digest);
    out.push_back({digest, 0, false});
    if (at != assets_.end()) out.back() = {digest, at->second.stored, at->second.complete};
  }
  return out;
}

std::vector<AssetState> AssetStore::ListAll() const {
  sync::MutexLock lock(mutex_);
  std::vector<std::pair<uint64_t, AssetState>> all;
  for (const auto& [digest, asset] : assets_) {
    all.push_back({asset.used, {digest, asset.stored, asset.complete}});
  }
  std::ranges::sort(all, std::greater(), [](const auto& entry) { return entry.first; });
  std::vector<AssetState> out;
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
