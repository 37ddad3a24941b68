// Errors between the client and a real server: content that the server rejects, and a peer that
// disappears without closing.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "client/cpp/src/grpc_transport.h"
#include "client/cpp/src/session_core.h"
#include "display/sync/clock.h"
#include "tests/client/cpp/relay.h"
#include "tests/daemon/services/daemon_fixture.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "voxeld/client.h"

namespace voxeld::client {
namespace {

using namespace std::chrono_literals;  // NOLINT
using ::testing::HasSubstr;

constexpr auto kPatience = 60s;

class BehindARelay : public testing::Test {
 protected:
  std::string path() const { return folder_.Path("relay"); }
  std::string daemon_path() const { return daemon_.target().substr(std::string("unix:").size()); }

  daemon::services::Daemon daemon_;
  voxelctl::TempFolder folder_;
};

// Returns points of 18 MB; max_message_bytes is 16 MiB.
Points TooMany() {
  return {.vertices = {.positions = std::vector<float>(3 * 1'200'000),
                       .colors = std::vector<uint8_t>(3 * 1'200'000)}};
}

TEST_F(BehindARelay, WhatTheServerWillNotReadIsRefusedAndEndsNoStream) {
  auto session =
      Session::Open({.address = "unix:" + path(), .first_pause = 5ms, .longest_pause = 20ms});
  ASSERT_TRUE(session.ok());
  // Before the limit is known.
  ASSERT_TRUE((*session)->DefineObject("big", {{.shape = TooMany()}}).ok());
  const auto large = (*session)->Commit();
  ASSERT_TRUE(large.ok());
  const Layer layer = (*session)->GetLayer("l");
  ASSERT_TRUE(layer.Put("a", Box{}).ok());
  const auto small = (*session)->Commit();
  Relay relay(path(), daemon_path());
  EXPECT_TRUE((*session)->WaitAccepted(*small, kPatience).ok());
  const absl::Status refused = (*session)->WaitAccepted(*large, kPatience).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(refused));
  EXPECT_THAT(std::string(refused.message()),
              HasSubstr("the object \"big\" takes a message of 18"));
  // After the limit is known.
  Frame frame = layer.BeginFrame();
  frame.Draw("cloud", TooMany());
  const absl::Status drawn = frame.Commit().status();
  EXPECT_TRUE(absl::IsInvalidArgument(drawn));
  EXPECT_THAT(std::string(drawn.message()), HasSubstr("l/cloud takes a message of 18"));
  ASSERT_TRUE(layer.Put("b", Box{}).ok());
  const auto last = (*session)->Commit();
  EXPECT_TRUE((*session)->WaitAccepted(*last, kPatience).ok());
  EXPECT_EQ((*session)->GetTally().connections, 1u);
  EXPECT_EQ(daemon_.Entities().total(), 2u);
  session->reset();
}

TEST_F(BehindARelay, AnEndThatHasGoneIsNoticedWhileAMessageIsBeingWritten) {
  sync::SystemClock clock;
  sync::Mutex mutex;
  sync::CondVar changed;
  bool lost = false;
  Options options;
  options.address = "unix:" + path();
  options.reconnect = false;
  options.ping_interval = Duration(0);
  options.on_connection = [&](const ConnectionChange& change) {
    sync::MutexLock lock(mutex);
    lost = lost || change.kind == ConnectionChange::Kind::kEnded;
    changed.NotifyAll();
  };
  Relay relay(path(), daemon_path());
  SessionCore core(options, *MakeGrpcTransport("unix:" + path(), {}, {500ms, 500ms}), clock);
  std::thread thread([&core] { core.Run(); });
  ASSERT_TRUE(core.WaitOpened(kPatience).ok());
  relay.FallSilent();
  // More than all buffers on the way can hold: it is never written whole.
  ASSERT_TRUE(core.StageUpsert("l", "a",
                               Points{.vertices = {.positions = std::vector<float>(3 * 1'000'000)}},
                               {})
                  .ok());
  ASSERT_TRUE(core.Commit(nullptr, {}).ok());
  const sync::TimeNs deadline = clock.Now() + 60 * sync::kSecond;
  {
    sync::MutexLock lock(mutex);
    while (!lost && clock.Now() < deadline) clock.WaitUntil(mutex, changed, deadline);
    EXPECT_TRUE(lost);
  }
  EXPECT_TRUE(absl::IsUnavailable(core.WaitForRoom(kPatience)));
  core.Stop();
  thread.join();
}

}  // namespace
}  // namespace voxeld::client
