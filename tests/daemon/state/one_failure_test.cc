// The state file where one thing fails once, each in its turn: what SQLite asks of the disk, and of memory.
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

// The turn-th transaction; some rows do not fit into a page.
std::vector<Change> Changes(int turn, Rows* model) {
  std::vector<Change> changes;
  for (int i = 0; i < 8; ++i) {
    const RowKey key{RowKind::kEntity, 1, absl::StrCat("l", i % 2),
                     absl::StrCat("e", (turn * 5 + i) % 17)};
    if ((turn + i) % 5 == 0) {
      changes.push_back({Change::What::kRemove, key, {}});
      model->erase(key);
      continue;
    }
    std::string bytes(i == 3 ? 9000 : 40 + static_cast<size_t>(turn), static_cast<char>('a' + i));
    changes.push_back({Change::What::kPut, key, bytes});
    (*model)[key] = std::move(bytes);
  }
  return changes;
}

absl::Status Apply(StateFile& file, std::vector<Change> changes) {
  return file.Apply([&] { return std::exchange(changes, {}); });
}

constexpr int kBefore = 4, kTurns = 8;

// A life of a file that is there: opened, read, written to. Whatever fails is tried again, which has to work, as nothing fails
// twice; it must have changed nothing. `failed`: how often something did.
void Live(CrashDisk& disk, int* failed, Rows* model) {
  std::unique_ptr<StateFile> file;
  const auto open = [&] {
    absl::StatusOr<std::unique_ptr<StateFile>> opened = OpenDisk(disk);
    if (opened.ok()) file = *std::move(opened);
    return opened.status();
  };
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
  ASSERT_NO_FATAL_FAILURE(twice("open", open));
  EXPECT_EQ(file->quarantined(), "") << "a good file was put aside";
  Rows rows;
  ASSERT_NO_FATAL_FAILURE(twice("read", [&] { return RowsOf(*file, &rows); }));
  EXPECT_EQ(rows, *model) << "when it was opened";
  for (int turn = kBefore; turn < kBefore + kTurns; ++turn) {
    Rows next = *model;
    const std::vector<Change> changes = Changes(turn, &next);
    ASSERT_NO_FATAL_FAILURE(twice("write", [&]() -> absl::Status {
      absl::Status status = Apply(*file, changes);
      if (status.ok()) return status;
      if (absl::Status read = RowsOf(*file, &rows); read.ok()) {
        EXPECT_EQ(rows, *model) << "part of what failed is there: " << status;
      }
      return status;
    }));
    *model = std::move(next);
    ASSERT_NO_FATAL_FAILURE(twice("read", [&] { return RowsOf(*file, &rows); }));
    EXPECT_EQ(rows, *model) << "after turn " << turn;
  }
}

void MakeFile(CrashDisk& disk, Rows* model) {
  auto file = OpenDisk(disk);
  ASSERT_TRUE(file.ok()) << file.status();
  for (int turn = 0; turn < kBefore; ++turn) {
    ASSERT_TRUE(Apply(**file, Changes(turn, model)).ok());
  }
}

void ExpectKept(CrashDisk& disk, const Rows& model) {
  auto file = OpenDisk(disk);
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_EQ((*file)->quarantined(), "");
  Rows rows;
  ASSERT_TRUE(RowsOf(**file, &rows).ok());
  EXPECT_EQ(rows, model) << "after it was opened anew";
}

TEST(OneFailure, EachCallOfTheDisk) {
  int failed = 0;
  uint64_t calls = 0;
  for (uint64_t n = 0; n == 0 || (n <= calls && !::testing::Test::HasFailure()); ++n) {
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
    // What is told to be on the disk outlives the power too.
    disk.PowerCycle(static_cast<uint32_t>(n));
    ExpectKept(disk, model);
    EXPECT_EQ(now > 1, false) << "one failure was two";
    failed += now;
  }
  std::cout << calls << " calls, " << failed << " of them told to the caller when they failed\n";
  EXPECT_GT(calls, 100u);
  EXPECT_GT(failed, static_cast<int>(calls / 3)) << "they fail, and nobody is told";
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

// SQLite asks us for memory. To be made while nothing of it is open.
class SqliteMemory {
 public:
  SqliteMemory() {
    sqlite3_shutdown();
    EXPECT_EQ(sqlite3_config(SQLITE_CONFIG_GETMALLOC, &memory.real), SQLITE_OK);
    sqlite3_mem_methods own = memory.real;
    own.xMalloc = &Malloc;
    own.xRealloc = &Realloc;
    EXPECT_EQ(sqlite3_config(SQLITE_CONFIG_MALLOC, &own), SQLITE_OK);
    // It keeps pieces for itself that would then be given without a question.
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

TEST(OneFailure, EachAllocationOfSqlite) {
  SqliteMemory sqlite;
  int failed = 0;
  uint64_t allocations = 0;
  for (uint64_t n = 0; n == 0 || (n <= allocations && !::testing::Test::HasFailure()); ++n) {
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
    EXPECT_EQ(now > 1, false) << "one failure was two";
    EXPECT_EQ(sqlite3_memory_used(), 0) << "what it asked for is held";
    failed += now;
  }
  std::cout << allocations << " allocations, " << failed
            << " of them told to the caller when they failed\n";
  EXPECT_GT(allocations, 100u);
  EXPECT_GT(failed, static_cast<int>(allocations / 3)) << "they fail, and nobody is told";
}

}  // namespace
}  // namespace voxeld::daemon::state
