// Tests two clients on two layers, one of which is killed. Its layer is treated according to its
// policy; the other's layer is unaffected, and every commit has its answer and its outcome.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <signal.h>

#include <functional>
#include <set>

#include "absl/strings/str_cat.h"
#include "tests/daemon/services/daemon_fixture.h"
#include "tests/e2e/voxeld_process.h"
#include "tests/programs.h"

namespace voxeld::e2e {
namespace {

using daemon::services::AwaitStats;
using daemon::services::Client;
using daemon::services::SetDeadline;
using daemon::services::SphereIn;
using ::testing::ElementsAre;
using ::testing::SizeIs;

struct Scene {
  std::set<std::string> entities;  // "layer/id"
  std::set<std::string> orphaned;  // layers
};

class TwoClients : public ::testing::Test {
 protected:
  TwoClients()
      : channel_(grpc::CreateChannel(daemon_.unix_target(), grpc::InsecureChannelCredentials())),
        scene_(v1::SceneService::NewStub(channel_)),
        displays_(v1::DisplayService::NewStub(channel_)) {}

  Scene Read() {
    grpc::ClientContext context;
    SetDeadline(context);
    v1::ListEntitiesResponse response;
    EXPECT_TRUE(scene_->ListEntities(&context, {}, &response).ok());
    Scene scene;
    for (const auto& entity : response.entities()) {
      scene.entities.insert(absl::StrCat(entity.key().layer(), "/", entity.key().id()));
    }
    for (const auto& layer : response.layers()) {
      if (layer.orphaned()) scene.orphaned.insert(layer.layer());
    }
    return scene;
  }

  v1::Stats Await(const std::function<bool(const v1::Stats&)>& right) {
    return AwaitStats(*displays_, right).value_or(v1::Stats());
  }

  // Starts the other client, lets both commit, kills it, and keeps committing; then checks what
  // must hold with every policy.
  void KillTheOther(const std::string& policy, int64_t linger_ns) {
    Process victim({ProgramBeside("e2e_client"), daemon_.unix_target(), "theirs", policy,
                    std::to_string(linger_ns)});
    ASSERT_EQ(victim.ReadLine(), "up") << victim.output();
    Client client(*scene_);
    client.Open();
    constexpr int kBefore = 20, kAfter = 20;
    const auto commit = [&client](int frame) {
      client.Send(SphereIn("mine", "ball", 0.1 + 0.01 * frame));
      client.Commit(frame);
    };
    for (int frame = 1; frame <= kBefore; ++frame) commit(frame);
    client.ReadOutcomes(kBefore);
    EXPECT_TRUE(Read().entities.contains("theirs/ball"));
    victim.Signal(SIGKILL);
    EXPECT_EQ(victim.Wait(), -SIGKILL);
    for (int frame = kBefore + 1; frame <= kBefore + kAfter; ++frame) commit(frame);
    client.ReadOutcomes(kBefore + kAfter);
    Await([](const v1::Stats& stats) { return stats.sessions() == 1; });
    at_once_ = Read();
    EXPECT_TRUE(at_once_.entities.contains("mine/ball"));
    EXPECT_FALSE(at_once_.entities.contains("theirs/never"));

    EXPECT_THAT(client.issues, SizeIs(0));
    ASSERT_THAT(client.answers, SizeIs(kBefore + kAfter));
    std::set<uint64_t> frames;
    for (const v1::Receipt& outcome : client.outcomes) frames.insert(outcome.frame_id());
    EXPECT_THAT(frames, SizeIs(kBefore + kAfter));
    for (const v1::Receipt& answer : client.answers) {
      EXPECT_TRUE(answer.has_accepted());
      EXPECT_THAT(answer.accepted().displays(), ElementsAre("sim"));
    }

    const v1::Stats stats =
        Await([](const v1::Stats& now) { return now.displays(0).commits_pending() == 0; });
    const v1::DisplayStats& sim = stats.displays(0);
    EXPECT_EQ(sim.commits_owed(), stats.commits_accepted());
    EXPECT_EQ(sim.commits_owed(), sim.commits_presented() + sim.commits_unchanged() +
                                      sim.commits_superseded() + sim.commits_lost() +
                                      sim.commits_not_shown());
    EXPECT_EQ(sim.commits_lost(), 0u);
    client.HalfClose();
    EXPECT_TRUE(client.Finish().ok());
  }

  Daemon daemon_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::SceneService::Stub> scene_;
  std::unique_ptr<v1::DisplayService::Stub> displays_;
  Scene at_once_;  // after the kill, while this test's client is still connected
};

TEST_F(TwoClients, OneIsKilledAndItsLayerIsCleared) {
  KillTheOther("clear", 0);
  EXPECT_THAT(at_once_.entities, ElementsAre("mine/ball"));
  EXPECT_THAT(Read().entities, ElementsAre()) << "the test's own client asked for CLEAR too";
}

TEST_F(TwoClients, OneIsKilledAndItsLayerLingers) {
  KillTheOther("linger", 5'000'000'000);
  EXPECT_THAT(at_once_.entities, ElementsAre("mine/ball", "theirs/ball"));
  EXPECT_THAT(at_once_.orphaned, ElementsAre("theirs"));
  Await([](const v1::Stats& stats) { return stats.entities() == 0; });
}

TEST_F(TwoClients, OneIsKilledAndItsLayerIsKept) {
  KillTheOther("keep", 0);
  EXPECT_THAT(at_once_.entities, ElementsAre("mine/ball", "theirs/ball"));
  const Scene scene = Read();
  EXPECT_THAT(scene.entities, ElementsAre("theirs/ball"));
  EXPECT_THAT(scene.orphaned, ElementsAre("theirs"));
  grpc::ClientContext context;
  SetDeadline(context);
  v1::ClearLayerRequest request;
  request.set_layer("theirs");
  v1::ClearLayerResponse response;
  ASSERT_TRUE(scene_->ClearLayer(&context, request, &response).ok());
  EXPECT_EQ(response.entities(), 1u);
  EXPECT_THAT(Read().entities, ElementsAre());
}

}  // namespace
}  // namespace voxeld::e2e
