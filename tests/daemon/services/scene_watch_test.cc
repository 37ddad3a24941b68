// Tests WatchScene over a real server.
#include <gmock/gmock.h>
#include <grpcpp/generic/generic_stub.h>

#include <future>
#include <thread>

#include "absl/strings/str_cat.h"
#include "daemon/core/scene_watch.h"
#include "daemon/wire/watch_messages.h"
#include "tests/daemon/services/daemon_fixture.h"
#include "tests/daemon/wire/watched_scene.h"

namespace voxeld::daemon::services {
namespace {

using ::testing::HasSubstr;

// A client that watches, and records what it was told.
class Watcher {
 public:
  explicit Watcher(v1::SceneService::Stub& stub, v1::WatchSceneRequest request = {})
      : request_(std::move(request)) {
    SetDeadline(context_);
    call_ = stub.WatchScene(&context_, request_);
  }

  // Reads one message; returns false at the end.
  bool Read() {
    v1::WatchSceneResponse message;
    if (!call_->Read(&message)) return false;
    ++messages;
    if (message.in_sync() != 0) ++change_sets;
    scene_.Apply(message);
    return true;
  }
  // Reads until it knows that snapshot or a later one.
  void ReadTo(uint64_t snapshot) {
    while (scene_.in_sync() < snapshot) {
      if (!Read()) {
        ADD_FAILURE() << "the watch ended at " << scene_.in_sync() << " before " << snapshot;
        return;
      }
    }
  }
  // Reads up to the newest snapshot, and checks that it knows all of it.
  void ExpectNewest(Daemon& daemon) {
    const SnapshotPtr newest = daemon.core().scene_watch().newest();
    ReadTo(newest->number);
    EXPECT_EQ(scene_.in_sync(), newest->number);
    EXPECT_EQ(scene_.words(), wire::InWords(*newest, request_));
  }
  const wire::WatchedScene& scene() const { return scene_; }
  void Cancel() { context_.TryCancel(); }
  grpc::Status Finish() {
    while (Read()) {
    }
    return call_->Finish();
  }

  int messages = 0, change_sets = 0;

 private:
  const v1::WatchSceneRequest request_;
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReader<v1::WatchSceneResponse>> call_;
  wire::WatchedScene scene_;
};

v1::WatchSceneRequest Request(uint64_t owner, const std::string& layer, bool contents) {
  v1::WatchSceneRequest request;
  request.set_owner(owner);
  request.set_layer(layer);
  request.set_contents(contents);
  return request;
}

v1::StreamRequest PointsIn(const std::string& layer, const std::string& id, uint32_t count) {
  v1::StreamRequest request;
  request.mutable_upsert()->set_layer(layer);
  request.mutable_upsert()->set_id(id);
  v1::Vertices* vertices = request.mutable_upsert()
                               ->mutable_entity()
                               ->mutable_primitive()
                               ->mutable_points()
                               ->mutable_vertices();
  vertices->set_count(count);
  vertices->set_positions(std::string(size_t{12} * count, '\0'));
  return request;
}

// Commits, and waits. Returns the number of its snapshot.
uint64_t CommitNow(Client& client, uint64_t frame_id) {
  client.Commit(frame_id);
  const size_t before = client.answers.size();
  while (client.answers.size() == before) {
    if (!client.Read().has_value()) {
      ADD_FAILURE() << "the stream has ended";
      return 0;
    }
  }
  return client.answers.back().accepted().snapshot();
}

v1::Open NoOutcomes() {
  v1::Open open;
  open.set_client_name("painter");
  open.set_no_outcomes(true);
  return open;
}

TEST(WatchScene, AnEmptySceneIsInSyncAtOnce) {
  Daemon daemon;
  Watcher watcher(daemon.scene());
  ASSERT_TRUE(watcher.Read());
  EXPECT_GT(watcher.scene().in_sync(), 0u);
  EXPECT_TRUE(watcher.scene().words().layers.empty());
}

TEST(WatchScene, WhoComesLateGetsTheStateAndThenWhatChanges) {
  Daemon daemon;
  Client client(daemon.scene());
  client.Open(NoOutcomes());
  for (int n = 0; n < 2000; ++n) client.Send(SphereIn("balls", absl::StrCat("ball", n)));
  client.Send(PointsIn("points", "cloud", 100'000));
  v1::StreamRequest object;
  object.mutable_define_object()->set_object("thing");
  v1::Object::Part* part = object.mutable_define_object()->mutable_definition()->add_parts();
  part->mutable_primitive()->mutable_sphere()->set_radius(0.25);
  client.Send(object);
  CommitNow(client, 1);

  Watcher known(daemon.scene());
  Watcher whole(daemon.scene(), Request(0, "", true));
  Watcher one(daemon.scene(), Request(0, "points", true));
  Watcher nobody(daemon.scene(), Request(77, "", false));
  for (Watcher* watcher : {&known, &whole, &one, &nobody}) watcher->ExpectNewest(daemon);
  EXPECT_EQ(known.scene().words().entities.size(), 2001u);
  EXPECT_EQ(whole.scene().words().objects.size(), 1u);
  EXPECT_EQ(one.scene().words().entities.size(), 1u);
  EXPECT_TRUE(nobody.scene().words().layers.empty());
  EXPECT_GT(whole.messages, 3);

  // Each watcher receives each change, and nothing else.
  v1::StreamRequest move;
  move.mutable_set_transform()->set_layer("balls");
  move.mutable_set_transform()->set_id("ball7");
  for (int i = 0; i < 12; ++i) {
    move.mutable_set_transform()->mutable_transform()->add_m(i % 5 == 0 ? 2 : 0);
  }
  client.Send(move);
  CommitNow(client, 2);
  for (Watcher* watcher : {&known, &whole, &one, &nobody}) {
    const int before = watcher->messages;
    watcher->ExpectNewest(daemon);
    EXPECT_EQ(watcher->messages, before + 1);
  }
  v1::StreamRequest gone;
  gone.mutable_delete_()->set_layer("points");
  gone.mutable_delete_()->set_all_of_layer(true);
  client.Send(gone);
  CommitNow(client, 3);
  for (Watcher* watcher : {&known, &whole, &one, &nobody}) watcher->ExpectNewest(daemon);
  EXPECT_TRUE(one.scene().words().entities.empty());

  // The client leaves, and its scene is removed.
  client.HalfClose();
  EXPECT_TRUE(client.Finish().ok());
  ASSERT_TRUE(daemon.Await([](const v1::Stats& stats) { return stats.layers() == 0; }));
  for (Watcher* watcher : {&known, &whole, &one, &nobody}) {
    watcher->ExpectNewest(daemon);
    EXPECT_TRUE(watcher->scene().words().layers.empty());
  }
}

TEST(WatchScene, OrphansAreTold) {
  Daemon daemon;
  Client client(daemon.scene());
  v1::Open open = NoOutcomes();
  open.set_on_disconnect(v1::DISCONNECT_POLICY_KEEP);
  client.Open(open);
  client.Send(SphereIn("kept", "ball"));
  const uint64_t snapshot = CommitNow(client, 1);
  Watcher watcher(daemon.scene());
  watcher.ReadTo(snapshot);
  client.HalfClose();
  EXPECT_TRUE(client.Finish().ok());
  watcher.ReadTo(snapshot + 1);
  watcher.ExpectNewest(daemon);
  EXPECT_TRUE(daemon.Entities().layers(0).orphaned());
}

// A watcher that does not read holds two snapshots, however many there are, and delays nobody; then
// it reaches the newest with few change sets.
constexpr uint32_t kPoints = 80'000;  // near a megabyte

// A connection whose transport does not accept more unread bytes as time goes on.
std::unique_ptr<v1::SceneService::Stub> StubOfFixedWindow(const Daemon& daemon) {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  arguments.SetInt(GRPC_ARG_HTTP2_BDP_PROBE, 0);
  return v1::SceneService::NewStub(
      grpc::CreateCustomChannel(daemon.target(), grpc::InsecureChannelCredentials(), arguments));
}

TEST(WatchScene, WhoTakesNothingForTooLongHoldsNothing) {
  DaemonOptions options;
  options.watch_write_limit_ns = sync::kSecond;  // the busy one is delayed, too, but shorter
  options.max_scene_watches = 2;
  Daemon daemon(options);
  Client client(daemon.scene());
  client.Open(NoOutcomes());
  for (int n = 0; n < 6; ++n) client.Send(PointsIn("layer", absl::StrCat(n), kPoints));
  CommitNow(client, 1);
  const std::weak_ptr<const Snapshot> first = daemon.core().scene_watch().newest();
  const auto stub = StubOfFixedWindow(daemon);
  Watcher idle(*stub, Request(0, "", true));
  Watcher busy(daemon.scene(), Request(0, "", true));
  ASSERT_TRUE(idle.Read());
  EXPECT_EQ(idle.change_sets, 0);
  client.Send(PointsIn("layer", "0", kPoints));
  busy.ReadTo(CommitNow(client, 2));
  // Held for the idle one, until its time is over.
  for (int tries = 0; !first.expired() && tries < 1'000'000; ++tries) daemon.Stats();
  EXPECT_TRUE(first.expired());
  Watcher third(daemon.scene());
  EXPECT_TRUE(third.Read()) << "its place is free, though it has not read its end";
  third.Cancel();
  const grpc::Status ended = idle.Finish();
  EXPECT_EQ(ended.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(ended.error_message(), HasSubstr("took no message for 1000 ms"));
  EXPECT_THAT(ended.error_message(), HasSubstr("watch_write_limit_ns"));
  busy.ExpectNewest(daemon);
}

TEST(WatchScene, NothingIsQueuedForWhoDoesNotRead) {
  Daemon daemon;
  Client client(daemon.scene());
  client.Open(NoOutcomes());
  constexpr int kClouds = 6;
  for (int n = 0; n < kClouds; ++n) client.Send(PointsIn("layer", absl::StrCat(n), kPoints));
  const uint64_t first = CommitNow(client, 1);
  const auto stub = StubOfFixedWindow(daemon);
  Watcher idle(*stub, Request(0, "", true));
  Watcher busy(daemon.scene(), Request(0, "", true));
  ASSERT_TRUE(idle.Read());  // the first cloud: it has started
  EXPECT_EQ(idle.change_sets, 0);

  std::vector<std::weak_ptr<const Snapshot>> snapshots;
  for (uint64_t n = 0; n < 60; ++n) {
    client.Send(PointsIn("layer", absl::StrCat(n % kClouds), kPoints));
    const uint64_t number = CommitNow(client, 2 + n);
    snapshots.push_back(daemon.core().scene_watch().newest());
    busy.ReadTo(number);
  }
  busy.ExpectNewest(daemon);
  EXPECT_EQ(busy.scene().in_sync(), first + 60);
  const auto alive = [&] {
    int count = 0;
    for (const auto& snapshot : snapshots) count += snapshot.expired() ? 0 : 1;
    return count;
  };
  // The newest; and, for a moment, those that displays, and the core that frees them, still hold.
  for (int tries = 0; alive() > 1 && tries < 10'000; ++tries) daemon.Stats();
  EXPECT_EQ(alive(), 1);

  idle.ExpectNewest(daemon);
  EXPECT_LE(idle.change_sets, 3);
}

TEST(WatchScene, NoMoreAtOnceThanAllowed) {
  DaemonOptions options;
  options.max_scene_watches = 2;
  Daemon daemon(options);
  Watcher first(daemon.scene()), second(daemon.scene());
  ASSERT_TRUE(first.Read());
  ASSERT_TRUE(second.Read());
  Watcher third(daemon.scene());
  EXPECT_FALSE(third.Read());
  const grpc::Status refused = third.Finish();
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(refused.error_message(), HasSubstr("2 watches of the scene are open"));
  EXPECT_THAT(refused.error_message(), HasSubstr("max_scene_watches"));
  // The place of a call that has ended is free again.
  first.Cancel();
  EXPECT_EQ(first.Finish().error_code(), grpc::StatusCode::CANCELLED);
  for (bool free = false; !free;) {
    Watcher another(daemon.scene());
    free = another.Read();
    if (free) another.Cancel();
    const grpc::StatusCode code = another.Finish().error_code();
    ASSERT_EQ(code, free ? grpc::StatusCode::CANCELLED : grpc::StatusCode::RESOURCE_EXHAUSTED);
  }
}

TEST(WatchScene, EndsAtShutdown) {
  Daemon daemon;
  Client client(daemon.scene());
  client.Open(NoOutcomes());
  for (int n = 0; n < 4; ++n) client.Send(PointsIn("layer", absl::StrCat(n), 80'000));
  const uint64_t snapshot = CommitNow(client, 1);
  Watcher idle(daemon.scene());
  idle.ReadTo(snapshot);
  daemon.server().Shutdown(10 * sync::kSecond);
  const grpc::Status status = idle.Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(status.error_message(), "shutting down");
}

TEST(WatchScene, BytesThatAreNoRequestAreRefused) {
  Daemon daemon;
  grpc::GenericStub stub(daemon.NewChannel());
  grpc::ClientContext context;
  SetDeadline(context);
  const grpc::Slice slice(
      std::string("\x12\x05"
                  "abc"));  // a layer name of 5 bytes of which 3 are sent
  const grpc::ByteBuffer request(&slice, 1);
  grpc::ByteBuffer response;
  std::promise<grpc::Status> done;
  stub.UnaryCall(&context, "/voxeld.v1.SceneService/WatchScene", grpc::StubOptions(), &request,
                 &response, [&done](grpc::Status status) { done.set_value(std::move(status)); });
  const grpc::Status status = done.get_future().get();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_THAT(status.error_message(), HasSubstr("WatchSceneRequest"));
}

// Watchers that start and end at any moment, while commits continue.
TEST(WatchScene, WatchersComeAndGoAtAnyTime) {
  Daemon daemon;
  std::atomic<bool> enough = false;
  std::thread painter([&] {
    Client client(daemon.scene());
    client.Open(NoOutcomes());
    for (uint64_t n = 1; !enough; ++n) {
      client.Send(SphereIn(absl::StrCat("layer", n % 5), absl::StrCat(n % 40)));
      if (n % 7 == 0) {
        v1::StreamRequest gone;
        gone.mutable_delete_()->set_all_mine(true);
        client.Send(gone);
      }
      CommitNow(client, n);
    }
    client.HalfClose();
    EXPECT_TRUE(client.Finish().ok());
  });
  std::vector<std::thread> threads;
  for (int t = 0; t < 3; ++t) {
    threads.emplace_back([&daemon, t] {
      for (int n = 0; n < 40; ++n) {
        Watcher watcher(daemon.scene(), Request(0, t == 1 ? "layer1" : "", t == 2));
        for (int reads = (n * 7 + t) % 23; reads > 0; --reads) EXPECT_TRUE(watcher.Read());
        watcher.Cancel();
        EXPECT_EQ(watcher.Finish().error_code(), grpc::StatusCode::CANCELLED);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  Watcher last(daemon.scene());
  EXPECT_TRUE(last.Read());
  enough = true;
  painter.join();
  ASSERT_TRUE(daemon.Await([](const v1::Stats& stats) { return stats.layers() == 0; }));
  last.ExpectNewest(daemon);
}

}  // namespace
}  // namespace voxeld::daemon::services
