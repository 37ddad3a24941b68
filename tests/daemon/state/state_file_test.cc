#include "daemon/state/state_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <random>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "tests/daemon/state/crash_vfs.h"

namespace voxeld::daemon::state {
namespace {

using ::testing::HasSubstr;
using Rows = std::map<RowKey, std::string>;

Rows AllRows(StateFile& file) {
  Rows rows;
  const absl::Status status = file.Read(
      [&](const RowKey& key, std::string_view bytes) { rows.emplace(key, std::string(bytes)); });
  EXPECT_TRUE(status.ok()) << status;
  return rows;
}

absl::Status Put(StateFile& file, std::vector<Change> changes) {
  return file.Apply([&] { return std::exchange(changes, {}); });
}

Change PutOf(RowKey key, std::string bytes) {
  return {Change::What::kPut, std::move(key), std::move(bytes)};
}

class StateFileTest : public ::testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directory(folder_); }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  absl::StatusOr<std::unique_ptr<StateFile>> Open() {
    return StateFile::Open({.path = path_, .vfs = "", .now = [] { return int64_t{1234}; }});
  }
  const std::string folder_ = absl::StrCat(::testing::TempDir(), "/voxeld-state-", getpid());
  const std::string path_ = folder_ + "/state.db";
};

const RowKey kEntity{RowKind::kEntity, 7, std::string("la\0yer", 6), "id'\""};

TEST_F(StateFileTest, HasWhatWasWrittenInOrderOfItsKinds) {
  {
    auto file = Open();
    ASSERT_TRUE(file.ok()) << file.status();
    ASSERT_TRUE(Put(**file, {PutOf(kEntity, std::string("\0\xff", 2)),
                             PutOf({RowKind::kLayer, 7, kEntity.name, ""}, "layer"),
                             PutOf({RowKind::kOwner, UINT64_MAX, "", ""}, "owner"),
                             PutOf({RowKind::kObject, 7, "o", ""}, ""),
                             PutOf({RowKind::kOwner, 1, "", ""}, "gone"),
                             {Change::What::kRemove, {RowKind::kOwner, 1, "", ""}, {}}})
                    .ok());
  }
  auto file = Open();
  ASSERT_TRUE(file.ok()) << file.status();
  std::vector<RowKind> kinds;
  ASSERT_TRUE(
      (*file)->Read([&](const RowKey& key, std::string_view) { kinds.push_back(key.kind); }).ok());
  EXPECT_EQ(kinds, (std::vector<RowKind>{RowKind::kOwner, RowKind::kObject, RowKind::kLayer,
                                         RowKind::kEntity}));
  const Rows rows = AllRows(**file);
  EXPECT_EQ(rows.at(kEntity), std::string("\0\xff", 2));
  EXPECT_EQ(rows.at({RowKind::kOwner, UINT64_MAX, "", ""}), "owner");
  EXPECT_EQ((*file)->quarantined(), "");
  struct stat found;
  ASSERT_EQ(stat(path_.c_str(), &found), 0);
  EXPECT_EQ(found.st_mode & 0777, 0600u);
}

TEST_F(StateFileTest, ALayerGoesWithItsEntitiesAndNobodyElses) {
  auto file = Open();
  ASSERT_TRUE(file.ok());
  std::vector<Change> changes;
  for (const uint64_t owner : {1, 2}) {
    for (const char* layer : {"a", "ab"}) {
      changes.push_back(PutOf({RowKind::kLayer, owner, layer, ""}, "x"));
      changes.push_back(PutOf({RowKind::kEntity, owner, layer, "1"}, "x"));
      changes.push_back(PutOf({RowKind::kEntity, owner, layer, "2"}, "x"));
    }
  }
  ASSERT_TRUE(Put(**file, changes).ok());
  ASSERT_TRUE(Put(**file, {{Change::What::kRemoveLayer, {RowKind::kLayer, 1, "a", ""}, {}}}).ok());
  EXPECT_EQ(AllRows(**file).size(), 9u);
  EXPECT_FALSE(AllRows(**file).contains({RowKind::kEntity, 1, "a", "2"}));
  ASSERT_TRUE(Put(**file, {{Change::What::kRemoveAll, {}, {}}}).ok());
  EXPECT_TRUE(AllRows(**file).empty());
}

TEST_F(StateFileTest, IsOnesAtATime) {
  auto first = Open();
  ASSERT_TRUE(first.ok());
  const auto second = Open();
  EXPECT_TRUE(absl::IsAlreadyExists(second.status())) << second.status();
  EXPECT_THAT(std::string(second.status().message()), HasSubstr("another daemon has it"));
  EXPECT_TRUE(std::filesystem::exists(path_));
  ASSERT_TRUE(Put(**first, {PutOf(kEntity, "x")}).ok());
}

TEST_F(StateFileTest, WhatIsNoDatabaseIsPutAside) {
  std::ofstream(path_) << std::string(100'000, 'x');
  auto file = Open();
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_THAT((*file)->quarantined(), HasSubstr(path_ + ".damaged-1234"));
  EXPECT_EQ(std::filesystem::file_size(path_ + ".damaged-1234"), 100'000u);
  EXPECT_TRUE(AllRows(**file).empty());
  EXPECT_TRUE(Put(**file, {PutOf(kEntity, "x")}).ok());
}

TEST_F(StateFileTest, AnEmptyFileIsPutAside) {
  std::ofstream(path_).close();
  const auto file = Open();
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_THAT((*file)->quarantined(), HasSubstr(path_ + ".damaged-1234: it is empty"));
  EXPECT_TRUE(std::filesystem::exists(path_ + ".damaged-1234"));
  EXPECT_GT(std::filesystem::file_size(path_), 0u) << "a new one has taken its place";
}

TEST_F(StateFileTest, TriggersAndTablesOfOthersHaveNoSay) {
  for (const char* sql :
       {"CREATE TRIGGER t AFTER INSERT ON rows BEGIN DELETE FROM rows; END", "CREATE TABLE more(a)",
        "CREATE VIEW seen AS SELECT 1",
        "DROP TABLE rows; CREATE TABLE rows(kind, owner, name, id, bytes CHECK(bytes = 'a'))"}) {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directory(folder_);
    ASSERT_TRUE(Open().ok());
    sqlite3* database = nullptr;
    ASSERT_EQ(sqlite3_open(path_.c_str(), &database), SQLITE_OK);
    ASSERT_EQ(sqlite3_exec(database, sql, nullptr, nullptr, nullptr), SQLITE_OK) << sql;
    sqlite3_close(database);
    const auto file = Open();
    ASSERT_TRUE(file.ok()) << file.status();
    EXPECT_THAT((*file)->quarantined(), HasSubstr(path_ + ".damaged-1234")) << sql;
    ASSERT_TRUE(Put(**file, {PutOf(kEntity, "x")}).ok()) << sql;
    EXPECT_EQ(AllRows(**file).size(), 1u) << sql;
  }
}

TEST_F(StateFileTest, RowsOutOfOrderArePutAside) {
  // Rows are found by their order: one in the wrong place can be read, but not removed.
  {
    auto file = Open();
    ASSERT_TRUE(file.ok());
    for (const char* id : {"aaaaaaaa", "bbbbbbbb", "cccccccc"}) {
      ASSERT_TRUE(Put(**file, {PutOf({RowKind::kEntity, 7, "layer", id}, "x")}).ok());
    }
  }
  std::stringstream read;
  read << std::ifstream(path_, std::ios::binary).rdbuf();
  std::string bytes = read.str();
  const size_t at = bytes.find("bbbbbbbb");
  ASSERT_NE(at, std::string::npos);
  bytes.replace(at, 8, "zzzzzzzz");
  std::ofstream(path_, std::ios::binary) << bytes;
  const auto file = Open();
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_THAT((*file)->quarantined(), HasSubstr("order"));
}

TEST_F(StateFileTest, WhatSomebodyElseOrALaterVersionMadeIsLeftAlone) {
  for (const char* sql : {"CREATE TABLE theirs(a)", "PRAGMA user_version=2"}) {
    std::filesystem::remove(path_);
    if (std::string_view(sql).starts_with("PRAGMA")) {
      ASSERT_TRUE(Open().ok());
    }
    sqlite3* database = nullptr;
    ASSERT_EQ(sqlite3_open(path_.c_str(), &database), SQLITE_OK);
    ASSERT_EQ(sqlite3_exec(database, sql, nullptr, nullptr, nullptr), SQLITE_OK);
    sqlite3_close(database);
    const auto file = Open();
    EXPECT_TRUE(absl::IsFailedPrecondition(file.status())) << file.status();
    EXPECT_FALSE(std::filesystem::exists(path_ + ".damaged-1234"));
  }
}

TEST_F(StateFileTest, DoesNotFollowALinkThatSomebodyElseMade) {
  std::filesystem::create_symlink(folder_ + "/elsewhere", path_);
  EXPECT_FALSE(Open().ok());
  EXPECT_FALSE(std::filesystem::exists(folder_ + "/elsewhere"));
}

// ------------------------------------------------------------------------------------- a lost disk

absl::StatusOr<std::unique_ptr<StateFile>> OpenOn(const CrashDisk& disk) {
  return StateFile::Open(
      {.path = "/state.db", .vfs = disk.vfs(), .now = [] { return int64_t{1}; }});
}

// Returns transactions of random rows, as a client's commits would make them, some of them large.
std::vector<Change> RandomChanges(std::mt19937& lot, Rows& model) {
  std::vector<Change> changes;
  const size_t count = 1 + lot() % 20;
  for (size_t i = 0; i < count; ++i) {
    const RowKey key{RowKind::kEntity, 1 + lot() % 2, absl::StrCat("l", lot() % 3),
                     absl::StrCat("e", lot() % 30)};
    switch (lot() % 8) {
      case 0:
        changes.push_back({Change::What::kRemove, key, {}});
        model.erase(key);
        break;
      case 1:
        changes.push_back({Change::What::kRemoveLayer, key, {}});
        std::erase_if(model, [&](const auto& row) {
          return row.first.owner == key.owner && row.first.name == key.name;
        });
        break;
      default: {
        std::string bytes(lot() % (lot() % 5 == 0 ? 20'000 : 300), static_cast<char>(lot()));
        changes.push_back(PutOf(key, bytes));
        model[key] = std::move(bytes);
        break;
      }
    }
  }
  return changes;
}

// The result of running until the machine stops at `cut`: the rows that Apply has reported to be on
// the disk, and those under way.
struct Lost {
  Rows durable, under_way;
  uint64_t steps = 0;
};
Lost RunUntil(CrashDisk& disk, uint32_t seed, uint64_t cut) {
  std::mt19937 lot(seed);
  disk.StopAt(cut);
  Lost lost;
  auto file = OpenOn(disk);
  if (!file.ok()) return lost;
  for (int i = 0; i < 40; ++i) {
    lost.under_way = lost.durable;
    std::vector<Change> changes = RandomChanges(lot, lost.under_way);
    if (!Put(**file, std::move(changes)).ok()) break;
    lost.durable = lost.under_way;
  }
  lost.steps = disk.steps();
  return lost;
}

TEST(PowerLoss, NoDurableTransactionIsLostAndNoneIsHalfThereAtAThousandPoints) {
  constexpr uint64_t kPoints = 1000;
  const uint64_t steps = [] {
    CrashDisk disk("count");
    return RunUntil(disk, 1, UINT64_MAX).steps;
  }();
  ASSERT_GT(steps, kPoints);
  uint64_t with_more = 0;
  for (uint64_t point = 0; point < kPoints; ++point) {
    CrashDisk disk("crash");
    const uint64_t cut = 1 + point * steps / kPoints;
    const Lost lost = RunUntil(disk, 1, cut);
    disk.PowerCycle(static_cast<uint32_t>(point));
    auto file = OpenOn(disk);
    ASSERT_TRUE(file.ok()) << "cut at " << cut << ": " << file.status();
    EXPECT_EQ((*file)->quarantined(), "") << "cut at " << cut;
    const Rows rows = AllRows(**file);
    // The transaction under way may have been written whole.
    ASSERT_TRUE(rows == lost.durable || rows == lost.under_way) << "cut at " << cut;
    with_more += rows != lost.durable;
    ASSERT_TRUE(Put(**file, {PutOf(kEntity, "goes on")}).ok()) << "cut at " << cut;
  }
  RecordProperty("came_through", static_cast<int>(with_more));
}

TEST(PowerLoss, ADiskThatForgetsMoreIsFoundOut) {
  // The disk itself is judged: without syncs, something must get lost; otherwise it would prove
  // nothing.
  size_t lost_some = 0;
  for (uint32_t seed = 0; seed < 20; ++seed) {
    CrashDisk disk("liar");
    sqlite3* database = nullptr;
    ASSERT_EQ(
        sqlite3_open_v2("/state.db", &database, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE, "liar"),
        SQLITE_OK);
    ASSERT_EQ(sqlite3_exec(database,
                           "PRAGMA locking_mode=EXCLUSIVE; PRAGMA journal_mode=WAL;"
                           "PRAGMA synchronous=OFF; CREATE TABLE t(a); INSERT INTO t VALUES(1)",
                           nullptr, nullptr, nullptr),
              SQLITE_OK);
    disk.StopAt(disk.steps());
    sqlite3_close(database);
    disk.PowerCycle(seed);
    database = nullptr;
    sqlite3_open_v2("/state.db", &database, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE, "liar");
    lost_some += sqlite3_exec(database, "PRAGMA locking_mode=EXCLUSIVE; SELECT * FROM t", nullptr,
                              nullptr, nullptr) != SQLITE_OK;
    sqlite3_close(database);
  }
  EXPECT_GT(lost_some, 0u);
}

TEST(FullDisk, AnErrorThatSaysSoAndAllThatWasThereStays) {
  CrashDisk disk("full");
  auto file = OpenOn(disk);
  ASSERT_TRUE(file.ok()) << file.status();
  ASSERT_TRUE(Put(**file, {PutOf(kEntity, "first")}).ok());
  disk.SetRoom(8192);
  const absl::Status full = Put(**file, {PutOf(kEntity, std::string(100'000, 'x'))});
  EXPECT_TRUE(absl::IsResourceExhausted(full)) << full;
  EXPECT_THAT(std::string(full.message()), HasSubstr("make room on its disk"));
  EXPECT_EQ(AllRows(**file), (Rows{{kEntity, "first"}}));
  disk.SetRoom(UINT64_MAX);
  EXPECT_TRUE(Put(**file, {PutOf(kEntity, "second")}).ok());
  EXPECT_EQ(AllRows(**file), (Rows{{kEntity, "second"}}));
}

}  // namespace
}  // namespace voxeld::daemon::state
