#include "daemon/services/call_watch.h"

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_interceptor.h>

#include <array>
#include <string>
#include <string_view>

#include "daemon/listen/guard.h"
#include "daemon/listen/peer.h"

namespace voxeld::daemon::services {
namespace {

using grpc::experimental::InterceptionHookPoints;
using grpc::experimental::InterceptorBatchMethods;
using grpc::experimental::ServerRpcInfo;

// Whose requests come as bytes and are parsed by us.
constexpr std::array<std::string_view, 2> kRawMethods = {"/voxeld.v1.SceneService/Stream",
                                                         "/voxeld.v1.SceneService/ApplyUpdate"};

bool IsRaw(std::string_view method) {
  for (const std::string_view raw : kRawMethods) {
    if (method == raw) return true;
  }
  return false;
}

// One call. gRPC runs its hooks from several threads: those of a stream's reads and writes may be at
// the same time, each of them one after another.
class CallWatch final : public grpc::experimental::Interceptor {
 public:
  CallWatch(listen::Guard& guard, ServerRpcInfo* info)
      : guard_(guard),
        raw_(IsRaw(info->method())),
        peer_(listen::PeerName(info->server_context()->peer())) {}

  ~CallWatch() override {
    if (heard_) guard_.OnCallEnd(peer_);
  }

  void Intercept(InterceptorBatchMethods* methods) override {
    if (!heard_ && methods->QueryInterceptionHookPoint(InterceptionHookPoints::POST_RECV_MESSAGE) &&
        methods->GetRecvMessage() != nullptr) {
      heard_ = true;
      guard_.OnMessage(peer_);
      if (!raw_) guard_.OnAuthorised(peer_);
    }
    if (raw_ && !answered_ &&
        methods->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_MESSAGE)) {
      answered_ = true;
      guard_.OnAuthorised(peer_);
    }
    methods->Proceed();
  }

 private:
  listen::Guard& guard_;
  const bool raw_;
  const std::string peer_;
  bool heard_ = false;     // by reads
  bool answered_ = false;  // by writes
};

class Factory final : public grpc::experimental::ServerInterceptorFactoryInterface {
 public:
  explicit Factory(listen::Guard& guard) : guard_(guard) {}
  grpc::experimental::Interceptor* CreateServerInterceptor(ServerRpcInfo* info) override {
    return new CallWatch(guard_, info);
  }

 private:
  listen::Guard& guard_;
};

}  // namespace

std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> MakeCallWatch(
    listen::Guard& guard) {
  return std::make_unique<Factory>(guard);
}

}  // namespace voxeld::daemon::services
