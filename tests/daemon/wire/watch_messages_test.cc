// Tests that a watch's messages add up to the whole snapshot, whichever states were skipped.
#include "daemon/wire/watch_messages.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "tests/daemon/scene/random_scene.h"
#include "tests/daemon/wire/random_primitive.h"
#include "tests/daemon/wire/watched_scene.h"

namespace voxeld::daemon::wire {
namespace {

using testing::Dots;
using testing::Entity1;
using testing::MakeAuthor;
using testing::Put;
using testing::StoreFixture;

// A watch and the client that receives its messages.
struct Watch {
  explicit Watch(v1::WatchSceneRequest wanted = {},
                 size_t message_bytes = WatchMessages::kMessageBytes)
      : request(std::move(wanted)), messages(request, message_bytes) {}

  // Sends messages over the wire. Returns the size of the greatest.
  size_t Bring(const SnapshotPtr& target) {
    size_t greatest = 0;
    count = 0;
    messages.Begin(target);
    while (!messages.in_sync()) {
      v1::WatchSceneResponse message, received;
      const absl::Status made = messages.Next(&message);
      EXPECT_TRUE(made.ok()) << made;
      if (!made.ok()) break;
      const std::string bytes = message.SerializeAsString();
      greatest = std::max(greatest, bytes.size());
      ++count;
      EXPECT_TRUE(received.ParseFromString(bytes));
      EXPECT_EQ(received.in_sync(), messages.in_sync() ? target->number : 0);
      client.Apply(received);
    }
    EXPECT_EQ(messages.told(), target->number);
    return greatest;
  }

  const v1::WatchSceneRequest request;
  WatchMessages messages;
  WatchedScene client;
  int count = 0;
};

v1::WatchSceneRequest Request(uint64_t owner, std::string layer, bool contents) {
  v1::WatchSceneRequest request;
  request.set_owner(owner);
  request.set_layer(std::move(layer));
  request.set_contents(contents);
  return request;
}

class RandomWatches {
 public:
  explicit RandomWatches(uint32_t seed) : random_(seed), primitives_(random_) {
    watches_.reserve(6);
    watches_.emplace_back();
    watches_.emplace_back(Request(0, "", true));
    // Messages that end after one change or a few, so that they end at every place.
    for (int n = 0; n < 4; ++n) {
      watches_.emplace_back(
          Request(random_() % 3, random_() % 2 == 0 ? absl::StrCat("l", random_() % 4) : "",
                  random_() % 2 == 0),
          1 + random_() % 1000);
    }
  }

  void Step() {
    switch (random_() % 8) {
      case 0: {
        const std::string name = absl::StrCat("l", random_() % 4);
        f_.store.RemoveLayers([&](const OwnedName& key, const Layer&) { return key.name == name; },
                              random_() % 3 == 0);
        break;
      }
      case 1:
        f_.now += random_() % 10;
        f_.store.Expire(f_.now);
        break;
      case 2:
        f_.Orphan(11 + random_() % 2);
        break;
      default:
        Commit();
        break;
    }
    for (Watch& watch : watches_) {
      if (random_() % 3 != 0) continue;
      if (watch.messages.told() == f_.store.snapshot()->number) continue;
      const size_t bytes = watch.Bring(f_.store.snapshot());
      greatest = std::max(greatest, bytes);
      most = std::max(most, watch.count);
      ASSERT_EQ(watch.client.words(), InWords(*f_.store.snapshot(), watch.request));
      ASSERT_EQ(watch.client.in_sync(), f_.store.snapshot()->number);
    }
  }

  size_t greatest = 0;  // size of the greatest message
  int most = 0;         // greatest number of messages of a change set

 private:
  Content SomeContent() {
    Content content;
    EXPECT_FALSE(ToContent(FieldPath("primitive"),
                           primitives_.Next(random_() % 6 == 0 ? 3000 : 10, false), {Limits()},
                           &content)
                     .has_value());
    return content;
  }

  void Commit() {
    std::vector<Operation> operations = testing::RandomOperations(random_, 12);
    for (Operation& operation : operations) {
      operation.sequence = ++f_.last_sequence;
      if (auto* upsert = std::get_if<Upsert>(&operation.op)) {
        if (std::holds_alternative<GeometryPtr>(upsert->entity.content)) {
          upsert->entity.content = SomeContent();
          upsert->entity.label = absl::StrCat("label", random_() % 9);
        }
      } else if (auto* define = std::get_if<DefineObject>(&operation.op)) {
        auto data = std::make_shared<ObjectData>(*define->data);
        for (ObjectPart& part : data->parts) {
          if (std::holds_alternative<GeometryPtr>(part.content)) part.content = SomeContent();
        }
        define->data = std::move(data);
      } else if (auto* state = std::get_if<LayerState>(&operation.op)) {
        state->order = static_cast<int32_t>(random_() % 5) - 2;
        state->opacity = random_() % 256;
        state->blend = static_cast<gpu::BlendMode>(random_() % 3);
      }
    }
    f_.CommitAll(MakeAuthor(1 + random_() % 2, 11 + random_() % 2), std::move(operations));
  }

  std::mt19937 random_;
  RandomPrimitives primitives_;
  StoreFixture f_;
  std::vector<Watch> watches_;
};

TEST(WatchMessages, RandomScenesAreKnownWhole) {
  size_t greatest = 0;
  int most = 0;
  for (uint32_t seed = 1; seed <= 200; ++seed) {
    SCOPED_TRACE(seed);
    RandomWatches watches(seed);
    for (int step = 0; step < 30; ++step) {
      watches.Step();
      if (HasFatalFailure()) return;
    }
    greatest = std::max(greatest, watches.greatest);
    most = std::max(most, watches.most);
  }
  EXPECT_GT(most, 15);  // there were change sets of many messages
  // The greatest primitive here has 9000 vertices of 15 bytes and as many indices of 4; an object
  // has at most three parts.
  EXPECT_LE(greatest, WatchMessages::kMessageBytes + 3 * 9000 * 19 + 4096);
}

TEST(WatchMessages, ManyEntitiesComeInManyMessages) {
  StoreFixture f;
  std::vector<Operation> operations;
  for (int n = 0; n < 20'000; ++n) {
    operations.push_back(Put("layer", absl::StrCat("entity", n), Entity1(Dots(1))));
    operations.back().sequence = ++f.last_sequence;
  }
  ASSERT_TRUE(f.CommitAll(f.me, std::move(operations)).applied);
  Watch watch;
  EXPECT_LT(watch.Bring(f.store.snapshot()), WatchMessages::kMessageBytes + 512);
  EXPECT_EQ(watch.client.words().entities.size(), 20'000u);
  EXPECT_GT(watch.count, 20);
  // Later differences take only as many bytes as they need.
  f.Commit(Put("layer", "entity7", Entity1(Dots(2))));
  EXPECT_LT(watch.Bring(f.store.snapshot()), 512u);
  EXPECT_EQ(watch.count, 1);
  f.store.RemoveLayers([](const OwnedName&, const Layer&) { return true; }, false);
  EXPECT_LT(watch.Bring(f.store.snapshot()), 64u);
  EXPECT_TRUE(watch.client.words().entities.empty());
}

TEST(WatchMessages, WhatDoesNotConcernAWatcherIsInSyncAlone) {
  StoreFixture f;
  Watch watch(Request(0, "mine", false));
  watch.Bring(f.store.snapshot());
  EXPECT_EQ(watch.client.in_sync(), 1u);  // the empty scene
  f.Commit(Put("theirs", "x"));
  watch.messages.Begin(f.store.snapshot());
  v1::WatchSceneResponse message;
  ASSERT_TRUE(watch.messages.Next(&message).ok());
  EXPECT_EQ(message.DebugString(), "in_sync: 2\n");
}

TEST(WatchMessages, HoldsTwoSnapshotsAtMost) {
  StoreFixture f;
  Watch watch;
  std::vector<std::weak_ptr<const Snapshot>> all;
  for (int n = 0; n < 10; ++n) {
    f.Commit(Put("layer", absl::StrCat(n)));
    all.push_back(f.store.snapshot());
    if (n == 3) watch.Bring(f.store.snapshot());
    if (n == 6) watch.messages.Begin(f.store.snapshot());
  }
  const auto alive = [&] {
    std::vector<int> numbers;
    for (int n = 0; n < 10; ++n) {
      if (!all[n].expired()) numbers.push_back(n);
    }
    return numbers;
  };
  EXPECT_THAT(alive(), ::testing::ElementsAre(3, 6, 9));  // the last is the store's
  v1::WatchSceneResponse message;
  ASSERT_TRUE(watch.messages.Next(&message).ok());
  EXPECT_TRUE(watch.messages.in_sync());
  EXPECT_THAT(alive(), ::testing::ElementsAre(6, 9));
}

// 45 parts of 48 MiB that are in fact one geometry: contents that fit into no message end a watch
// of contents.
TEST(WatchMessages, ContentsBeyondAMessageAreRefused) {
  auto part = std::make_shared<GeometryData>(*std::get<GeometryPtr>(Content(Dots(0))));
  part->record.vertex_count = 4 << 20;
  part->arrays = gpu::GeometryArrays::Of(part->record, std::vector<float>(size_t{12} << 20));
  std::vector<ObjectPart> parts(45, {GeometryPtr(std::move(part)), {}});
  Limits limits;
  limits.max_bytes_per_owner = limits.max_scene_bytes = uint64_t{1} << 40;
  StoreFixture roomy(limits);
  roomy.Commit(testing::Define("huge", std::move(parts)));
  ASSERT_EQ(roomy.store.snapshot()->objects.size(), 1u);
  Watch known;
  known.Bring(roomy.store.snapshot());
  WatchMessages whole(Request(0, "", true));
  whole.Begin(roomy.store.snapshot());
  v1::WatchSceneResponse message;
  const absl::Status status = whole.Next(&message);
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(status.message()), ::testing::HasSubstr("\"huge\""));
  EXPECT_THAT(std::string(status.message()), ::testing::HasSubstr("watch without contents"));
}

}  // namespace
}  // namespace voxeld::daemon::wire
