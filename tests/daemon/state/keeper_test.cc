// Tests when persistent state is written, and how file errors are handled.
#include "daemon/state/keeper.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <thread>

#include "absl/strings/str_cat.h"
#include "display/sync/mutex.h"
#include "tests/daemon/fakes/simulation.h"
#include "tests/daemon/scene/store_fixture.h"
#include "tests/daemon/state/crash_vfs.h"

namespace voxeld::daemon::state {
namespace {

using ::testing::HasSubstr;
using testing::Put;
using testing::Sequence;
using testing::StoreFixture;

Author Keeping() {
  Author author;
  author.owner = 1;
  author.writer = std::make_shared<const Writer>(Writer{.session = 1, .keep = true});
  return author;
}

class KeeperTest : public ::testing::Test {
 protected:
  void Begin(sync::TimeNs interval = 0) {
    auto file = StateFile::Open({.path = path_, .vfs = vfs_, .now = [] { return int64_t{1}; }});
    ASSERT_TRUE(file.ok()) << file.status();
    keeper_ =
        std::make_unique<Keeper>(*std::move(file),
                                 KeeperOptions{.interval_ns = interval,
                                               .retry_ns = sync::kMillisecond,
                                               .unix_ns = [](sync::TimeNs) { return int64_t{1}; }},
                                 clock_);
    keeper_->SetOnDurable([this](uint64_t snapshot) {
      sync::MutexLock lock(mutex_);
      durable_ = snapshot;
      changed_.NotifyAll();
    });
  }
  void Commit(const std::string& id, bool at_once = true) {
    f_.CommitAll(Keeping(), Sequence(f_.last_sequence, Put("a", id)));
    ++f_.last_sequence;
    keeper_->Offer(f_.store.snapshot(), records_, at_once);
  }
  void AwaitDurable(uint64_t snapshot) {
    sync::MutexLock lock(mutex_);
    const sync::TimeNs end = clock_.Now() + 30 * sync::kSecond;
    while (durable_ < snapshot && clock_.Now() < end) clock_.WaitUntil(mutex_, changed_, end);
    EXPECT_GE(durable_, snapshot);
  }
  uint64_t newest() const { return f_.store.snapshot()->number; }

  size_t RowsOnDisk() {
    keeper_.reset();
    auto file = StateFile::Open({.path = path_, .vfs = vfs_, .now = [] { return int64_t{1}; }});
    EXPECT_TRUE(file.ok()) << file.status();
    size_t rows = 0;
    EXPECT_TRUE((*file)->Read([&](const RowKey&, std::string_view) { ++rows; }).ok());
    return rows;
  }

  CrashDisk disk_{"keeper"};
  std::string path_ = "/state.db", vfs_ = disk_.vfs();
  sync::SystemClock clock_;
  StoreFixture f_;
  const std::shared_ptr<const OwnerRecords> records_ =
      std::make_shared<const OwnerRecords>(OwnerRecords{{1, {.token = "one"}}});
  sync::Mutex mutex_;
  sync::CondVar changed_;
  uint64_t durable_ VOXELD_GUARDED_BY(mutex_) = 0;
  std::unique_ptr<Keeper> keeper_;
};

TEST_F(KeeperTest, WhatComesTogetherIsWrittenTogether) {
  Begin(3600 * sync::kSecond);
  for (int i = 0; i < 100; ++i) Commit(absl::StrCat("e", i), false);
  EXPECT_EQ(keeper_->figures().transactions, 0u) << "no caller waits for it";
  Commit("last", true);
  AwaitDurable(newest());
  EXPECT_EQ(keeper_->figures().transactions, 1u);
  EXPECT_EQ(keeper_->figures().durable_snapshot, newest());
  EXPECT_EQ(RowsOnDisk(), 103u);  // the owner, the layer, its entities
}

TEST_F(KeeperTest, StopWritesWhatIsThere) {
  Begin(3600 * sync::kSecond);
  Commit("one", false);
  EXPECT_TRUE(keeper_->Stop().ok());
  EXPECT_EQ(RowsOnDisk(), 3u);
}

TEST_F(KeeperTest, OnlyWhatDiffersIsWritten) {
  Begin();
  for (int i = 0; i < 50; ++i) {
    Commit(absl::StrCat("e", i));
    AwaitDurable(newest());
  }
  // The first writes the owner and the layer as well; entities of a layer are not part of the
  // layer's own row.
  EXPECT_EQ(keeper_->figures().rows, 52u);
}

TEST_F(KeeperTest, AFullDiskIsToldAndTriedAgainAndNothingIsLost) {
  Begin();
  Commit("first");
  AwaitDurable(newest());
  disk_.SetRoom(0);
  for (int i = 0; i < 2000; ++i) {
    f_.CommitAll(Keeping(), Sequence(f_.last_sequence, Put("a", absl::StrCat("e", i))));
  }
  const uint64_t before = newest();
  Commit("second");
  const sync::TimeNs end = clock_.Now() + 30 * sync::kSecond;
  while (keeper_->figures().failures < 3 && clock_.Now() < end) std::this_thread::yield();
  EXPECT_THAT(keeper_->figures().trouble, HasSubstr("make room on its disk"));
  {
    sync::MutexLock lock(mutex_);
    EXPECT_LT(durable_, before);
  }
  disk_.SetRoom(UINT64_MAX);
  AwaitDurable(newest());
  EXPECT_EQ(keeper_->figures().trouble, "");
  EXPECT_EQ(RowsOnDisk(), 2004u);
}

TEST_F(KeeperTest, AFileThatIsDamagedIsReplacedByWhatTheSceneHas) {
  path_ = absl::StrCat(::testing::TempDir(), "/voxeld-keeper-", getpid(), ".db");
  vfs_.clear();
  Begin();
  Commit("first");
  AwaitDurable(newest());
  keeper_.reset();  // which writes everything into the file itself
  {
    std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
    for (std::streamoff at = 100; at < 12'000; at += 97) file.seekp(at).put('Z');
  }
  Begin();
  EXPECT_THAT(keeper_->figures().trouble, HasSubstr(".damaged-1"));
  Commit("second");
  AwaitDurable(newest());
  EXPECT_EQ(RowsOnDisk(), 4u) << "both are in the scene";
  EXPECT_EQ(std::remove(path_.c_str()), 0);
  EXPECT_EQ(std::remove((path_ + ".damaged-1").c_str()), 0);
}

// ------------------------------------------------------------------------------------ the client's
// view

class RecordingState final : public StateSink {
 public:
  void Offer(SnapshotPtr snapshot, std::shared_ptr<const OwnerRecords>, bool at_once) override {
    newest = snapshot->number;
    urgent = urgent || at_once;
  }
  uint64_t newest = 0;
  bool urgent = false;
};

class DurableCommits : public ::testing::Test {
 protected:
  void Open(DisconnectPolicy policy, StateSink* state) {
    core_.emplace(CoreOptions{.version = "test", .threads = false, .state = state}, clock_);
    ASSERT_TRUE(core_->Start().ok());
    core_->OpenSession({.on_disconnect = policy}, 0, sink_, [this](auto info) { info_ = *info; });
    core_->Step();
  }
  void Commit(uint64_t frame, bool durable) {
    std::vector<Operation> operations = Sequence(sequence_, Put("a", "e"));
    sequence_ += 2;
    operations.push_back({sequence_, daemon::Commit{.frame_id = frame, .durable = durable}});
    info_.intake->Take({.operations = std::move(operations)});
    core_->Step();
  }

  sync::FakeClock clock_;
  RecordingState state_;
  std::optional<Core> core_;
  std::shared_ptr<testing::RecordingSink> sink_ = std::make_shared<testing::RecordingSink>();
  SessionInfo info_;
  uint64_t sequence_ = 0;
};

TEST_F(DurableCommits, AreToldWhenTheirSnapshotIsWrittenOnceEach) {
  Open(DisconnectPolicy::kKeep, &state_);
  Commit(1, false);
  EXPECT_FALSE(state_.urgent);
  Commit(2, true);
  EXPECT_TRUE(state_.urgent);
  const uint64_t second = state_.newest;
  Commit(3, true);
  EXPECT_TRUE(sink_->Of<Durable>().empty());
  core_->OnDurable(second);
  core_->Step();
  ASSERT_EQ(sink_->Of<Durable>().size(), 1u);
  EXPECT_EQ(sink_->Of<Durable>()[0].first.frame_id, 2u);
  EXPECT_EQ(sink_->Of<Durable>()[0].second.snapshot, second);
  core_->OnDurable(state_.newest + 5);
  core_->OnDurable(state_.newest + 6);
  core_->Step();
  ASSERT_EQ(sink_->Of<Durable>().size(), 2u);
  EXPECT_EQ(sink_->Of<Durable>()[1].first.frame_id, 3u);
  EXPECT_TRUE(sink_->issues.empty());
  EXPECT_EQ(sink_->Of<Accepted>()[0].second.durable, false);
  EXPECT_EQ(sink_->Of<Accepted>()[1].second.durable, true);
}

TEST_F(DurableCommits, ThatCannotBeAreAppliedAndToldWhy) {
  for (const bool kept : {true, false}) {
    sink_->issues.clear();
    sequence_ = 0;
    Open(kept ? DisconnectPolicy::kKeep : DisconnectPolicy::kClear, kept ? nullptr : &state_);
    Commit(1, true);
    ASSERT_EQ(sink_->issues.size(), 1u);
    EXPECT_TRUE(sink_->issues[0].applied);
    EXPECT_EQ(sink_->issues[0].field, "commit.durable");
    EXPECT_THAT(sink_->issues[0].message, HasSubstr(kept ? "--state-dir" : "on_disconnect KEEP"));
    EXPECT_FALSE(sink_->Of<Accepted>().back().second.durable);
    EXPECT_EQ(sink_->Of<Accepted>().back().second.refused_operations, 0u);
  }
}

}  // namespace
}  // namespace voxeld::daemon::state
