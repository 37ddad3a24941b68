// Tests that persistent state is restored unchanged: random scenes through the file into another
// core.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <random>

#include "absl/strings/str_cat.h"
#include "daemon/core/core.h"
#include "daemon/core/scene_info.h"
#include "daemon/core/scene_watch.h"
#include "daemon/state/keeper.h"
#include "daemon/state/kept_view.h"
#include "daemon/state/restore.h"
#include "daemon/wire/encode.h"
#include "daemon/wire/kept.h"
#include "display/sync/fake_clock.h"
#include "tests/daemon/scene/random_scene.h"
#include "tests/daemon/wire/random_primitive.h"
#include "tests/daemon/wire/watched_scene.h"
#include "tests/small_stack.h"
#include "voxeld/v1/state.pb.h"

namespace voxeld::daemon::state {
namespace {

using testing::StoreFixture;

constexpr int64_t kUnixNs = 1'700'000'000'000'000'000;

// Returns everything that must be restored, as text: the order of layers among themselves instead
// of their numbers.
std::string KeptInWords(const SnapshotPtr& snapshot, sync::TimeNs now) {
  const SnapshotPtr view = KeptView(snapshot);
  std::vector<std::pair<uint64_t, std::string>> layers;
  std::string text;
  view->layers.ForEach([&](const OwnedName& key, const LayerPtr& layer) {
    LayerInfo info = InfoOf(key, *layer);
    info.number = info.entities = info.bytes = 0;
    info.orphaned = true;
    v1::LayerInfo wire;
    wire::Encode(info, &wire);
    std::string words = wire.ShortDebugString();
    layer->entities.ForEach([&](const std::string& id, const EntityPtr& entity) {
      const EntityData& data = entity->data;
      absl::StrAppend(&words, "\n  ", id, " ", data.priority, " ", data.erase, " ", data.label, " ",
                      wire::InWords(data.transform), " ", wire::InWords(data.content), " ",
                      entity->expires_ns == sync::kNever ? 0 : entity->expires_ns - now);
    });
    layers.emplace_back(layer->number, std::move(words));
  });
  std::sort(layers.begin(), layers.end());
  for (const auto& [number, words] : layers) absl::StrAppend(&text, words, "\n");
  view->objects.ForEach([&](const OwnedName& key, const ObjectPtr& object) {
    absl::StrAppend(&text, "object ", key.owner, "/", key.name);
    for (const ObjectPart& part : object->data->parts) {
      absl::StrAppend(&text, " ", wire::InWords(part.transform), wire::InWords(part.content), ";");
    }
    absl::StrAppend(&text, "\n");
  });
  return text;
}

Author AuthorOf(uint64_t owner, bool keep) {
  Author author;
  author.owner = owner;
  author.writer = std::make_shared<const Writer>(
      Writer{.session = 10 * owner + keep, .client_name = keep ? "keeps" : "goes", .keep = keep});
  return author;
}

class KeptScene : public ::testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directory(folder_); }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::unique_ptr<StateFile> OpenFile() {
    auto file = StateFile::Open(
        {.path = folder_ + "/state.db", .vfs = "", .now = [] { return int64_t{1}; }});
    EXPECT_TRUE(file.ok()) << file.status();
    return *std::move(file);
  }
  std::unique_ptr<Keeper> MakeKeeper() {
    return std::make_unique<Keeper>(
        OpenFile(),
        KeeperOptions{.interval_ns = 0, .unix_ns = [](sync::TimeNs now) { return kUnixNs + now; }},
        clock_);
  }
  // Restores into a core of its own, which must live as long as the returned snapshot is used.
  SnapshotPtr Restored(std::unique_ptr<Core>* core, uint64_t* expired = nullptr) {
    const auto file = OpenFile();
    *core = std::make_unique<Core>(CoreOptions{.version = "test", .threads = false}, clock_);
    auto state = ReadState(*file, {clock_.Now(), UnixNs()}, (*core)->limits(), nullptr, nullptr);
    EXPECT_TRUE(state.ok()) << state.status();
    EXPECT_EQ(state->left_out, 0u) << state->why.front();
    if (expired != nullptr) *expired = state->expired;
    owners_ = state->scene.owners;
    const std::vector<Issue> issues = (*core)->Restore(std::move(state->scene));
    for (const Issue& issue : issues) ADD_FAILURE() << issue.message;
    return (*core)->scene_watch().newest();
  }

  int64_t UnixNs() const { return kUnixNs + clock_.Now(); }

  OwnerRecords owners_;  // as last restored
  const std::string folder_ = absl::StrCat(::testing::TempDir(), "/voxeld-kept-", getpid());
  sync::FakeClock clock_;
};

// As in a file written by others; the stack does not grow with the chain.
TEST_F(KeptScene, ObjectsInALongChainAreRead) {
  constexpr int kObjects = 50'000;
  const auto name = [](int i) { return absl::StrCat("o", 1'000'000 + i); };
  const auto file = OpenFile();
  bool given = false;
  const absl::Status put = file->Apply([&] {
    std::vector<Change> changes;
    if (std::exchange(given, true)) return changes;
    changes.push_back(
        {Change::What::kPut, {RowKind::kOwner, 1, "", ""}, wire::EncodeKept(OwnerRecord{})});
    for (int i = 0; i < kObjects; ++i) {
      v1::KeptObject object;
      object.mutable_definition()->add_parts()->mutable_primitive()->mutable_instance()->set_object(
          name(i + 1));
      changes.push_back(
          {Change::What::kPut, {RowKind::kObject, 1, name(i), ""}, object.SerializeAsString()});
    }
    return changes;
  });
  ASSERT_TRUE(put.ok()) << put;
  absl::StatusOr<RestoredState> state = absl::UnknownError("not read");
  OnSmallStack(
      [&] {
        state = ReadState(*file, {0, kUnixNs}, Limits(), nullptr, nullptr);
      },
      512 << 10);
  ASSERT_TRUE(state.ok()) << state.status();
  EXPECT_EQ(state->objects, uint64_t{kObjects});
  ASSERT_FALSE(state->scene.steps.empty());
  const auto& operations = state->scene.steps.front().operations;
  ASSERT_EQ(operations.size(), size_t{kObjects});
  EXPECT_EQ(std::get<DefineObject>(operations.front().op).object, name(kObjects - 1));
  EXPECT_EQ(std::get<DefineObject>(operations.back().op).object, name(0));
}

TEST_F(KeptScene, RandomScenesComeBackTheSame) {
  const auto records = std::make_shared<const OwnerRecords>(OwnerRecords{
      {1, {.token = "one", .principal = "stage"}}, {2, {.token = "two", .max_entities = 5000}}});
  size_t most = 0;
  for (uint32_t seed = 1; seed <= 40; ++seed) {
    SCOPED_TRACE(seed);
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directory(folder_);
    std::mt19937 random(seed);
    wire::RandomPrimitives primitives(random);
    const auto content = [&] {
      Content out;
      EXPECT_FALSE(wire::ToContent(wire::FieldPath("primitive"), primitives.Next(20, false),
                                   {Limits()}, &out)
                       .has_value());
      return out;
    };
    StoreFixture f;
    auto keeper = MakeKeeper();
    for (int step = 0; step < 40; ++step) {
      std::vector<Operation> operations = testing::RandomOperations(random, 12);
      for (Operation& operation : operations) {
        operation.sequence = ++f.last_sequence;
        if (auto* upsert = std::get_if<Upsert>(&operation.op)) {
          if (std::holds_alternative<GeometryPtr>(upsert->entity.content)) {
            upsert->entity.content = content();
            upsert->entity.label = absl::StrCat("label", random() % 9);
          }
          upsert->entity.lifetime_ns *= sync::kSecond;
        } else if (auto* define = std::get_if<DefineObject>(&operation.op)) {
          auto data = std::make_shared<ObjectData>(*define->data);
          for (ObjectPart& part : data->parts) {
            if (std::holds_alternative<GeometryPtr>(part.content)) part.content = content();
          }
          define->data = std::move(data);
        } else if (auto* state = std::get_if<LayerState>(&operation.op)) {
          state->order = static_cast<int32_t>(random() % 5) - 2;
          state->opacity = random() % 256;
          state->blend = static_cast<gpu::BlendMode>(random() % 3);
        }
      }
      f.now = clock_.Now();
      f.store.Expire(f.now);
      f.CommitAll(AuthorOf(1 + random() % 2, random() % 3 != 0), std::move(operations));
      if (random() % 8 == 0)
        f.store.RemoveLayers([&](const OwnedName& key, const Layer&) { return key.name == "l1"; },
                             random() % 2 == 0);
      if (random() % 3 == 0) keeper->Offer(f.store.snapshot(), records, true);
      clock_.Advance(sync::kSecond / 4);
    }
    f.now = clock_.Now();
    f.store.Expire(f.now);
    keeper->Offer(f.store.snapshot(), records, true);
    ASSERT_TRUE(keeper->Stop().ok());
    const std::string before = KeptInWords(f.store.snapshot(), clock_.Now());
    most = std::max(most, before.size());

    std::unique_ptr<Core> core;
    const SnapshotPtr restored = Restored(&core);
    EXPECT_EQ(KeptInWords(restored, clock_.Now()), before);
    EXPECT_EQ(testing::CheckIndices(*restored), "");

    // And again, since restored state continues to be persistent.
    auto again = MakeKeeper();
    again->Knows(restored, owners_);
    again->Offer(restored, records, true);
    ASSERT_TRUE(again->Stop().ok());
    EXPECT_EQ(again->figures().transactions, 0u) << "nothing differs";
    std::unique_ptr<Core> third;
    EXPECT_EQ(KeptInWords(Restored(&third), clock_.Now()), before);
  }
  EXPECT_GT(most, 10'000u);
}

TEST_F(KeptScene, WhatIsMadeLaterLiesAboveWhatCameBack) {
  StoreFixture f;
  f.CommitAll(AuthorOf(1, true),
              testing::Sequence(0, testing::Put("b", "e"), testing::Put("a", "e")));
  auto keeper = MakeKeeper();
  const auto records = std::make_shared<const OwnerRecords>(OwnerRecords{{1, {.token = "one"}}});
  keeper->Offer(f.store.snapshot(), records, true);
  ASSERT_TRUE(keeper->Stop().ok());
  std::unique_ptr<Core> core;
  const SnapshotPtr restored = Restored(&core);
  const uint64_t a = restored->FindLayer({1, "a"})->number,
                 b = restored->FindLayer({1, "b"})->number;
  EXPECT_LT(b, a) << "in the order in which they were made";
  EXPECT_GT(b, f.store.snapshot()->FindLayer({1, "a"})->number) << "greater than all in the file";
}

TEST_F(KeptScene, OwnersComeBackWithTheirTokensQuotasAndNames) {
  StoreFixture f;
  f.CommitAll(AuthorOf(7, true), testing::Sequence(0, testing::Put("a", "e")));
  f.CommitAll(AuthorOf(9, true), testing::Sequence(10, testing::Put("a", "e")));
  f.CommitAll(AuthorOf(8, false), testing::Sequence(20, testing::Put("a", "e")));
  auto keeper = MakeKeeper();
  keeper->Offer(
      f.store.snapshot(),
      std::make_shared<const OwnerRecords>(OwnerRecords{
          {7, {.token = "seven", .principal = "stage", .hidden = true, .max_bytes = 5000000}},
          {8, {.token = "eight"}},
          {9, {.token = "nine"}}}),
      true);
  ASSERT_TRUE(keeper->Stop().ok());
  std::unique_ptr<Core> core;
  const SnapshotPtr restored = Restored(&core);
  EXPECT_TRUE(restored->FindLayer({7, "a"})->suppressed);
  EXPECT_EQ(restored->FindLayer({8, "a"}), nullptr);
  ASSERT_TRUE(core->Start().ok());
  std::vector<OwnerInfo> owners;
  core->ListOwners([&](auto all) { owners = *all; });
  core->Step();
  ASSERT_EQ(owners.size(), 2u);
  EXPECT_EQ(owners[0].owner, 7u);
  EXPECT_EQ(owners[0].principal, "stage");
  EXPECT_EQ(owners[0].max_bytes, 5000000u);
  EXPECT_EQ(owners[0].orphaned_layers, 1u);
  // A client with the token, or the name, is the owner again.
  for (const OpenOptions& open :
       {OpenOptions{.owner_token = "nine"}, OpenOptions{.principal = "stage"}, OpenOptions{}}) {
    absl::StatusOr<SessionInfo> info;
    core->OpenSession(open, 0, nullptr, [&](auto opened) { info = std::move(opened); });
    core->Step();
    ASSERT_TRUE(info.ok()) << info.status();
    EXPECT_EQ(info->owner, open.owner_token == "nine" ? 9u : open.principal == "stage" ? 7u : 10u);
  }
}

TEST_F(KeptScene, LifetimesGoOnByTheWallClock) {
  StoreFixture f;
  f.now = clock_.Now();
  EntityData data = testing::Entity1(testing::Dots(1));
  data.lifetime_ns = 10 * sync::kSecond;
  EntityData brief = data;
  brief.lifetime_ns = sync::kSecond;
  f.CommitAll(AuthorOf(1, true), testing::Sequence(0, testing::Put("a", "long", data),
                                                   testing::Put("a", "brief", brief)));
  auto keeper = MakeKeeper();
  keeper->Offer(f.store.snapshot(),
                std::make_shared<const OwnerRecords>(OwnerRecords{{1, {.token = "one"}}}), true);
  ASSERT_TRUE(keeper->Stop().ok());
  // The machine was off for four seconds, and its monotonic clock starts again.
  const auto file = OpenFile();
  sync::FakeClock later;
  Core core({.version = "test", .threads = false}, later);
  auto state = ReadState(*file, {later.Now(), UnixNs() + 4 * sync::kSecond}, core.limits(), nullptr,
                         nullptr);
  ASSERT_TRUE(state.ok());
  EXPECT_EQ(state->expired, 1u);
  core.Restore(std::move(state->scene));
  const EntityPtr entity = core.scene_watch().newest()->FindEntity({1, "a"}, "long");
  ASSERT_NE(entity, nullptr);
  EXPECT_EQ(entity->expires_ns, later.Now() + 6 * sync::kSecond);
}

TEST_F(KeptScene, RowsThatAreWrongAreLeftOutAndTheOthersCome) {
  StoreFixture f;
  f.CommitAll(AuthorOf(1, true),
              testing::Sequence(0, testing::Put("a", "good"), testing::Put("a", "bad")));
  auto keeper = MakeKeeper();
  keeper->Offer(f.store.snapshot(),
                std::make_shared<const OwnerRecords>(OwnerRecords{{1, {.token = "one"}}}), true);
  ASSERT_TRUE(keeper->Stop().ok());
  const auto file = OpenFile();
  std::vector<Change> changes = {
      {Change::What::kPut, {RowKind::kEntity, 1, "a", "bad"}, "\xff\xff\xff"},
      {Change::What::kPut, {RowKind::kEntity, 1, "nowhere", "e"}, ""},
      {Change::What::kPut, {RowKind::kLayer, 5, "nobody's", ""}, ""}};
  ASSERT_TRUE(file->Apply([&] { return std::exchange(changes, {}); }).ok());
  auto state = ReadState(*file, {clock_.Now(), kUnixNs}, Limits(), nullptr, nullptr);
  ASSERT_TRUE(state.ok());
  EXPECT_EQ(state->left_out, 3u);
  EXPECT_EQ(state->entities, 1u);
  ASSERT_EQ(state->why.size(), 3u);
  EXPECT_TRUE(state->why[2].ends_with("its layer is not there")) << state->why[2];
  EXPECT_EQ(state->layers, 1u);
  // The present limit on messages does not apply to what was accepted before.
  Limits small;
  small.max_message_bytes = 1;
  state = ReadState(*file, {clock_.Now(), kUnixNs}, small, nullptr, nullptr);
  ASSERT_TRUE(state.ok());
  EXPECT_EQ(state->entities, 1u);
}

// Unreadable rows of every kind, and rows of owners that do not exist.
TEST_F(KeptScene, EachRowThatIsLeftOutIsToldUpToALimit) {
  const auto file = OpenFile();
  const std::string wrong = "\xff\xff\xff";
  std::vector<Change> changes = {{Change::What::kPut, {RowKind::kOwner, 1, "", ""}, ""},
                                 {Change::What::kPut, {RowKind::kOwner, 2, "", ""}, wrong},
                                 {Change::What::kPut, {RowKind::kObject, 1, "o", ""}, wrong},
                                 {Change::What::kPut, {RowKind::kObject, 9, "o", ""}, ""},
                                 {Change::What::kPut, {RowKind::kLayer, 1, "l\n", ""}, wrong},
                                 {Change::What::kPut, {static_cast<RowKind>(77), 1, "l", ""}, ""}};
  ASSERT_TRUE(file->Apply([&] { return std::exchange(changes, {}); }).ok());
  auto state = ReadState(*file, {clock_.Now(), kUnixNs}, Limits(), nullptr, nullptr);
  ASSERT_TRUE(state.ok()) << state.status();
  EXPECT_EQ(state->left_out, 5u);
  ASSERT_EQ(state->why.size(), 5u);
  std::vector<std::string> begins;
  for (const std::string& why : state->why) begins.push_back(why.substr(0, why.find(':')));
  std::sort(begins.begin(), begins.end());
  EXPECT_EQ(begins, (std::vector<std::string>{"entity 1/l/", "layer 1/l\\n/", "object 1/o/",
                                              "object 9/o/", "owner 2//"}));
  EXPECT_EQ(state->scene.owners.size(), 1u);
  EXPECT_EQ(state->objects, 0u);
  EXPECT_EQ(state->layers, 0u);

  for (uint64_t owner = 100; owner < 130; ++owner) {
    changes.push_back({Change::What::kPut, {RowKind::kLayer, owner, "l", ""}, ""});
  }
  ASSERT_TRUE(file->Apply([&] { return std::exchange(changes, {}); }).ok());
  state = ReadState(*file, {clock_.Now(), kUnixNs}, Limits(), nullptr, nullptr);
  ASSERT_TRUE(state.ok()) << state.status();
  EXPECT_EQ(state->left_out, 35u);
  EXPECT_EQ(state->why.size(), RestoredState::kMostSaid);
}

// Steps are of a bounded size; together they hold everything that was persistent.
TEST_F(KeptScene, ALargeLayerComesInSeveralSteps) {
  constexpr size_t kEntities = 4096 + 1;
  StoreFixture f;
  std::vector<Operation> operations;
  for (size_t i = 0; i < kEntities; ++i) {
    operations.push_back(testing::Put("a", absl::StrCat("e", i)));
  }
  Author author = AuthorOf(1, true);
  f.CommitAll(author, std::move(operations));
  auto keeper = MakeKeeper();
  keeper->Offer(f.store.snapshot(),
                std::make_shared<const OwnerRecords>(OwnerRecords{{1, {.token = "one"}}}), true);
  ASSERT_TRUE(keeper->Stop().ok());
  const auto file = OpenFile();
  auto state = ReadState(*file, {clock_.Now(), kUnixNs}, Limits(), nullptr, nullptr);
  ASSERT_TRUE(state.ok()) << state.status();
  EXPECT_EQ(state->entities, kEntities);
  size_t most = 0, all = 0;
  for (const RestoredScene::Step& step : state->scene.steps) {
    most = std::max(most, step.operations.size());
    all += step.operations.size();
  }
  EXPECT_EQ(most, 4096u);
  EXPECT_EQ(all, kEntities + 1) << "and the layer";
}

// Only what refers to an object whose row is lost is refused, by name.
TEST_F(KeptScene, WhatRefersToALostObjectIsNotRestored) {
  StoreFixture f;
  f.CommitAll(
      AuthorOf(1, true),
      testing::Sequence(0, testing::Define("leaf", {{testing::Dots(0), {}}}),
                        testing::Define("tree", {{InstanceRef{"leaf"}, {}}}),
                        testing::PutInstance("a", "of-tree", "tree"), testing::Put("a", "alone")));
  auto keeper = MakeKeeper();
  keeper->Offer(f.store.snapshot(),
                std::make_shared<const OwnerRecords>(OwnerRecords{{1, {.token = "one"}}}), true);
  ASSERT_TRUE(keeper->Stop().ok());
  const auto file = OpenFile();
  std::vector<Change> changes = {{Change::What::kRemove, {RowKind::kObject, 1, "leaf", ""}, ""}};
  ASSERT_TRUE(file->Apply([&] { return std::exchange(changes, {}); }).ok());
  Core core({.version = "test", .threads = false}, clock_);
  auto state = ReadState(*file, {clock_.Now(), kUnixNs}, core.limits(), nullptr, nullptr);
  ASSERT_TRUE(state.ok()) << state.status();
  EXPECT_EQ(state->objects, 1u);
  EXPECT_EQ(state->left_out, 0u);
  const std::vector<Issue> issues = core.Restore(std::move(state->scene));
  ASSERT_EQ(issues.size(), 2u);
  EXPECT_NE(issues[0].message.find("leaf"), std::string::npos) << issues[0].message;
  EXPECT_NE(issues[1].message.find("tree"), std::string::npos) << issues[1].message;
  const SnapshotPtr snapshot = core.scene_watch().newest();
  EXPECT_NE(snapshot->FindEntity({1, "a"}, "alone"), nullptr);
  EXPECT_EQ(snapshot->FindEntity({1, "a"}, "of-tree"), nullptr);
}

}  // namespace
}  // namespace voxeld::daemon::state
