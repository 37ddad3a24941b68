// The client over gRPC: against the real services in this process, and against a server that
// misbehaves.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <thread>

#include "absl/strings/str_cat.h"
#include "client/cpp/src/grpc_transport.h"
#include "client/cpp/src/session_core.h"
#include "display/sync/clock.h"
#include "tests/daemon/services/daemon_fixture.h"
#include "tests/tools/voxelctl/fake_server.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "voxeld/client.h"

namespace voxeld::client {
namespace server_test {

using namespace std::chrono_literals;  // NOLINT
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr auto kPatience = 60s;

class WithDaemon : public testing::Test {
 protected:
  // Opens a session without pings: every message is the test's own.
  std::unique_ptr<Session> Open(Options options = {}) {
    options.address = daemon_.target();
    options.ping_interval = Duration(0);
    auto session = Session::Open(std::move(options));
    EXPECT_TRUE(session.ok()) << session.status();
    EXPECT_TRUE((*session)->WaitOpened(kPatience).ok());
    return *std::move(session);
  }
  std::vector<std::string> Entities() {
    std::vector<std::string> keys;
    const v1::ListEntitiesResponse all = daemon_.Entities();
    for (const v1::EntityInfo& entity : all.entities())
      keys.push_back(absl::StrCat(entity.key().layer(), "/", entity.key().id()));
    return keys;
  }

  daemon::services::Daemon daemon_;
};

TEST_F(WithDaemon, EveryShapeIsAccepted) {
  ASSERT_TRUE(daemon_.Await(daemon::services::AllShowing));
  auto session = Open({.strict = true});
  const Layer layer = session->GetLayer("l");
  const Vertices triangle{.positions = {0.f, 0.f, 0.f, 1.f, 0.f, 0.f, 0.f, 1.f, 0.f},
                          .colors = {uint8_t{1}, uint8_t{2}, uint8_t{3}, uint8_t{4}, uint8_t{5},
                                     uint8_t{6}, uint8_t{7}, uint8_t{8}, uint8_t{9}}};
  ASSERT_TRUE(session->DefineObject("o", {{.shape = Sphere{.radius = 0.1}}}).ok());
  Grid grid{.size_a = 2, .size_b = 2, .size_c = 2};
  grid.samples = Array<uint8_t>(std::vector<uint8_t>{0, 255, 0, 255, 0, 255, 0, 255});
  const Shape shapes[] = {Points{.vertices = triangle, .thickness = {3.f}},
                          Segments{.vertices = triangle, .topology = Segments::Topology::kLoop},
                          Mesh{.vertices = triangle},
                          Box{},
                          Sphere{},
                          Cylinder{},
                          Instance{"o"},
                          Ellipsoid{.radii = {0.5, 0.4, 0.3}},
                          Torus{.radius = 0.5, .tube_radius = 0.2},
                          Cone{.start = {0, 0, -0.5}, .end = {0, 0, 0.5}, .start_radius = 0.4},
                          Parallelepiped{.edge_a = {0.5, 0.2, 0}},
                          Disc{.radius = 0.5, .inner_radius = 0.2},
                          Patch{},
                          Polygon{.curves = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}},
                          Arrow{},
                          Arc{.radius = 0.5, .sweep = 2},
                          Ellipse{.axis_a = {0.5, 0, 0}, .axis_b = {0, 0.3, 0}},
                          Helix{.radius = 0.3, .turns = 3},
                          Curve{.vertices = triangle, .closed = true},
                          BezierSurface{.vertices = {.positions = std::vector<float>(48, 0.5f)}},
                          HeightMap{.columns = 2, .rows = 2, .heights = {0.f, 0.1f, 0.2f, 0.3f}},
                          Text{.text = "A"},
                          Implicit{.surface = "x^2 + y^2 - z = 0 where x^2 + y^2 <= 1"},
                          Volume{.grid = grid},
                          Isosurface{.grid = grid, .level = 128}};
  static_assert(std::size(shapes) == std::variant_size_v<Shape>);
  int id = 0;
  for (const Shape& shape : shapes)
    ASSERT_TRUE(layer.Put(absl::StrCat(id++), shape, {.priority = 3, .label = "it"}).ok());
  const auto frame = session->Commit();
  ASSERT_TRUE(frame.ok());
  const auto receipt = session->WaitShown(*frame, kPatience);
  ASSERT_TRUE(receipt.ok()) << receipt.status();
  EXPECT_EQ(receipt->refused_operations, 0u);
  ASSERT_EQ(receipt->outcomes.size(), 1u);
  EXPECT_EQ(receipt->outcomes[0].kind, Outcome::Kind::kPresented);
  EXPECT_EQ(Entities().size(), std::size(shapes));
  EXPECT_TRUE(session->Close().ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(layer.Put("x", Box{}).status()));
}

TEST_F(WithDaemon, ALargeEntityArrivesWhole) {
  auto session = Open({.strict = true});
  std::vector<float> positions(3 * 200'000);
  for (size_t i = 0; i < positions.size(); ++i) positions[i] = static_cast<float>(i % 1000) / 1000;
  ASSERT_TRUE(session->GetLayer("l")
                  .Put("cloud", Points{.vertices = {.positions = std::move(positions)}})
                  .ok());
  const auto frame = session->Commit();
  ASSERT_TRUE(frame.ok());
  const auto receipt = session->WaitAccepted(*frame, kPatience);
  ASSERT_TRUE(receipt.ok()) << receipt.status();
  EXPECT_EQ(daemon_.Entities().entities(0).vertices(), 200'000u);
}

TEST_F(WithDaemon, FramesReplaceAndHandlesChange) {
  auto session = Open({.on_disconnect = OnDisconnect::kKeep});
  const Layer layer = session->GetLayer("l");
  Frame first = layer.BeginFrame();
  first.Draw(Box{}).Draw("named", Sphere{});
  ASSERT_TRUE(first.Commit().ok());
  Frame second = layer.BeginFrame();
  second.Draw("only", Sphere{});
  ASSERT_TRUE(second.End().ok());
  auto handle = session->GetLayer("m").Put("h", Box{});
  ASSERT_TRUE(handle.ok());
  ASSERT_TRUE(session->Commit().ok());
  ASSERT_TRUE(handle->SetTransform(Affine::Scale(0.5)).ok());
  auto frame = session->Commit();
  ASSERT_TRUE(session->WaitAccepted(*frame, kPatience).ok());
  EXPECT_THAT(Entities(), ElementsAre("l/only", "m/h"));
  EXPECT_EQ(daemon_.Entities().entities(1).transform().m(0), 0.5);
  ASSERT_TRUE(handle->Remove().ok());
  frame = session->Commit();
  ASSERT_TRUE(session->WaitAccepted(*frame, kPatience).ok());
  EXPECT_THAT(Entities(), ElementsAre("l/only"));
  EXPECT_EQ(session->GetTally().refused_operations, 0u);
}

TEST_F(WithDaemon, RefusalsNameTheirCommitAndEntity) {
  auto session = Open();
  ASSERT_TRUE(session->GetLayer("l").Put("good", Box{}).ok());
  ASSERT_TRUE(session->GetLayer("l").Put("bad", Sphere{.radius = -1}).ok());
  const auto frame = session->Commit();
  const auto receipt = session->WaitAccepted(*frame, kPatience);
  ASSERT_TRUE(receipt.ok()) << receipt.status();
  EXPECT_EQ(receipt->refused_operations, 1u);
  ASSERT_EQ(receipt->issues.size(), 1u);
  EXPECT_EQ(receipt->issues[0].id, "bad");
  EXPECT_THAT(receipt->issues[0].field, HasSubstr("radius"));
  EXPECT_EQ(receipt->issues[0].frame, *frame);
  EXPECT_THAT(Entities(), ElementsAre("l/good"));
}

TEST_F(WithDaemon, AHundredThousandSmallEntitiesGoInBatches) {
  auto session = Open({.strict = true});
  const Layer layer = session->GetLayer("many");
  constexpr uint64_t kCommits = 10, kEach = 2000;
  for (uint64_t c = 0; c < kCommits; ++c) {
    for (uint64_t i = 0; i < kEach; ++i)
      ASSERT_TRUE(layer.Put(absl::StrCat(c, "/", i), Box{.size = {0.1, 0.1, 0.1}}).ok());
    ASSERT_TRUE(session->Commit().ok());
  }
  ASSERT_TRUE(session->WaitSettled(kPatience).ok());
  const Tally tally = session->GetTally();
  EXPECT_EQ(tally.accepted, kCommits);
  EXPECT_EQ(daemon_.Entities().total(), kCommits * kEach);
  // One Open; one commit and at most two batches for each of the commits.
  EXPECT_LE(tally.messages_sent, 1 + 3 * kCommits);
}

// Tests that need the clock, credit and tokens of the server.
TEST_F(WithDaemon, TheClockIsThatOfThisMachine) {
  auto session = Session::Open({.address = daemon_.target(), .ping_interval = 1ms});
  ASSERT_TRUE(session.ok());
  ASSERT_TRUE((*session)->WaitOpened(kPatience).ok());
  const Layer layer = (*session)->GetLayer("l");
  // Answers arrive in order: when this one has arrived, so have the pongs.
  for (int i = 0; i < 10'000 && !(*session)->clock().has_value(); ++i) {
    ASSERT_TRUE(layer.Put("a", Box{}).ok());
    const auto frame = (*session)->Commit();
    ASSERT_TRUE((*session)->WaitAccepted(*frame, kPatience).ok());
  }
  ASSERT_TRUE((*session)->clock().has_value());
  // One machine has one monotonic clock.
  const ClockEstimate clock = *(*session)->clock();
  EXPECT_LE(std::abs(clock.offset_ns), clock.round_trip_ns / 2 + 2);
  EXPECT_EQ((*session)->GetTally().issue_count, 0u);
}

TEST_F(WithDaemon, CreditComesBackForAllThatIsApplied) {
  // Sends far more than any credit, in many commits.
  auto session = Open({.strict = true});
  const Layer layer = session->GetLayer("l");
  for (int i = 0; i < 200; ++i) {
    Frame frame = layer.BeginFrame();
    frame.Draw(Points{.vertices = {.positions = std::vector<float>(3 * 30'000)}});
    while (!frame.Commit().ok()) ASSERT_TRUE(session->WaitForRoom(kPatience).ok());
  }
  ASSERT_TRUE(session->WaitSettled(kPatience).ok());
  EXPECT_EQ(session->GetTally().accepted, 200u);
  EXPECT_GT(session->GetTally().bytes_sent, 70'000'000u);
}

TEST_F(WithDaemon, AFullBufferRefusesAndGivesUpNothing) {
  auto session = Open({.strict = true, .buffer_bytes = 1 << 20});
  const Layer layer = session->GetLayer("l");
  uint64_t refused = 0, taken = 0;
  while (refused < 20) {
    Frame frame = layer.BeginFrame();
    frame.Draw(Points{.vertices = {.positions = std::vector<float>(3 * 30'000)}});
    auto number = frame.Commit();
    for (; absl::IsResourceExhausted(number.status()); number = frame.Commit()) {
      ++refused;
      ASSERT_TRUE(session->WaitForRoom(kPatience).ok());
    }
    ASSERT_TRUE(number.ok()) << number.status();
    ++taken;
  }
  ASSERT_TRUE(session->WaitSettled(kPatience).ok());
  const Tally tally = session->GetTally();
  EXPECT_EQ(tally.accepted, taken);
  EXPECT_EQ(tally.dropped + tally.client_dropped_frames + tally.server_dropped_frames, 0u);
}

TEST_F(WithDaemon, SessionsOfOneOwnerShareItsLayers) {
  auto first = Open(), other = Open();
  auto second = Open({.owner_token = first->server()->owner_token});
  EXPECT_EQ(first->server()->owner, second->server()->owner);
  EXPECT_NE(first->server()->owner, other->server()->owner);
  ASSERT_TRUE(first->GetLayer("l").Put("a", Box{}).ok());
  auto frame = first->Commit();
  ASSERT_TRUE(first->WaitAccepted(*frame, kPatience).ok());
  ASSERT_TRUE(second->GetLayer("l").SetTransform("a", Affine::Scale(0.5)).ok());
  frame = second->Commit();
  const auto moved = second->WaitAccepted(*frame, kPatience);
  ASSERT_TRUE(moved.ok());
  EXPECT_EQ(moved->refused_operations, 0u);
  std::string wrong = first->server()->owner_token;
  wrong[0] = static_cast<char>(wrong[0] ^ 1);
  auto lost = Session::Open({.address = daemon_.target(), .owner_token = wrong});
  EXPECT_TRUE(absl::IsNotFound((*lost)->WaitOpened(kPatience)));
}

// A transport whose streams the test can disconnect.
class CutTransport final : public Transport {
 public:
  explicit CutTransport(const std::string& target) : inner_(*MakeGrpcTransport(target)) {}
  std::unique_ptr<Stream> Start(Stream::Events* events) override {
    std::unique_ptr<Stream> stream = inner_->Start(events);
    newest_ = stream.get();
    return stream;
  }
  void Cut() { newest_.load()->Cancel(); }

 private:
  const std::unique_ptr<Transport> inner_;
  std::atomic<Stream*> newest_ = nullptr;
};

TEST_F(WithDaemon, ACutConnectionIsResumed) {
  sync::SystemClock clock;
  sync::Mutex mutex;
  sync::CondVar changed;
  std::vector<ConnectionChange::Kind> changes;
  Options options{.address = daemon_.target(),
                  .on_disconnect = OnDisconnect::kLinger,
                  .linger = 60s,
                  .first_pause = 1ms};
  options.on_connection = [&](const ConnectionChange& change) {
    sync::MutexLock lock(mutex);
    changes.push_back(change.kind);
    changed.NotifyAll();
  };
  auto transport = std::make_unique<CutTransport>(daemon_.target());
  CutTransport& cut = *transport;
  SessionCore core(options, std::move(transport), clock);
  std::thread thread([&core] { core.Run(); });
  ASSERT_TRUE(core.WaitOpened(kPatience).ok());
  const uint64_t session = core.server()->session;
  ASSERT_TRUE(core.StageUpsert("l", "a", Box{}, {}).ok());
  uint64_t frame = *core.Commit(nullptr, {});
  ASSERT_TRUE(core.WaitAccepted(frame, kPatience).ok());
  for (size_t round = 1; round <= 5; ++round) {
    cut.Cut();
    // Some are sent before the disconnect is noticed, some after it.
    for (int i = 0; i < 20; ++i) {
      ASSERT_TRUE(core.Stage(TransformOperation{"l", "a", Affine::Scale(1 + 0.1 * i)}).ok());
      frame = *core.Commit(nullptr, {});
    }
    sync::MutexLock lock(mutex);
    while (changes.size() < 1 + 2 * round) changed.Wait(mutex);
    EXPECT_EQ(changes.back(), ConnectionChange::Kind::kResumed);
  }
  // Commits are applied in order. (Outcomes that were written to a disconnected stream are lost
  // with it.)
  EXPECT_TRUE(core.WaitAccepted(frame, kPatience).ok());
  EXPECT_EQ(core.server()->session, session);
  const Tally tally = core.GetTally();
  EXPECT_EQ(tally.resumed, 5u);
  EXPECT_EQ(tally.restored, 0u);
  EXPECT_EQ(tally.accepted, 101u);
  EXPECT_EQ(tally.refused_operations + tally.lost + tally.issue_count, 0u);
  const v1::ListEntitiesResponse all = daemon_.Entities();
  ASSERT_EQ(all.entities_size(), 1);
  EXPECT_EQ(all.entities(0).transform().m(0), 1 + 0.1 * 19) << "the last one";
  core.Stop();
  thread.join();
}

TEST(WithoutServer, CallsReturnAtOnceAndWaitsSayWhy) {
  voxelctl::TempFolder folder;
  auto session = Session::Open({.address = "unix:" + folder.Path("none")});
  ASSERT_TRUE(session.ok());
  ASSERT_TRUE((*session)->GetLayer("l").Put("a", Box{}).ok());
  ASSERT_TRUE((*session)->Commit().ok());
  EXPECT_FALSE((*session)->HasRoom());
  const absl::Status waited = (*session)->WaitOpened(200ms);
  EXPECT_TRUE(absl::IsDeadlineExceeded(waited));
  EXPECT_THAT(std::string(waited.message()),
              HasSubstr("voxeld at unix:" + folder.Path("none") + " is not available"));
  EXPECT_FALSE(Session::Open({.address = "nonsense"}).ok());
  EXPECT_FALSE(Session::Open({.address = "a:1", .client_name = std::string(200, 'x')}).ok());
}

TEST(WithFakeServer, AServerThatDoesNotEndTheStreamIsToldWithTheTimeWaited) {
  voxelctl::TempFolder folder;
  voxelctl::FakeServer server(folder.Path("s"));
  server.Set({.hold_streams = true});
  auto session = Session::Open({.address = server.address()});
  ASSERT_TRUE((*session)->WaitOpened(kPatience).ok());
  EXPECT_EQ((*session)->Close(20ms).message(),
            "voxeld at " + server.address() + " did not end the stream in 0.02 s");
}

TEST(WithFakeServer, AServerThatComesBackGetsEverythingAgain) {
  voxelctl::TempFolder folder;
  auto server = std::make_unique<voxelctl::FakeServer>(folder.Path("s"));
  auto session =
      Session::Open({.address = server->address(), .first_pause = 5ms, .longest_pause = 50ms});
  const Layer layer = (*session)->GetLayer("l");
  ASSERT_TRUE(layer.Put("a", Box{}).ok());
  auto frame = (*session)->Commit();
  ASSERT_TRUE((*session)->WaitAccepted(*frame, kPatience).ok());
  server.reset();
  ASSERT_TRUE(layer.Put("b", Box{}).ok());
  frame = (*session)->Commit();
  server = std::make_unique<voxelctl::FakeServer>(folder.Path("s"));
  const auto accepted = (*session)->WaitAccepted(*frame, kPatience);
  ASSERT_TRUE(accepted.ok()) << accepted.status();
  std::vector<std::string> ids;
  for (const auto& [id, entity] : server->log().entities) ids.push_back(id);
  EXPECT_THAT(ids, ElementsAre("a", "b"));
  EXPECT_EQ((*session)->GetTally().connections, 2u);
}

}  // namespace server_test
}  // namespace voxeld::client
