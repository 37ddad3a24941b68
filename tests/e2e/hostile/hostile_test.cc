// Clients that mean harm, and those that do not, against the real voxeld over loopback.
#include <gmock/gmock.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <future>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/daemon/services/daemon_fixture.h"
#include "tests/e2e/hostile/attacks.h"
#include "tests/e2e/hostile/exhaustion.h"
#include "tests/e2e/hostile/process_view.h"
#include "tests/e2e/http_get.h"
#include "tests/e2e/voxeld_process.h"

namespace voxeld::e2e {
namespace {

using daemon::services::AwaitStats;
using daemon::services::Client;
using daemon::services::SetDeadline;
using daemon::services::SphereIn;
using std::chrono::steady_clock;
using ::testing::HasSubstr;

constexpr uint64_t kGuardBytes = 64u << 10;
constexpr double kGuardSeconds = 5;
// Of a socket's receive buffer, by net.ipv4.tcp_rmem.
constexpr uint64_t kKernelSlack = 6u << 20;
constexpr size_t kLarge = 1u << 20;

std::shared_ptr<grpc::Channel> NewChannel(const std::string& target) {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  return grpc::CreateCustomChannel(target, grpc::InsecureChannelCredentials(), arguments);
}

class Hostile : public ::testing::Test {
 protected:
  v1::ConnectionStats Await(const std::function<bool(const v1::ConnectionStats&)>& right) {
    const auto stats =
        AwaitStats(*local_, [&](const v1::Stats& stats) { return right(stats.connections()); });
    EXPECT_TRUE(stats.has_value()) << "the figures never came to be right";
    return stats.has_value() ? stats->connections() : v1::ConnectionStats();
  }
  v1::ConnectionStats Now() {
    return Await([](const v1::ConnectionStats&) { return true; });
  }
  AttackResult Run(Attack attack) {
    return RunAttack(attack, daemon_.tcp_target(), steady_clock::now() + kPatience);
  }

  Daemon daemon_;
  std::unique_ptr<v1::DisplayService::Stub> local_ =
      v1::DisplayService::NewStub(NewChannel(daemon_.unix_target()));
};

// A daemon that is well serves a new client over TCP.
void ExpectServes(const std::string& target) {
  const auto stub = v1::DisplayService::NewStub(NewChannel(target));
  grpc::ClientContext context;
  SetDeadline(context);
  v1::ListDisplaysResponse response;
  const grpc::Status status = stub->ListDisplays(&context, {}, &response);
  EXPECT_TRUE(status.ok()) << status.error_message();
}

class Floods : public Hostile, public ::testing::WithParamInterface<Attack> {};

TEST_P(Floods, AreCutForTheirBytesAndNobodyElseIsHurt) {
  const AttackResult result = Run(GetParam());
  ASSERT_TRUE(result.connected);
  EXPECT_TRUE(result.cut);
  EXPECT_LT(result.seconds, kGuardSeconds);
  // What the kernel had taken in before the cut came into force is bounded by its receive buffer.
  EXPECT_LE(result.bytes_delivered, kGuardBytes + kKernelSlack);
  EXPECT_EQ(Await([](const auto& now) { return now.cut_for_bytes() > 0; }).cut_for_bytes(), 1u);
  Await([](const auto& now) { return now.open() == 1; });  // the figures' own
  ExpectServes(daemon_.tcp_target());
  const auto line = daemon_.process().ReadLineWith("\"event\":\"connection cut\"");
  ASSERT_TRUE(line.has_value());
  EXPECT_THAT(*line, HasSubstr("unauthorised_bytes"));
  EXPECT_THAT(*line, HasSubstr("\"peer\":\"ipv4:127.0.0.1:"));
}

INSTANTIATE_TEST_SUITE_P(All, Floods,
                         ::testing::Values(Attack::kHugeHeader, Attack::kVarintPadding,
                                           Attack::kContinuationFlood, Attack::kLargeFirstCall),
                         [](const auto& info) { return std::string(AttackName(info.param)); });

class Resets : public Hostile, public ::testing::WithParamInterface<Attack> {};

TEST_P(Resets, AreCutForTheirNumberThoughTheConnectionIsAuthorised) {
  const AttackResult result = Run(GetParam());
  ASSERT_TRUE(result.trusted);
  EXPECT_TRUE(result.cut);
  EXPECT_EQ(Await([](const auto& now) { return now.cut_for_cancelling() > 0; }).cut_for_bytes(),
            0u);
  ExpectServes(daemon_.tcp_target());
  const auto line = daemon_.process().ReadLineWith("\"event\":\"connection cut\"");
  ASSERT_TRUE(line.has_value());
  EXPECT_THAT(*line, HasSubstr("max_cancelled_calls_per_second"));
}

INSTANTIATE_TEST_SUITE_P(All, Resets,
                         ::testing::Values(Attack::kTrustedRapidReset, Attack::kTrustedUnsentReset),
                         [](const auto& info) { return std::string(AttackName(info.param)); });

TEST_F(Hostile, ResetsOfAStrangerAreCut) {
  const AttackResult result = Run(Attack::kRapidReset);
  EXPECT_TRUE(result.cut);
  EXPECT_LE(result.bytes_delivered, kGuardBytes + kKernelSlack);
  Await([](const auto& now) { return now.open() == 1; });
  ExpectServes(daemon_.tcp_target());
}

class Silence : public Hostile, public ::testing::WithParamInterface<Attack> {};

TEST_P(Silence, IsClosedWithinTheTimeOfAHandshake) {
  const AttackResult result = Run(GetParam());
  ASSERT_TRUE(result.connected);
  EXPECT_TRUE(result.cut);
  EXPECT_LT(result.seconds, kGuardSeconds);
  Await([](const auto& now) { return now.open() == 1; });
}

INSTANTIATE_TEST_SUITE_P(All, Silence, ::testing::Values(Attack::kSlowLoris, Attack::kHalfOpen),
                         [](const auto& info) { return std::string(AttackName(info.param)); });

v1::StreamRequest Large(int number) {
  v1::StreamRequest request = SphereIn("layer", "ball" + std::to_string(number));
  v1::Vertices* vertices = request.mutable_upsert()
                               ->mutable_entity()
                               ->mutable_primitive()
                               ->mutable_points()
                               ->mutable_vertices();
  vertices->set_count(kLarge / 12);
  vertices->set_position_type(v1::ELEMENT_TYPE_F32);
  vertices->set_positions(std::string(kLarge / 12 * 12, '\0'));
  return request;
}

TEST_F(Hostile, WhoAwaitsOpenedMaySendAsMuchAsTheyLike) {
  const auto scene = v1::SceneService::NewStub(NewChannel(daemon_.tcp_target()));
  Client client(*scene);
  client.Open();
  for (int i = 0; i < 8; ++i) {
    ASSERT_TRUE(client.Send(Large(i)));
    client.Commit(static_cast<uint64_t>(i));
  }
  client.HalfClose();
  const grpc::Status status = client.Finish();
  EXPECT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(client.answers.size(), 8u);
  const v1::ConnectionStats now = Now();
  EXPECT_EQ(now.cut_for_bytes() + now.cut_for_time() + now.cut_for_cancelling(), 0u);
}

grpc::Status Update(v1::SceneService::Stub& scene) {
  v1::ApplyUpdateRequest request;
  *request.add_operations() = Large(0);
  grpc::ClientContext context;
  SetDeadline(context);
  v1::ApplyUpdateResponse response;
  return scene.ApplyUpdate(&context, request, &response);
}

TEST_F(Hostile, ALargeUpdateOnAWarmConnectionIsTakenAndAsAFirstCallItIsCut) {
  const auto channel = NewChannel(daemon_.tcp_target());
  const auto scene = v1::SceneService::NewStub(channel);
  grpc::ClientContext context;
  SetDeadline(context);
  v1::ListDisplaysResponse displays;
  ASSERT_TRUE(v1::DisplayService::NewStub(channel)->ListDisplays(&context, {}, &displays).ok());
  for (int i = 0; i < 3; ++i) {
    const grpc::Status status = Update(*scene);
    EXPECT_TRUE(status.ok()) << status.error_message();
  }
  EXPECT_EQ(Now().cut_for_bytes(), 0u);

  const auto cold = v1::SceneService::NewStub(NewChannel(daemon_.tcp_target()));
  EXPECT_EQ(Update(*cold).error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(Await([](const auto& now) { return now.cut_for_bytes() > 0; }).cut_for_bytes(), 1u);
  const auto line = daemon_.process().ReadLineWith("\"event\":\"connection cut\"");
  ASSERT_TRUE(line.has_value());
  EXPECT_THAT(*line, HasSubstr("first call is at most 48 KiB"));
}

TEST_F(Hostile, ALargeFirstUpdateOverAUnixSocketIsTaken) {
  const auto scene = v1::SceneService::NewStub(NewChannel(daemon_.unix_target()));
  const grpc::Status status = Update(*scene);
  EXPECT_TRUE(status.ok()) << status.error_message();
  const auto line = daemon_.process().ReadLineWith("\"event\":\"local connection\"");
  ASSERT_TRUE(line.has_value());
  EXPECT_THAT(*line, HasSubstr("user " + std::to_string(getuid()) + ", process "));
}

TEST_F(Hostile, DescriptorsThatComeBackAreUsedAgainWithinASecond) {
  for (int cycle = 0; cycle < 3; ++cycle) {
    const std::optional<double> seconds = ExhaustAndRecover(daemon_);
    ASSERT_TRUE(seconds.has_value()) << "in cycle " << cycle;
    EXPECT_LT(*seconds, 1);
  }
  EXPECT_TRUE(daemon_.process().ReadLineWith("no connection can be accepted").has_value());
  EXPECT_TRUE(daemon_.process().ReadLineWith("connections are accepted again").has_value());
}

// In a process of its own, so that its limits are its own.
class Limited {
 public:
  explicit Limited(const std::string& server)
      : daemon_({"--config", folder_.File("voxeld.toml", "[server]\n" + server)}),
        stub_(v1::DisplayService::NewStub(NewChannel(daemon_.unix_target()))) {}
  Daemon& daemon() { return daemon_; }
  v1::DisplayService::Stub& stub() { return *stub_; }

 private:
  Folder folder_;
  Daemon daemon_;
  std::unique_ptr<v1::DisplayService::Stub> stub_;
};

TEST(Limits, TooManyConnectionsFromOneAddressAreClosedAndOthersAreServed) {
  Limited limited("max_connections_per_address = 2\nprobe_interval_ns = 20_000_000\n");
  std::vector<int> held;
  for (int i = 0; i < 3; ++i) held.push_back(BeginToConnect(limited.daemon().tcp_target()));
  EXPECT_TRUE(AwaitStats(limited.stub(), [](const v1::Stats& stats) {
                return stats.connections().refused_by_address() == 1;
              }).has_value());
  // The daemon's own probe is not among them.
  const auto stats = AwaitStats(
      limited.stub(), [](const v1::Stats& stats) { return stats.uptime_ns() > 500'000'000; });
  ASSERT_TRUE(stats.has_value());
  EXPECT_EQ(stats->connections().probe_failures(), 0u);
  EXPECT_EQ(stats->connections().accepted(), 3u) << "two over TCP, and the figures' own";
  for (const int descriptor : held) close(descriptor);
  ExpectServes(limited.daemon().unix_target());
}

// What the health service says of the whole: 1 serves, 2 does not.
int Health(const std::shared_ptr<grpc::Channel>& channel) {
  grpc::GenericStub stub(channel);
  grpc::ClientContext context;
  SetDeadline(context);
  const grpc::Slice empty;
  const grpc::ByteBuffer request(&empty, 1);
  grpc::ByteBuffer response;
  std::promise<grpc::Status> done;
  stub.UnaryCall(&context, "/grpc.health.v1.Health/Check", grpc::StubOptions(), &request, &response,
                 [&](grpc::Status status) { done.set_value(std::move(status)); });
  std::vector<grpc::Slice> slices;
  if (!done.get_future().get().ok() || !response.Dump(&slices).ok()) return 0;
  return slices.size() == 1 && slices[0].size() == 2 ? slices[0].begin()[1] : 0;
}

TEST(Probe, ADaemonThatCannotAcceptSaysSoAndTakesItBack) {
  const Folder folder;
  Daemon daemon(
      {"--config", folder.File("voxeld.toml", "[server]\nprobe_interval_ns = 50_000_000\n")});
  const auto channel = NewChannel(daemon.unix_target());
  const auto stub = v1::DisplayService::NewStub(channel);
  EXPECT_EQ(Health(channel), 1);
  ASSERT_TRUE(LeaveDescriptors(daemon.process_id(), 0));
  const auto deaf = AwaitStats(
      *stub, [](const v1::Stats& stats) { return !stats.connections().unreachable().empty(); });
  ASSERT_TRUE(deaf.has_value());
  EXPECT_GE(deaf->connections().probe_failures(), 2u);
  EXPECT_TRUE(daemon.process().ReadLineWith("not reachable").has_value());
  const auto end = steady_clock::now() + kPatience;
  while (Health(channel) != 2 && steady_clock::now() < end) {
  }
  EXPECT_EQ(Health(channel), 2);

  ASSERT_TRUE(LeaveDescriptors(daemon.process_id(), 100));
  EXPECT_TRUE(daemon.process().ReadLineWith("reachable again").has_value());
  while (Health(channel) != 1 && steady_clock::now() < end) {
  }
  EXPECT_EQ(Health(channel), 1);
  EXPECT_THAT(HttpGet(daemon.http(), "/healthz"), HasSubstr("\"status\":\"ok\""));
}

TEST(Ipv6, ConnectionsAreKnownByTheirCalls) {
  const Folder folder;
  Process process(
      Voxeld({"--listen", "[::1]:0", "--http", "off", "--engine", "cpu", "--log-format", "json",
              "--config",
              folder.File("voxeld.toml", "[server]\nunauthorised_limit_ns = 100_000_000\n")}),
      CleanEnvironment(folder));
  const std::optional<std::string> ready = process.ReadLineWith("\"event\":\"ready\"");
  if (!ready.has_value()) GTEST_SKIP() << "no IPv6 here: " << process.output();
  const std::string target = nlohmann::json::parse(*ready)["listen"];
  const auto channel = NewChannel(target);
  const auto scene = v1::SceneService::NewStub(channel);
  const auto displays = v1::DisplayService::NewStub(channel);
  Client client(*scene);
  client.Open();
  // Well beyond the time in which a stranger is cut.
  ASSERT_TRUE(AwaitStats(*displays, [](const v1::Stats& stats) {
                return stats.uptime_ns() > 1'000'000'000;
              }).has_value());
  client.Commit(1);
  client.HalfClose();
  EXPECT_TRUE(client.Finish().ok());
}

}  // namespace
}  // namespace voxeld::e2e
