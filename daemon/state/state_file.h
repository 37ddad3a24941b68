// What a daemon keeps over its end, in one SQLite file: rows of bytes under names. It knows neither what
// is in them nor who asks.
//
//   written    in transactions, each whole or not at all, and synced to the disk before Apply returns
//              (WAL, synchronous=FULL): so what Apply has answered for survives the machine's power
//   opened     by one process at a time
//   damaged    put aside under a name with ".damaged" and the time, and reported; an empty one takes its
//              place. Made by a later version: left alone, and an error
//
// Not thread-safe; any thread, one at a time.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

struct sqlite3;

namespace voxeld::daemon::state {

// What a row is of. Numbers are in the file.
enum class RowKind : uint8_t { kOwner = 1, kObject = 2, kLayer = 3, kEntity = 4 };

// `name` within the owner: an object's or a layer's; `id` within the layer.
struct RowKey {
  RowKind kind = RowKind::kEntity;
  uint64_t owner = 0;
  std::string name, id;
  auto operator<=>(const RowKey&) const = default;
};

struct Change {
  enum class What : uint8_t {
    kPut,          // in place of what has the key
    kRemove,       // that row
    kRemoveLayer,  // the layer `key` names and all its entities
    kRemoveAll     // whatever there is
  };
  What what = What::kPut;
  RowKey key;
  std::string bytes;  // kPut
};

struct StateFileOptions {
  std::string path;
  // SQLite's name of what stands between it and the disk; empty: the system's own.
  std::string vfs;
  // For the names of files that are put aside; Unix time.
  std::function<int64_t()> now;
};

class StateFile {
 public:
  // Of the file's format: application_id, and user_version.
  static constexpr int32_t kApplicationId = 0x7678'6c64;  // "vxld"
  static constexpr int32_t kVersion = 1;

  // AlreadyExists: another process has it. FailedPrecondition: a later version made it, or it is
  // somebody else's. Otherwise there is a file that can be used, whatever was there.
  static absl::StatusOr<std::unique_ptr<StateFile>> Open(StateFileOptions options);
  ~StateFile();
  StateFile(const StateFile&) = delete;
  StateFile& operator=(const StateFile&) = delete;

  // What was put aside when it was opened, and why; empty: nothing.
  const std::string& quarantined() const { return quarantined_; }

  // All rows, by kind, owner, name, id. DataLoss if the file turns out to be damaged.
  absl::Status Read(const std::function<void(const RowKey&, std::string_view)>& row);

  // Gives the next changes; none: that was all.
  using Source = std::function<std::vector<Change>()>;
  // All changes, in their order, or none. OK when they are on the disk. ResourceExhausted if the disk is
  // full, DataLoss if the file is damaged, else Unavailable.
  absl::Status Apply(const Source& next);

  // Puts the file aside, as damaged, and begins an empty one.
  absl::Status StartAnew(const std::string& why);

 private:
  struct Statements;
  explicit StateFile(StateFileOptions options);
  absl::Status OpenDatabase();
  absl::Status Prepare();
  absl::Status Check();
  absl::Status PutAside(const std::string& why);
  void Close();
  absl::Status Run(const char* sql);
  absl::Status Fault(int code, const char* what) const;
  absl::Status Carry(const Change& change);

  const StateFileOptions options_;
  sqlite3* database_ = nullptr;
  std::unique_ptr<Statements> statements_;
  std::string quarantined_;
};

}  // namespace voxeld::daemon::state
