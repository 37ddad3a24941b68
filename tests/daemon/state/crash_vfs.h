// A disk that loses unsynced data: a VFS for SQLite that holds files in memory, and records for
// each write whether it was synced. When the power fails at a chosen point, everything that was not
// synced is there, or not, or in part, at random.
//
// It trusts fsync, treats sectors of 512 bytes as atomic, and assumes no order of unsynced writes:
// the worst case that SQLite claims to survive (its PSOW is not claimed). The existence of files is
// unsynced as well until the folder is synced, which SQLite's own VFS does with the first sync of a
// journal that it has made.
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

  // Registered under the name `vfs` until it is destroyed. One file system for all files that are
  // opened with it.
  explicit CrashDisk(std::string vfs);
  ~CrashDisk();
  CrashDisk(const CrashDisk&) = delete;
  CrashDisk& operator=(const CrashDisk&) = delete;

  const std::string& vfs() const { return vfs_; }

  // Returns the number of calls so far that change something or sync it.
  uint64_t steps() const { return steps_; }
  // From this step on every call fails, as if the machine had stopped there.
  void StopAt(uint64_t step) { stop_at_ = step; }
  bool stopped() const { return steps_ >= stop_at_; }

  // The n-th call of any kind from now on, including reads, fails once with an I/O error; 0: none.
  void FailCall(uint64_t n) {
    calls_ = 0;
    fails_at_ = n;
  }
  // Since FailCall.
  uint64_t calls() const { return calls_; }

  // The power was off and is back: data that was not synced is lost at random. All files are
  // closed.
  void PowerCycle(uint32_t seed);

  // Sets the room left; writes that would need more fail with SQLITE_FULL.
  void SetRoom(uint64_t bytes) { room_ = bytes; }

  // Flips bits of the file's synced data.
  void Damage(const std::string& name, size_t at, uint8_t with);
  size_t SizeOf(const std::string& name) const;

 private:
  friend struct CrashFile;
  friend struct CrashCalls;

  struct File {
    std::string now;     // the content as the running machine sees it
    std::string synced;  // the content that is certain after the power was off
    struct Write {
      uint64_t at = 0;
      std::string bytes;
      bool truncate = false;  // truncates to `at`
    };
    std::vector<Write> unsynced;
    bool exists_synced = false;
  };

  void SyncFolder();
  bool Step();  // returns false once the machine has stopped
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
