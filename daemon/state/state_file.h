// The persistent state of a daemon in one SQLite file: rows of bytes under names. It does not
// interpret the rows.
//
//   written    in transactions that apply completely or not at all and are synced to the disk
//              before Apply returns (WAL, synchronous=FULL), so that they survive a power failure
//   opened     by one process at a time
//   damaged    moved aside under a name with ".damaged" and the time, and reported; an empty file
//              replaces it. A file of a later version is left alone and is an error
//
// Not thread-safe, but may be used by different threads one after another.
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

// Kinds of rows. The numbers are part of the file format.
enum class RowKind : uint8_t { kOwner = 1, kObject = 2, kLayer = 3, kEntity = 4 };

// `name` is the name of an object or layer of the owner; `id` is the entity's id in the layer.
struct RowKey {
  RowKind kind = RowKind::kEntity;
  uint64_t owner = 0;
  std::string name, id;
  auto operator<=>(const RowKey&) const = default;
};

struct Change {
  enum class What : uint8_t {
    kPut,          // inserts or replaces the row
    kRemove,       // removes the row
    kRemoveLayer,  // removes the layer of `key` and all its entities
    kRemoveAll     // removes everything
  };
  What what = What::kPut;
  RowKey key;
  std::string bytes;  // kPut
};

struct StateFileOptions {
  std::string path;
  // Name of an SQLite VFS; empty: the default.
  std::string vfs;
  // Unix time for the names of files that are moved aside.
  std::function<int64_t()> now;
};

class StateFile {
 public:
  // Identify the file's format: application_id and user_version.
  static constexpr int32_t kApplicationId = 0x7678'6c64;  // "vxld"
  static constexpr int32_t kVersion = 1;

  // Opens or creates the file; a damaged one is moved aside. Errors: AlreadyExists if another
  // process has opened it; FailedPrecondition if a later version or another application has created
  // it.
  static absl::StatusOr<std::unique_ptr<StateFile>> Open(StateFileOptions options);
  ~StateFile();
  StateFile(const StateFile&) = delete;
  StateFile& operator=(const StateFile&) = delete;

  // Returns: the name of the file that was moved aside on opening, and the reason; empty: none.
  const std::string& quarantined() const { return quarantined_; }

  // Reads all rows, ordered by kind, owner, name and id. Errors: DataLoss if the file is damaged.
  absl::Status Read(const std::function<void(const RowKey&, std::string_view)>& row);

  // Returns: the next changes; empty at the end.
  using Source = std::function<std::vector<Change>()>;
  // Applies all changes in their order, or none. Returns OK when they are on the disk. Errors:
  // ResourceExhausted if the disk is full, DataLoss if the file is damaged, else Unavailable.
  absl::Status Apply(const Source& next);

  // Moves the file aside as damaged and creates an empty one.
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
