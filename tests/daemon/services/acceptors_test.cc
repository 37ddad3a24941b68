// Tests connections of Unix sockets, and what their calls learn about their users.
#include "daemon/services/acceptors.h"

#include <fcntl.h>
#include <grpcpp/channel.h>
#include <grpcpp/create_channel_posix.h>
#include <grpcpp/generic/async_generic_service.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/security/auth_context.h>
#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>
#include <gtest/gtest.h>
#include <sys/socket.h>

#include <atomic>
#include <future>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "daemon/services/caller.h"

namespace voxeld::daemon::services {
namespace {

// Answers every call, and keeps the greatest number of users that a call was told, and the last of
// them.
class Asks final : public grpc::CallbackGenericService {
 public:
  std::atomic<size_t> calls = 0, most = 0, none = 0;
  std::atomic<int> user = -1;

  grpc::ServerGenericBidiReactor* CreateReactor(
      grpc::GenericCallbackServerContext* context) override {
    class Reactor final : public grpc::ServerGenericBidiReactor {
     public:
      void OnDone() override { delete this; }
    };
    const auto users = context->auth_context()->FindPropertyValues(kUserProperty);
    ++calls;
    if (users.empty()) ++none;
    if (!users.empty()) user = std::stoi(std::string(users.back().data(), users.back().size()));
    for (size_t before = most; before < users.size();) {
      if (most.compare_exchange_weak(before, users.size())) break;
    }
    auto* reactor = new Reactor;
    reactor->Finish(grpc::Status::OK);
    return reactor;
  }
};

// All calls of a connection share what is known of it, since a connection may live for a year.
TEST(Acceptors, AConnectionsUserIsToldOnceHoweverManyCallsItMakes) {
  Asks asks;
  Acceptors acceptors(nullptr);
  grpc::ServerBuilder builder;
  builder.RegisterCallbackGenericService(&asks);
  acceptors.AddTo(builder);
  const std::unique_ptr<grpc::Server> server = builder.BuildAndStart();
  ASSERT_NE(server, nullptr);
  int ends[2];
  ASSERT_EQ(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends), 0);
  ASSERT_EQ(fcntl(ends[0], F_SETFL, O_NONBLOCK), 0);
  ASSERT_TRUE(acceptors.Take({.listening = ends[0], .user = 4711}, Descriptor(ends[0])));
  const std::shared_ptr<grpc::Channel> channel =
      grpc::CreateInsecureChannelFromFd("connection", ends[1]);

  constexpr int kThreads = 4, kCalls = 100;
  std::atomic<int> answered = 0;
  std::vector<std::thread> threads;
  for (int thread = 0; thread < kThreads; ++thread) {
    threads.emplace_back([&] {
      grpc::GenericStub stub(channel);
      for (int call = 0; call < kCalls; ++call) {
        grpc::ClientContext context;
        const grpc::Slice nothing;
        grpc::ByteBuffer request(&nothing, 1), response;
        std::promise<grpc::Status> done;
        stub.UnaryCall(&context, "/voxeld.test/Ask", grpc::StubOptions(), &request, &response,
                       [&](grpc::Status status) { done.set_value(std::move(status)); });
        // No message arrives; all that counts is that the call was made.
        done.get_future().wait();
        ++answered;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  server->Shutdown();
  EXPECT_EQ(asks.calls, size_t{kThreads} * kCalls);
  EXPECT_EQ(answered, kThreads * kCalls);
  EXPECT_EQ(asks.user, 4711);
  EXPECT_EQ(asks.none, 0u);
  EXPECT_EQ(asks.most, 1u);
}

}  // namespace
}  // namespace voxeld::daemon::services
