// Tests the state file when one thing fails once, each in its turn, in ten lives of the file:
// SQLite's calls to the disk, and its allocations.
#include <gtest/gtest.h>
#include <sqlite3.h>

#include <cstdint>
#include <functional>
#include <iostream>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/state/state_file.h"
#include "tests/daemon/state/crash_vfs.h"

namespace voxeld::daemon::state {
namespace {

// Fails each call and allocation; sanitizers make this slow, so there only every fifth fails.
#ifdef VOXELD_SANITIZED
constexpr uint64_t kStep = 5;
#else
constexpr uint64_t kStep = 1;
#endif

using Rows = std::map<RowKey, std::string>;

absl::StatusOr<std::unique_ptr<StateFile>> OpenDisk(const CrashDisk& disk) {
  return StateFile::Open(
      {.path = "/state.db", .vfs = disk.vfs(), .now = [] { return int64_t{1}; }});
}

absl::Status RowsOf(StateFile& file, Rows* rows) {
  rows->clear();
  return file.Read(
      [&](const RowKey& key, std::string_view bytes) { rows->emplace(key, std::string(bytes)); });
}

// Applies a transaction to the model.
void Carry(const std::vector<Change>& changes, Rows* model) {
  for (const Change& change : changes) {
    switch (change.what) {
      case Change::What::kPut:
        (*model)[change.key] = change.bytes;
        break;
      case Change::What::kRemove:
        model->erase(change.key);
        break;
      case Change::What::kRemoveLayer:
        std::erase_if(*model, [&](const auto& row) {
          return row.first.owner == change.key.owner && row.first.name == change.key.name &&
                 (row.first.kind == RowKind::kLayer || row.first.kind == RowKind::kEntity);
        });
        break;
      case Change::What::kRemoveAll:
        model->clear();
        break;
    }
  }
}

RowKey Entity(int layer, int number) {
  return {RowKind::kEntity, 1, absl::StrCat("l", layer), absl::StrCat("e", number)};
}
Change Put(const RowKey& key, size_t size, int turn) {
  return {Change::What::kPut, key, std::string(size, static_cast<char>('a' + turn % 26))};
}

// Returns the turn-th transaction; some rows do not fit into a page.
std::vector<Change> Mixed(int turn) {
  std::vector<Change> changes;
  for (int i = 0; i < 8; ++i) {
    const RowKey key = Entity(i % 2, (turn * 5 + i) % 17);
    if ((turn + i) % 5 == 0) {
      changes.push_back({Change::What::kRemove, key, {}});
    } else {
      changes.push_back(Put(key, i == 3 ? 9000 : 40 + static_cast<size_t>(turn), turn + i));
    }
  }
  return changes;
}

std::vector<Change> Many(int turn) {
  std::vector<Change> changes;
  for (int i = 0; i < 60; ++i) {
    const RowKey key = Entity(turn / 2, i);
    changes.push_back(turn % 2 == 0 ? Put(key, 30, turn) : Change{Change::What::kRemove, key, {}});
  }
  return changes;
}

std::vector<Change> Large(int turn) { return {Put(Entity(0, turn % 2), 100'000, turn)}; }

std::vector<Change> OneRow(int turn) { return {Put(Entity(0, 0), 50, turn)}; }

std::vector<Change> AllGone(int turn) {
  std::vector<Change> changes = Mixed(turn);
  changes.insert(changes.begin() + 4, {Change::What::kRemoveAll, {}, {}});
  return changes;
}

std::vector<Change> LayerGone(int turn) {
  std::vector<Change> changes = Mixed(turn);
  changes.push_back(Put({RowKind::kLayer, 1, "l0", ""}, 20, turn));
  changes.push_back({Change::What::kRemoveLayer, {RowKind::kLayer, 1, "l1", ""}, {}});
  return changes;
}

absl::Status Apply(StateFile& file, std::vector<Change> changes) {
  return file.Apply([&] { return std::exchange(changes, {}); });
}

// A life of a file: its state at first, and the actions on it.
struct Life {
  const char* name;
  int before;  // transactions that made the file; 0: no file exists
  int turns;   // transactions
  std::vector<Change> (*changes)(int turn);
  bool reopens = false;    // before each turn
  bool power_off = false;  // the power was off while a transaction was written
  uint64_t least_calls = 50;
};
void PrintTo(const Life& life, std::ostream* out) { *out << life.name; }

const Life kLives[] = {
    {"ordinary", 4, 8, &Mixed},
    {"the_first", 0, 4, &Mixed},
    {"many_rows", 2, 4, &Many, false, false, 20},
    {"large_rows", 2, 5, &Large},
    {"one_row", 1, 10, &OneRow},
    {"all_is_removed", 3, 5, &AllGone},
    {"a_layer_is_removed", 3, 5, &LayerGone},
    {"only_read", 6, 0, &Mixed, false, false, 20},
    {"opened_for_each", 2, 3, &Mixed, true},
    {"after_the_power_was_off", 4, 4, &Mixed, false, true},
};

class OneFailure : public ::testing::TestWithParam<Life> {
 protected:
  // Opens, reads and writes the file. An action that fails is tried again, which must succeed since
  // nothing fails twice; the failure must have changed nothing. `failed`: the number of failures.
  void Live(CrashDisk& disk, int* failed, Rows* model) const;
  void MakeFile(CrashDisk& disk, Rows* model) const;
  static void ExpectKept(CrashDisk& disk, const Rows& model);
  void ExpectTold(uint64_t asked, int failed) const;
};

void OneFailure::Live(CrashDisk& disk, int* failed, Rows* model) const {
  const Life& life = GetParam();
  std::unique_ptr<StateFile> file;
  const auto twice = [&](const char* what, const std::function<absl::Status()>& attempt) {
    absl::Status status = attempt();
    if (status.ok()) return;
    ++*failed;
    EXPECT_TRUE(absl::IsUnavailable(status) || absl::IsResourceExhausted(status))
        << what << ": " << status;
    EXPECT_FALSE(status.message().empty());
    status = attempt();
    ASSERT_TRUE(status.ok()) << what << ": " << status;
  };
  const auto open = [&] {
    file.reset();
    ASSERT_NO_FATAL_FAILURE(twice("open", [&]() -> absl::Status {
      absl::StatusOr<std::unique_ptr<StateFile>> opened = OpenDisk(disk);
      if (!opened.ok()) return opened.status();
      file = *std::move(opened);
      return absl::OkStatus();
    }));
    EXPECT_EQ(file->quarantined(), "") << "a good file was put aside";
  };
  Rows rows;
  const auto read = [&](const std::string& when) {
    ASSERT_NO_FATAL_FAILURE(twice("read", [&] { return RowsOf(*file, &rows); }));
    EXPECT_EQ(rows, *model) << when;
  };
  ASSERT_NO_FATAL_FAILURE(open());
  ASSERT_NO_FATAL_FAILURE(read("when it was opened"));
  for (int turn = life.before; turn < life.before + life.turns; ++turn) {
    if (life.reopens) {
      ASSERT_NO_FATAL_FAILURE(open());
    }
    const std::vector<Change> changes = life.changes(turn);
    ASSERT_NO_FATAL_FAILURE(twice("write", [&]() -> absl::Status {
      absl::Status status = Apply(*file, changes);
      if (status.ok()) return status;
      if (absl::Status found = RowsOf(*file, &rows); found.ok()) {
        EXPECT_EQ(rows, *model) << "part of what failed was applied: " << status;
      }
      return status;
    }));
    Carry(changes, model);
    ASSERT_NO_FATAL_FAILURE(read(absl::StrCat("after turn ", turn)));
  }
}

void OneFailure::MakeFile(CrashDisk& disk, Rows* model) const {
  const Life& life = GetParam();
  if (life.before == 0) return;
  auto file = OpenDisk(disk);
  ASSERT_TRUE(file.ok()) << file.status();
  for (int turn = 0; turn < life.before; ++turn) {
    const std::vector<Change> changes = life.changes(turn);
    ASSERT_TRUE(Apply(**file, changes).ok());
    Carry(changes, model);
  }
  if (!life.power_off) return;
  // While the next one is written: its log has the beginning of it.
  disk.StopAt(disk.steps() + 3);
  ASSERT_FALSE(Apply(**file, life.changes(life.before)).ok());
  file->reset();
  disk.StopAt(UINT64_MAX);
  disk.PowerCycle(1);
}

void OneFailure::ExpectKept(CrashDisk& disk, const Rows& model) {
  auto file = OpenDisk(disk);
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_EQ((*file)->quarantined(), "");
  Rows rows;
  ASSERT_TRUE(RowsOf(**file, &rows).ok());
  EXPECT_EQ(rows, model) << "after it was opened again";
}

// Checks that a life makes enough calls, and that enough of the failures were reported to its
// caller.
void OneFailure::ExpectTold(uint64_t asked, int failed) const {
  EXPECT_GE(asked, GetParam().least_calls);
  EXPECT_GT(failed, static_cast<int>(asked / kStep / 3)) << "calls fail without being reported";
}

TEST_P(OneFailure, EachCallOfTheDisk) {
  int failed = 0;
  uint64_t calls = 0;
  for (uint64_t n = 0; n == 0 || (n <= calls && !HasFailure()); n += n == 0 ? 1 : kStep) {
    SCOPED_TRACE(absl::StrCat("call ", n));
    CrashDisk disk("one");
    Rows model;
    ASSERT_NO_FATAL_FAILURE(MakeFile(disk, &model));
    disk.FailCall(n);
    int now = 0;
    Live(disk, &now, &model);
    if (n == 0) calls = disk.calls();
    disk.FailCall(0);
    ExpectKept(disk, model);
    // Data reported as being on the disk also survives a power failure.
    disk.PowerCycle(static_cast<uint32_t>(n));
    ExpectKept(disk, model);
    EXPECT_EQ(now > 1, false) << "one failure was reported as two";
    failed += now;
  }
  std::cout << calls << " calls, " << failed << " of them told to the caller when they failed\n";
  ExpectTold(calls, failed);
}

// ---- memory

struct Memory {
  sqlite3_mem_methods real = {};
  uint64_t count = 0, fails_at = 0;
} memory;

bool MemoryFails() { return ++memory.count == memory.fails_at; }
void* Malloc(int bytes) { return MemoryFails() ? nullptr : memory.real.xMalloc(bytes); }
void* Realloc(void* from, int bytes) {
  return MemoryFails() ? nullptr : memory.real.xRealloc(from, bytes);
}

// Provides SQLite's memory. Must be created while none of it is in use.
class SqliteMemory {
 public:
  SqliteMemory() {
    sqlite3_shutdown();
    EXPECT_EQ(sqlite3_config(SQLITE_CONFIG_GETMALLOC, &memory.real), SQLITE_OK);
    sqlite3_mem_methods own = memory.real;
    own.xMalloc = &Malloc;
    own.xRealloc = &Realloc;
    EXPECT_EQ(sqlite3_config(SQLITE_CONFIG_MALLOC, &own), SQLITE_OK);
    // SQLite keeps pieces for itself that would then be given out without a call.
    EXPECT_EQ(sqlite3_config(SQLITE_CONFIG_LOOKASIDE, 0, 0), SQLITE_OK);
    sqlite3_initialize();
  }
  ~SqliteMemory() {
    sqlite3_shutdown();
    sqlite3_config(SQLITE_CONFIG_MALLOC, &memory.real);
    sqlite3_config(SQLITE_CONFIG_LOOKASIDE, 1200, 40);
    sqlite3_initialize();
  }
  SqliteMemory(const SqliteMemory&) = delete;
  SqliteMemory& operator=(const SqliteMemory&) = delete;

  void Fail(uint64_t n) {
    memory.count = 0;
    memory.fails_at = n;
  }
};

TEST_P(OneFailure, EachAllocationOfSqlite) {
  SqliteMemory sqlite;
  int failed = 0;
  uint64_t allocations = 0;
  for (uint64_t n = 0; n == 0 || (n <= allocations && !HasFailure()); n += n == 0 ? 1 : kStep) {
    SCOPED_TRACE(absl::StrCat("allocation ", n));
    CrashDisk disk("one");
    Rows model;
    ASSERT_NO_FATAL_FAILURE(MakeFile(disk, &model));
    sqlite.Fail(n);
    int now = 0;
    Live(disk, &now, &model);
    if (n == 0) allocations = memory.count;
    sqlite.Fail(0);
    ExpectKept(disk, model);
    EXPECT_EQ(now > 1, false) << "one failure was reported as two";
    EXPECT_EQ(sqlite3_memory_used(), 0) << "memory leaked";
    failed += now;
  }
  std::cout << allocations << " allocations, " << failed
            << " of them told to the caller when they failed\n";
  ExpectTold(allocations, failed);
}

INSTANTIATE_TEST_SUITE_P(TenLives, OneFailure, ::testing::ValuesIn(kLives),
                         [](const auto& life) { return std::string(life.param.name); });

}  // namespace
}  // namespace voxeld::daemon::state
