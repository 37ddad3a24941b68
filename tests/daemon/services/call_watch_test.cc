// Tests which answers authorise a connection, with a server that answers anything.
#include "daemon/services/call_watch.h"

#include <gmock/gmock.h>
#include <grpcpp/create_channel.h>
#include <grpcpp/generic/async_generic_service.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>

#include <future>
#include <set>

#include "absl/strings/str_cat.h"
#include "daemon/listen/guard.h"
#include "daemon/listen/peer.h"
#include "display/sync/fake_clock.h"

namespace voxeld::daemon::services {
namespace {

constexpr char kOwn[] = "/voxeld.v1.Anything/Ask";
constexpr char kOthers[] = "/others.v1.Anything/Ask";

grpc::ByteBuffer SomeBytes() {
  const grpc::Slice slice("some");
  return {&slice, 1};
}

// How a call is handled.
struct Plan {
  bool hears = true;    // its message is read
  bool answers = true;  // with a message
  grpc::Status status = grpc::Status::OK;
};

class Reactor final : public grpc::ServerGenericBidiReactor {
 public:
  explicit Reactor(Plan plan) : plan_(std::move(plan)) {
    if (plan_.hears) {
      StartRead(&request_);
    } else {
      Finish(plan_.status);
    }
  }
  void OnReadDone(bool) override {
    if (plan_.answers) {
      StartWriteAndFinish(&answer_, {}, plan_.status);
    } else {
      Finish(plan_.status);
    }
  }
  void OnDone() override { delete this; }

 private:
  const Plan plan_;
  grpc::ByteBuffer request_;
  const grpc::ByteBuffer answer_ = SomeBytes();
};

class AnswersAnything final : public grpc::CallbackGenericService {
 public:
  grpc::ServerGenericBidiReactor* CreateReactor(
      grpc::GenericCallbackServerContext* context) override {
    peer = context->peer();
    return new Reactor(plan);
  }
  Plan plan;  // changed between calls
  std::string peer;
};

class Wire final : public listen::Wire {
 public:
  explicit Wire(bool& trusted) : trusted_(trusted) {}
  uint64_t BytesReceived() override { return 0; }
  void Cut() override {}
  void Trust() override { trusted_ = true; }
  void Arm() override {}

 private:
  bool& trusted_;
};

class CallWatchTest : public ::testing::Test {
 protected:
  CallWatchTest() {
    grpc::ServerBuilder builder;
    int port = 0;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
    builder.RegisterCallbackGenericService(&service_);
    std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> watches;
    watches.push_back(MakeCallWatch(guard_));
    builder.experimental().SetInterceptorCreators(std::move(watches));
    server_ = builder.BuildAndStart();
    stub_ = std::make_unique<grpc::GenericStub>(
        grpc::CreateChannel(absl::StrCat("127.0.0.1:", port), grpc::InsecureChannelCredentials()));
    Call(kOthers, {});  // the name under which the connection is known
  }

  grpc::Status Call(const char* method, const Plan& plan) {
    service_.plan = plan;
    grpc::ClientContext context;
    const grpc::ByteBuffer request = SomeBytes();
    grpc::ByteBuffer answer;
    std::promise<grpc::Status> done;
    stub_->UnaryCall(&context, method, {}, &request, &answer,
                     [&](grpc::Status status) { done.set_value(std::move(status)); });
    return done.get_future().get();
  }

  // Returns whether a connection that was not authorised is so after the call.
  bool Authorises(const char* method, const Plan& plan) {
    bool trusted = false;
    const listen::Peer peer{listen::PeerName(service_.peer), "127.0.0.1", false};
    const listen::ConnectionId id = guard_.Enter(peer, false, std::make_unique<Wire>(trusted));
    Call(method, plan);
    guard_.Leave(id);
    return trusted;
  }

  sync::FakeClock clock_;
  listen::Counters counters_;
  listen::Guard guard_{listen::ConnectionLimits(), clock_, counters_, nullptr};
  AnswersAnything service_;
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<grpc::GenericStub> stub_;
};

TEST_F(CallWatchTest, AMessageAuthorisesWhateverComesBehindIt) {
  EXPECT_TRUE(Authorises(kOwn, {}));
  EXPECT_TRUE(Authorises(kOwn, {.status = {grpc::StatusCode::UNAUTHENTICATED, "who is it?"}}));
}

TEST_F(CallWatchTest, WithoutOneAStatusDoesThatSaysTheRequestWasUnderstood) {
  using enum grpc::StatusCode;
  const std::set<grpc::StatusCode> understood = {OK, NOT_FOUND, ALREADY_EXISTS, ABORTED,
                                                 FAILED_PRECONDITION};
  for (int code = OK; code <= UNAUTHENTICATED; ++code) {
    const auto status = static_cast<grpc::StatusCode>(code);
    EXPECT_EQ(Authorises(kOwn, {.answers = false, .status = {status, "as was asked for"}}),
              understood.contains(status))
        << code;
  }
}

TEST_F(CallWatchTest, WhatAnybodyMayAskAuthorisesNobody) {
  EXPECT_FALSE(Authorises(kOthers, {}));
  EXPECT_FALSE(Authorises(kOthers, {.answers = false}));
  EXPECT_FALSE(Authorises("/voxeldish.v1.Anything/Ask", {}));
}

TEST_F(CallWatchTest, NorDoesACallOfWhichNothingWasHeard) {
  for (const grpc::StatusCode code : {grpc::StatusCode::OK, grpc::StatusCode::NOT_FOUND}) {
    EXPECT_FALSE(Authorises(kOwn, {.hears = false, .status = {code, "unheard"}})) << code;
  }
}

}  // namespace
}  // namespace voxeld::daemon::services
