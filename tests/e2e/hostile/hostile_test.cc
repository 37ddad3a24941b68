// Clients that mean harm, and those that do not, against the real voxeld over loopback.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <memory>
#include <string>

#include "tests/daemon/services/daemon_fixture.h"
#include "tests/e2e/hostile/attacks.h"
#include "tests/e2e/hostile/exhaustion.h"
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

}  // namespace
}  // namespace voxeld::e2e
