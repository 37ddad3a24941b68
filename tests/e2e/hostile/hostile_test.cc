// Tests malicious and well-behaved clients with the real voxeld over loopback.
#include <gmock/gmock.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
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
#include "tests/e2e/hostile/verdict.h"
#include "tests/e2e/http_get.h"
#include "tests/e2e/voxeld_process.h"
#include "voxeld/client.h"

namespace voxeld::e2e {
namespace {

using daemon::services::AwaitStats;
using daemon::services::Client;
using daemon::services::SetDeadline;
using daemon::services::SphereIn;
using std::chrono::steady_clock;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

// Stands for another machine: after an attack, other clients are served at once.
constexpr char kAttacker[] = "127.0.0.2";
// The connection preface, which is read before the listener has a connection, is added to this.
constexpr uint64_t kGreetingBytes = 1024;
constexpr size_t kLarge = 1u << 20;
#if defined(VOXELD_SANITIZED)
constexpr bool kMemoryTells = false;  // sanitizers keep freed memory
#else
constexpr bool kMemoryTells = true;
#endif

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
    EXPECT_TRUE(stats.has_value()) << "the statistics never became right";
    return stats.has_value() ? stats->connections() : v1::ConnectionStats();
  }
  v1::ConnectionStats Now() {
    return Await([](const v1::ConnectionStats&) { return true; });
  }
  AttackResult Run(Attack attack) {
    Now();  // the memory that this takes is not the attack's
    const uint64_t before = MostResidentKib(daemon_.process_id());
    const AttackResult result =
        RunAttack(attack, daemon_.tcp_target(), kAttacker, steady_clock::now() + kPatience);
    growth_kib_ = MostResidentKib(daemon_.process_id()) - before;
    return result;
  }

  Daemon daemon_;
  uint64_t growth_kib_ = 0;  // growth of the daemon's memory by the last attack
  std::unique_ptr<v1::DisplayService::Stub> local_ =
      v1::DisplayService::NewStub(NewChannel(daemon_.unix_target()));
};

// Checks that the daemon serves a new client over TCP.
void ExpectServes(const std::string& target) {
  const auto stub = v1::DisplayService::NewStub(NewChannel(target));
  grpc::ClientContext context;
  SetDeadline(context);
  v1::ListDisplaysResponse response;
  const grpc::Status status = stub->ListDisplays(&context, {}, &response);
  EXPECT_TRUE(status.ok()) << status.error_message();
}

class Strangers : public Hostile, public ::testing::WithParamInterface<Attack> {};

TEST_P(Strangers, AreCutBeforeGrpcSeesThemAndNobodyElseIsHurt) {
  const AttackResult result = Run(GetParam());
  ASSERT_TRUE(result.connected);
  EXPECT_TRUE(result.cut);
  EXPECT_LT(result.seconds, kMostSeconds);
  EXPECT_LE(result.bytes_delivered, kMostBytes);
  EXPECT_TRUE(!kMemoryTells || growth_kib_ <= kMostGrowthKib) << growth_kib_;
  // the statistics' own
  const auto figures = Await([](const auto& now) { return now.open() == 1; });
  EXPECT_EQ(figures.cut_for_greeting(), 1u);
  EXPECT_EQ(figures.cut_for_bytes() + figures.cut_for_cancelling(), 0u);
  ExpectServes(daemon_.tcp_target());
  const auto line = daemon_.process().ReadLineWith("\"event\":\"connection cut\"");
  ASSERT_TRUE(line.has_value());
  EXPECT_THAT(*line, HasSubstr("first call"));
  EXPECT_THAT(*line, HasSubstr("\"peer\":\"ipv4:127.0.0.2:"));
}

INSTANTIATE_TEST_SUITE_P(All, Strangers,
                         ::testing::Values(Attack::kHugeHeader, Attack::kVarintPadding,
                                           Attack::kContinuationFlood, Attack::kRapidReset,
                                           Attack::kLargeFirstCall),
                         [](const auto& info) { return std::string(AttackName(info.param)); });

class Checked : public Hostile, public ::testing::WithParamInterface<Attack> {};

TEST_P(Checked, WhatAnybodyMayAskAuthorisesNobody) {
  const AttackResult result = Run(GetParam());
  ASSERT_TRUE(result.prepared);
  EXPECT_TRUE(result.cut);
  EXPECT_LT(result.seconds, kMostSeconds);
  EXPECT_LE(result.bytes_delivered, kMostBytes + kGreetingBytes);
  const auto figures = Await([](const auto& now) { return now.open() == 1; });
  EXPECT_EQ(figures.cut_for_bytes() + figures.cut_for_cancelling(), 1u);
  EXPECT_EQ(figures.cut_for_flooding() + figures.cut_for_greeting(), 0u);
  ExpectServes(daemon_.tcp_target());
}

INSTANTIATE_TEST_SUITE_P(All, Checked,
                         ::testing::Values(Attack::kCheckedHugeHeader, Attack::kCheckedContinuation,
                                           Attack::kCheckedReset, Attack::kCheckedMadeReset,
                                           Attack::kGarbageContinuation),
                         [](const auto& info) { return std::string(AttackName(info.param)); });

TEST_F(Hostile, TheAddressOfWhatWasCutIsRefusedForAWhile) {
  ASSERT_TRUE(Run(Attack::kVarintPadding).cut);
  const AttackResult again = Run(Attack::kHugeHeader);
  EXPECT_TRUE(again.cut);
  const auto figures = Now();
  EXPECT_EQ(figures.refused_after_cut(), 1u);
  EXPECT_EQ(figures.cut_for_greeting(), 1u);
  ExpectServes(daemon_.tcp_target());
}

class Resets : public Hostile, public ::testing::WithParamInterface<Attack> {};

TEST_P(Resets, AreCutForTheirNumberThoughTheConnectionIsAuthorised) {
  const AttackResult result = Run(GetParam());
  ASSERT_TRUE(result.prepared);
  EXPECT_TRUE(result.cut);
  EXPECT_EQ(Await([](const auto& now) { return now.cut_for_cancelling() > 0; }).cut_for_bytes(),
            0u);
  ExpectServes(daemon_.tcp_target());
  const auto line = daemon_.process().ReadLineWith("\"event\":\"connection cut\"");
  ASSERT_TRUE(line.has_value());
  EXPECT_THAT(*line, HasSubstr("max_cancelled_calls_per_second"));
}

INSTANTIATE_TEST_SUITE_P(All, Resets,
                         ::testing::Values(Attack::kTrustedReset, Attack::kTrustedUnsentReset,
                                           Attack::kTrustedMadeReset,
                                           Attack::kTrustedMadeResetByEnd),
                         [](const auto& info) { return std::string(AttackName(info.param)); });

// gRPC treats a window increment of zero as an error of the whole connection, and ends that itself.
TEST_F(Hostile, AWindowThatGrowsByNothingEndsItsConnection) {
  const AttackResult result = Run(Attack::kTrustedMadeResetByWindow);
  ASSERT_TRUE(result.prepared);
  EXPECT_TRUE(result.cut);
  EXPECT_LT(result.seconds, kMostSeconds);
  Await([](const auto& now) { return now.open() == 1; });
  ExpectServes(daemon_.tcp_target());
}

class Silence : public Hostile, public ::testing::WithParamInterface<Attack> {};

TEST_P(Silence, IsCutForItsTime) {
  const AttackResult result = Run(GetParam());
  ASSERT_TRUE(result.connected);
  EXPECT_TRUE(result.cut);
  EXPECT_LT(result.seconds, kMostSeconds);
  const auto figures = Await([](const auto& now) { return now.open() == 1; });
  EXPECT_EQ(figures.cut_for_time(), 1u);
  const auto line = daemon_.process().ReadLineWith("\"event\":\"connection cut\"");
  ASSERT_TRUE(line.has_value());
  EXPECT_THAT(*line, HasSubstr("unauthorised_limit_ns"));
}

INSTANTIATE_TEST_SUITE_P(All, Silence,
                         ::testing::Values(Attack::kSlowLoris, Attack::kSlowCall,
                                           Attack::kSlowMessage, Attack::kHalfOpen),
                         [](const auto& info) { return std::string(AttackName(info.param)); });

TEST(Promises, AreJudgedByWhatWasMeasured) {
  AttackFigures figures;
  Add({.connected = true, .cut = true, .bytes_delivered = kMostBytes, .seconds = 1}, false,
      figures);
  Add({.connected = true, .cut = false, .bytes_delivered = 10, .seconds = kMostSeconds}, true,
      figures);
  Add({.connected = false, .bytes_delivered = 1 << 30, .seconds = 100}, false, figures);
  figures.growth_kib = kMostGrowthKib;
  figures.p99_alone_ms = 1;
  figures.p99_attacked_ms = kMostSlowdown;
  const auto broken = [](bool trusted, const AttackFigures& figures) {
    std::vector<std::string> out;
    for (const Verdict& verdict : Judge(trusted, figures)) {
      if (!verdict.reached) out.push_back(verdict.what);
    }
    return out;
  };
  EXPECT_THAT(broken(false, figures), IsEmpty());

  AttackFigures worse = figures;
  Add({.connected = true, .cut = false, .bytes_delivered = kMostBytes + 1, .seconds = 6}, false,
      worse);
  worse.growth_kib += 1;
  worse.p99_attacked_ms += 0.01;
  EXPECT_THAT(broken(false, worse),
              ElementsAre("cut", "bytes", "seconds", "growth_kib_a_peer", "others_p99_ms"));
  EXPECT_THAT(broken(true, worse), ElementsAre("cut"));
  EXPECT_THAT(broken(false, AttackFigures()), ElementsAre("cut")) << "no connection was";
}

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

// Sends Open, and eight batches of 1 MiB directly after it, before anything is answered.
grpc::Status SendAllAtOnce(v1::SceneService::Stub& scene) {
  Client client(scene);
  v1::StreamRequest open;
  open.mutable_open();
  client.Send(open);
  for (int i = 0; i < 8; ++i) {
    client.Send(Large(i));
    client.Commit(static_cast<uint64_t>(i));
  }
  client.HalfClose();
  const grpc::Status status = client.Finish();
  EXPECT_TRUE(!status.ok() || client.answers.size() == 8u) << client.answers.size();
  return status;
}

TEST_F(Hostile, OverAUnixSocketWhoDoesNotAwaitOpenedIsServedAllTheSame) {
  const auto scene = v1::SceneService::NewStub(NewChannel(daemon_.unix_target()));
  for (int i = 0; i < 5; ++i) {
    const grpc::Status status = SendAllAtOnce(*scene);
    EXPECT_TRUE(status.ok()) << status.error_message();
  }
  const v1::ConnectionStats now = Now();
  EXPECT_EQ(now.cut_for_bytes() + now.cut_for_greeting() + now.cut_for_flooding(), 0u);
}

// Returns a channel over which a call has been answered.
std::shared_ptr<grpc::Channel> WarmChannel(const std::string& target) {
  const auto channel = NewChannel(target);
  grpc::ClientContext context;
  SetDeadline(context);
  v1::ListDisplaysResponse displays;
  EXPECT_TRUE(v1::DisplayService::NewStub(channel)->ListDisplays(&context, {}, &displays).ok());
  return channel;
}

TEST_F(Hostile, OnAWarmConnectionWhoDoesNotAwaitOpenedIsServedAllTheSame) {
  const auto scene = v1::SceneService::NewStub(WarmChannel(daemon_.tcp_target()));
  for (int i = 0; i < 5; ++i) {
    const grpc::Status status = SendAllAtOnce(*scene);
    EXPECT_TRUE(status.ok()) << status.error_message();
  }
  EXPECT_EQ(Now().cut_for_bytes(), 0u);
}

// Our own client waits for Opened, whatever it is given to send first.
TEST_F(Hostile, TheClientLibraryMayBeginWithAsMuchAsItLikes) {
  for (int i = 0; i < 5; ++i) {
    auto session = client::Session::Open({.address = daemon_.tcp_target()});
    ASSERT_TRUE(session.ok()) << session.status();
    const client::Layer layer = (*session)->GetLayer("mine");
    auto put = layer.Put(
        "many", client::Points{.vertices = {.positions = std::vector<float>(3 * 200'000)}}, {});
    ASSERT_TRUE(put.ok()) << put.status();
    const auto frame = (*session)->Commit();
    ASSERT_TRUE(frame.ok()) << frame.status();
    const auto shown = (*session)->WaitShown(*frame, std::chrono::seconds(60));
    EXPECT_TRUE(shown.ok()) << shown.status();
    EXPECT_TRUE((*session)->Close().ok());
  }
  const v1::ConnectionStats now = Now();
  EXPECT_EQ(now.cut_for_bytes() + now.cut_for_greeting() + now.cut_for_flooding(), 0u);
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
  const auto scene = v1::SceneService::NewStub(WarmChannel(daemon_.tcp_target()));
  for (int i = 0; i < 3; ++i) {
    const grpc::Status status = Update(*scene);
    EXPECT_TRUE(status.ok()) << status.error_message();
  }
  EXPECT_EQ(Now().cut_for_bytes(), 0u);

  const auto cold = v1::SceneService::NewStub(NewChannel(daemon_.tcp_target()));
  EXPECT_EQ(Update(*cold).error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(Await([](const auto& now) { return now.cut_for_greeting() > 0; }).cut_for_greeting(),
            1u);
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

// A daemon in a process of its own, so that it has its own limits.
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

TEST(Limits, TooManyConnectionsFromOneAddressMakeRoomOldestFirst) {
  Limited limited("max_connections_per_address = 2\nprobe_interval_ns = 20_000_000\n");
  std::vector<int> held;
  for (int i = 0; i < 3; ++i) held.push_back(BeginToConnect(limited.daemon().tcp_target()));
  EXPECT_TRUE(AwaitStats(limited.stub(), [](const v1::Stats& stats) {
                return stats.connections().cut_for_room() == 1;
              }).has_value());
  // The daemon's own probe is not counted.
  const auto stats = AwaitStats(
      limited.stub(), [](const v1::Stats& stats) { return stats.uptime_ns() > 500'000'000; });
  ASSERT_TRUE(stats.has_value());
  EXPECT_EQ(stats->connections().probe_failures(), 0u);
  EXPECT_EQ(stats->connections().accepted(), 4u) << "three over TCP, and that of the statistics";
  for (const int descriptor : held) close(descriptor);
  ExpectServes(limited.daemon().unix_target());
}

TEST(Limits, StrangersThatSayNothingKeepNobodyAway) {
  // They are not closed because of their time.
  Limited limited(
      "max_http_connections = 4\nhttp_idle_limit_ns = 3_600_000_000_000\n"
      "unauthorised_limit_ns = 60_000_000_000\n");
  std::vector<int> strangers;
  const std::string http = absl::StrCat("tcp:", limited.daemon().http());
  for (int i = 0; i < 300; ++i) {
    strangers.push_back(BeginToConnect(limited.daemon().tcp_target()));
    strangers.push_back(BeginToConnect(http));
  }
  EXPECT_THAT(HttpGet(limited.daemon().http(), "/healthz"), StartsWith("HTTP/1.1 200 "));
  ExpectServes(limited.daemon().tcp_target());
  for (const int stranger : strangers) close(stranger);
}

class TrustedFloods : public ::testing::TestWithParam<Attack> {};

TEST_P(TrustedFloods, AreCutWhenNothingComesOfMoreThanAMessage) {
  Limited limited("max_connections = 100\n[limits]\nmax_message_bytes = 1_048_576\n");
  const AttackResult result = RunAttack(GetParam(), limited.daemon().tcp_target(), kAttacker,
                                        steady_clock::now() + kPatience);
  ASSERT_TRUE(result.prepared);
  EXPECT_TRUE(result.cut);
  EXPECT_GT(result.bytes_delivered, 1u << 20);
  const auto stats = AwaitStats(
      limited.stub(), [](const v1::Stats& stats) { return stats.connections().open() == 1; });
  ASSERT_TRUE(stats.has_value());
  EXPECT_EQ(stats->connections().cut_for_flooding(), 1u);
  ExpectServes(limited.daemon().tcp_target());
}

INSTANTIATE_TEST_SUITE_P(All, TrustedFloods,
                         ::testing::Values(Attack::kTrustedHugeHeader,
                                           Attack::kTrustedContinuation),
                         [](const auto& info) { return std::string(AttackName(info.param)); });

// Returns the health service's status of the whole daemon: 1 is serving, 2 is not serving.
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
  // One: for the probe itself, so that it connects, but nobody accepts the connection.
  ASSERT_TRUE(LeaveDescriptors(daemon.process_id(), 1));
  const auto deaf = AwaitStats(*stub, [](const v1::Stats& stats) {
    return stats.connections().unreachable().find("no answer came in time") != std::string::npos;
  });
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
  const std::string health = HttpGet(daemon.http(), "/healthz");
  EXPECT_THAT(health, HasSubstr("\"what\":\"connections\""));  // of the last minute
  EXPECT_THAT(health, Not(HasSubstr("not reachable")));
}

bool HasIpv6() {
  const int made = socket(AF_INET6, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in6 name = {};
  name.sin6_family = AF_INET6;
  name.sin6_addr = in6addr_loopback;
  const bool bound =
      made >= 0 && bind(made, reinterpret_cast<const sockaddr*>(&name), sizeof(name)) == 0;
  if (made >= 0) close(made);
  return bound;
}

TEST(Ipv6, ConnectionsAreKnownByTheirCalls) {
  if (!HasIpv6()) GTEST_SKIP() << "no IPv6 here";
  const Folder folder;
  Process process(
      Voxeld({"--listen", "[::1]:0", "--http", "off", "--engine", "cpu", "--log-format", "json",
              "--config",
              folder.File("voxeld.toml", "[server]\nunauthorised_limit_ns = 100_000_000\n")}),
      CleanEnvironment(folder));
  const std::optional<std::string> ready = process.ReadLineWith("\"event\":\"ready\"");
  ASSERT_TRUE(ready.has_value()) << process.output();
  const std::string target = nlohmann::json::parse(*ready)["listen"];
  const auto channel = NewChannel(target);
  const auto scene = v1::SceneService::NewStub(channel);
  const auto displays = v1::DisplayService::NewStub(channel);
  Client client(*scene);
  client.Open();
  // Far longer than an unauthorised client may stay.
  ASSERT_TRUE(AwaitStats(*displays, [](const v1::Stats& stats) {
                return stats.uptime_ns() > 1'000'000'000;
              }).has_value());
  client.Commit(1);
  client.HalfClose();
  EXPECT_TRUE(client.Finish().ok());
}

}  // namespace
}  // namespace voxeld::e2e
