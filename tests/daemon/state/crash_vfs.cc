#include "tests/daemon/state/crash_vfs.h"

#include <sqlite3.h>

#include <algorithm>
#include <cstring>
#include <new>
#include <utility>

namespace voxeld::daemon::state {

struct CrashDisk::Registered {
  sqlite3_vfs vfs = {};
};

struct CrashFile {
  sqlite3_file base;
  CrashDisk* disk;
  std::shared_ptr<CrashDisk::File>* file;
  bool syncs_folder;
};

struct CrashCalls {
  static CrashFile& Of(sqlite3_file* file) { return *reinterpret_cast<CrashFile*>(file); }

  static int Close(sqlite3_file* file) {
    delete Of(file).file;
    return SQLITE_OK;
  }

  static int Read(sqlite3_file* file, void* into, int count, sqlite3_int64 at) {
    if (Of(file).disk->Fails()) return SQLITE_IOERR_READ;
    const std::string& now = (*Of(file).file)->now;
    const auto begin = static_cast<size_t>(at), size = static_cast<size_t>(count);
    const size_t have = begin >= now.size() ? 0 : std::min(size, now.size() - begin);
    if (have > 0) std::memcpy(into, now.data() + begin, have);
    if (have == size) return SQLITE_OK;
    std::memset(static_cast<char*>(into) + have, 0, size - have);
    return SQLITE_IOERR_SHORT_READ;
  }

  static int Write(sqlite3_file* file, const void* from, int count, sqlite3_int64 at) {
    CrashDisk& disk = *Of(file).disk;
    if (!disk.Step() || disk.Fails()) return SQLITE_IOERR_WRITE;
    CrashDisk::File& on = **Of(file).file;
    const auto begin = static_cast<size_t>(at), size = static_cast<size_t>(count);
    if (begin + size > on.now.size()) {
      const uint64_t more = begin + size - on.now.size();
      if (more > disk.room_) return SQLITE_FULL;
      disk.room_ -= disk.room_ == UINT64_MAX ? 0 : more;
      on.now.resize(begin + size);
    }
    std::memcpy(on.now.data() + begin, from, size);
    on.unsynced.push_back({begin, std::string(static_cast<const char*>(from), size), false});
    return SQLITE_OK;
  }

  static int Truncate(sqlite3_file* file, sqlite3_int64 size) {
    if (!Of(file).disk->Step() || Of(file).disk->Fails()) return SQLITE_IOERR_TRUNCATE;
    CrashDisk::File& on = **Of(file).file;
    on.now.resize(static_cast<size_t>(size));
    on.unsynced.push_back({static_cast<uint64_t>(size), {}, true});
    return SQLITE_OK;
  }

  static int Sync(sqlite3_file* file, int) {
    if (!Of(file).disk->Step() || Of(file).disk->Fails()) return SQLITE_IOERR_FSYNC;
    CrashDisk::File& on = **Of(file).file;
    on.synced = on.now;
    on.unsynced.clear();
    if (std::exchange(Of(file).syncs_folder, false)) Of(file).disk->SyncFolder();
    return SQLITE_OK;
  }

  static int Size(sqlite3_file* file, sqlite3_int64* size) {
    if (Of(file).disk->Fails()) return SQLITE_IOERR_FSTAT;
    *size = static_cast<sqlite3_int64>((*Of(file).file)->now.size());
    return SQLITE_OK;
  }

  static int Lock(sqlite3_file* file, int) {
    return Of(file).disk->Fails() ? SQLITE_IOERR_LOCK : SQLITE_OK;
  }
  static int Unlock(sqlite3_file*, int) { return SQLITE_OK; }
  static int CheckLock(sqlite3_file*, int* out) {
    *out = 0;
    return SQLITE_OK;
  }
  static int Control(sqlite3_file*, int, void*) { return SQLITE_NOTFOUND; }
  static int SectorSize(sqlite3_file*) { return static_cast<int>(CrashDisk::kSector); }
  static int Characteristics(sqlite3_file*) { return 0; }

  static CrashDisk& DiskOf(sqlite3_vfs* vfs) { return *static_cast<CrashDisk*>(vfs->pAppData); }

  static int Open(sqlite3_vfs* vfs, const char* name, sqlite3_file* file, int flags, int* out) {
    static const sqlite3_io_methods kMethods = {
        1,       &Close,     &Read,    &Write,      &Truncate,        &Sync,   &Size,   &Lock,
        &Unlock, &CheckLock, &Control, &SectorSize, &Characteristics, nullptr, nullptr, nullptr,
        nullptr, nullptr,    nullptr};
    CrashDisk& disk = DiskOf(vfs);
    if (disk.Fails()) {
      file->pMethods = nullptr;
      return SQLITE_CANTOPEN;
    }
    const std::string key = name == nullptr ? "temporary" : name;
    auto& found = disk.files_[key];
    const bool created = found == nullptr;
    if (created) {
      if ((flags & SQLITE_OPEN_CREATE) == 0 || !disk.Step()) {
        disk.files_.erase(key);
        file->pMethods = nullptr;
        return SQLITE_CANTOPEN;
      }
      found = std::make_shared<CrashDisk::File>();
    }
    CrashFile& opened = Of(file);
    opened.base.pMethods = &kMethods;
    opened.disk = &disk;
    opened.syncs_folder =
        created &&
        (flags & (SQLITE_OPEN_MAIN_JOURNAL | SQLITE_OPEN_SUPER_JOURNAL | SQLITE_OPEN_WAL)) != 0;
    opened.file = new std::shared_ptr<CrashDisk::File>(found);
    if (out != nullptr) *out = flags;
    return SQLITE_OK;
  }

  static int Delete(sqlite3_vfs* vfs, const char* name, int sync_folder) {
    CrashDisk& disk = DiskOf(vfs);
    const auto found = disk.files_.find(name);
    if (found == disk.files_.end()) return SQLITE_IOERR_DELETE_NOENT;
    if (!disk.Step() || disk.Fails()) return SQLITE_IOERR_DELETE;
    disk.removed_[name] = found->second;
    disk.files_.erase(found);
    if (sync_folder != 0) disk.SyncFolder();
    return SQLITE_OK;
  }

  static int Access(sqlite3_vfs* vfs, const char* name, int, int* out) {
    if (DiskOf(vfs).Fails()) return SQLITE_IOERR_ACCESS;
    *out = DiskOf(vfs).files_.contains(name) ? 1 : 0;
    return SQLITE_OK;
  }

  static int FullPathname(sqlite3_vfs*, const char* name, int size, char* out) {
    sqlite3_snprintf(size, out, "%s", name);
    return SQLITE_OK;
  }
};

CrashDisk::CrashDisk(std::string vfs)
    : vfs_(std::move(vfs)), registered_(std::make_unique<Registered>()) {
  const sqlite3_vfs* ordinary = sqlite3_vfs_find(nullptr);
  registered_->vfs = *ordinary;
  sqlite3_vfs& own = registered_->vfs;
  own.iVersion = 1;
  own.szOsFile = sizeof(CrashFile);
  own.zName = vfs_.c_str();
  own.pNext = nullptr;
  own.pAppData = this;
  own.xOpen = &CrashCalls::Open;
  own.xDelete = &CrashCalls::Delete;
  own.xAccess = &CrashCalls::Access;
  own.xFullPathname = &CrashCalls::FullPathname;
  sqlite3_vfs_register(&own, 0);
}

CrashDisk::~CrashDisk() { sqlite3_vfs_unregister(&registered_->vfs); }

void CrashDisk::SyncFolder() {
  removed_.clear();
  for (auto& [name, file] : files_) file->exists_synced = true;
}

bool CrashDisk::Step() {
  if (stopped()) return false;
  ++steps_;
  return !stopped();
}

void CrashDisk::PowerCycle(uint32_t seed) {
  std::mt19937 lot(seed);
  const auto heads = [&] { return (lot() & 1) != 0; };
  // Removals that were not synced may not have happened.
  for (auto& [name, file] : removed_) {
    if (!files_.contains(name) && heads()) files_[name] = file;
  }
  removed_.clear();
  for (auto it = files_.begin(); it != files_.end();) {
    File& file = *it->second;
    if (!file.exists_synced && heads()) {
      it = files_.erase(it);
      continue;
    }
    std::string after = file.synced;
    for (const File::Write& write : file.unsynced) {
      if (write.truncate) {
        if (heads()) after.resize(write.at);
        continue;
      }
      // Each sector is there, or not.
      for (uint64_t at = write.at; at < write.at + write.bytes.size();) {
        const uint64_t end =
            std::min<uint64_t>((at / kSector + 1) * kSector, write.at + write.bytes.size());
        if (heads()) {
          if (after.size() < end) after.resize(end);
          std::memcpy(after.data() + at, write.bytes.data() + (at - write.at), end - at);
        }
        at = end;
      }
    }
    auto fresh = std::make_shared<File>();
    fresh->now = after;
    fresh->synced = std::move(after);
    fresh->exists_synced = true;
    it->second = std::move(fresh);
    ++it;
  }
  steps_ = 0;
  stop_at_ = UINT64_MAX;
}

void CrashDisk::Damage(const std::string& name, size_t at, uint8_t with) {
  File& file = *files_.at(name);
  file.now[at] = static_cast<char>(file.now[at] ^ with);
  file.synced = file.now;
}

size_t CrashDisk::SizeOf(const std::string& name) const { return files_.at(name)->now.size(); }

}  // namespace voxeld::daemon::state
