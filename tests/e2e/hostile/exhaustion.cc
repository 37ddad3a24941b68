#include "tests/e2e/hostile/exhaustion.h"

#include <grpcpp/grpcpp.h>
#include <unistd.h>

#include <chrono>
#include <vector>

#include "tests/daemon/services/daemon_fixture.h"
#include "tests/e2e/hostile/attacks.h"
#include "tests/e2e/hostile/process_view.h"

namespace voxeld::e2e {
namespace {

using std::chrono::steady_clock;

constexpr size_t kSpare = 16;  // for eight connections

std::shared_ptr<grpc::Channel> NewChannel(const std::string& target) {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  // Retries at once: the daemon is what is measured.
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 100);
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, 100);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 100);
  return grpc::CreateCustomChannel(target, grpc::InsecureChannelCredentials(), arguments);
}

// Uses a connection that may still have to be made, possibly several times: the previous
// descriptors may not have been released yet.
bool Answers(v1::DisplayService::Stub& stub) {
  grpc::ClientContext context;
  daemon::services::SetDeadline(context);
  context.set_wait_for_ready(true);
  v1::ListDisplaysResponse response;
  return stub.ListDisplays(&context, {}, &response).ok();
}

}  // namespace

std::optional<double> ExhaustAndRecover(const Daemon& daemon) {
  // An existing connection, over which the daemon reports its state.
  const auto watch = v1::DisplayService::NewStub(NewChannel(daemon.unix_target()));
  if (!Answers(*watch)) return {};
  const auto before = daemon::services::AwaitStats(*watch, [](const v1::Stats&) { return true; });
  if (!before.has_value()) return {};
  if (!LeaveDescriptors(daemon.process_id(), kSpare)) return {};
  std::vector<int> taken;
  for (size_t i = 0; i < 2 * kSpare; ++i) taken.push_back(BeginToConnect(daemon.tcp_target()));
  const uint64_t failures = before->connections().accept_failures();
  const auto out = daemon::services::AwaitStats(*watch, [failures](const v1::Stats& stats) {
    return stats.connections().accept_failures() > failures;
  });
  for (const int descriptor : taken) close(descriptor);
  if (!out.has_value()) return {};

  const auto begin = steady_clock::now();
  const auto stub = v1::DisplayService::NewStub(NewChannel(daemon.tcp_target()));
  if (!Answers(*stub)) return {};
  return std::chrono::duration<double>(steady_clock::now() - begin).count();
}

}  // namespace voxeld::e2e
