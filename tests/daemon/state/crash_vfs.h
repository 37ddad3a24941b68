// A disk that forgets: a VFS for SQLite that holds files in memory, and knows of each write whether it was
// synced. When the power goes at a chosen point, whatever was not is there, or not, or in part, by lot.
//
// It takes fsync at its word, sectors of 512 bytes as what is written whole or not at all, and the order of
// unsynced writes as nobody's: the worst that SQLite says it lives with (its PSOW is not claimed). Which
// files there are is unsynced as well until the folder is, which SQLite's own VFS does with the first sync
// of a journal that it has made.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

namespace voxeld::daemon::state {

class CrashDisk {
 public:
  static constexpr size_t kSector = 512;

  // Under the name `vfs`, until it goes. One file system for all that is opened with it.
  explicit CrashDisk(std::string vfs);
  ~CrashDisk();
  CrashDisk(const CrashDisk&) = delete;
  CrashDisk& operator=(const CrashDisk&) = delete;

  const std::string& vfs() const { return vfs_; }

  // Calls that change something or sync it, so far.
  uint64_t steps() const { return steps_; }
  // From this step on everything fails, as if the machine had stopped there.
  void StopAt(uint64_t step) { stop_at_ = step; }
  bool stopped() const { return steps_ >= stop_at_; }

  // The n-th call of any kind from now on, reading included, fails once with an error of the disk's; 0: none.
  void FailCall(uint64_t n) {
    calls_ = 0;
    fails_at_ = n;
  }
  // Since FailCall.
  uint64_t calls() const { return calls_; }

  // The power was off and is back: what was not synced is lost by lot. All files are closed.
  void PowerCycle(uint32_t seed);

  // Room left; writes that would need more fail with SQLITE_FULL.
  void SetRoom(uint64_t bytes) { room_ = bytes; }

  // Flips bits of what lies in the file, synced.
  void Damage(const std::string& name, size_t at, uint8_t with);
  size_t SizeOf(const std::string& name) const;

 private:
  friend struct CrashFile;
  friend struct CrashCalls;

  struct File {
    std::string now;     // as the running machine sees it
    std::string synced;  // as it is after the power was off, at least
    struct Write {
      uint64_t at = 0;
      std::string bytes;
      bool truncate = false;  // to `at`
    };
    std::vector<Write> unsynced;
    bool exists_synced = false;
  };

  void SyncFolder();
  bool Step();  // false: the machine has stopped
  bool Fails() { return ++calls_ == fails_at_; }

  const std::string vfs_;
  std::map<std::string, std::shared_ptr<File>> files_;
  std::map<std::string, std::shared_ptr<File>> removed_;  // unsynced removals
  uint64_t steps_ = 0, stop_at_ = UINT64_MAX;
  uint64_t room_ = UINT64_MAX;
  uint64_t calls_ = 0, fails_at_ = 0;
  struct Registered;
  std::unique_ptr<Registered> registered_;
};

}  // namespace voxeld::daemon::state
