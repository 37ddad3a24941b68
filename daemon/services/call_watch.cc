#include "daemon/services/call_watch.h"

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_interceptor.h>

#include <atomic>
#include <string>
#include <string_view>

#include "daemon/listen/guard.h"
#include "daemon/listen/peer.h"

namespace voxeld::daemon::services {
namespace {

using grpc::experimental::InterceptionHookPoints;
using grpc::experimental::InterceptorBatchMethods;
using grpc::experimental::ServerRpcInfo;

// Package of the daemon's own services.
constexpr std::string_view kOwnPackage = "/voxeld.";

bool Understood(grpc::StatusCode code) {
  switch (code) {
    case grpc::StatusCode::OK:
    case grpc::StatusCode::NOT_FOUND:
    case grpc::StatusCode::ALREADY_EXISTS:
    case grpc::StatusCode::ABORTED:
    case grpc::StatusCode::FAILED_PRECONDITION:
      return true;
    default:
      return false;
  }
}

// Watches one call. gRPC runs its hooks on several threads: the hooks of reads may run concurrently
// with those of writes, but each kind is sequential.
class CallWatch final : public grpc::experimental::Interceptor {
 public:
  CallWatch(listen::Guard& guard, ServerRpcInfo* info)
      : guard_(guard),
        authorises_(std::string_view(info->method()).starts_with(kOwnPackage)),
        peer_(listen::PeerName(info->server_context()->peer())) {}

  ~CallWatch() override {
    if (heard_) guard_.OnCallEnd(peer_);
  }

  void Intercept(InterceptorBatchMethods* methods) override {
    if (!heard_ && methods->QueryInterceptionHookPoint(InterceptionHookPoints::POST_RECV_MESSAGE) &&
        methods->GetRecvMessage() != nullptr) {
      heard_ = true;
      guard_.OnMessage(peer_);
    }
    if (!answered_ && heard_ && Answers(methods)) {
      answered_ = true;
      guard_.OnAnswer(peer_, authorises_);
    }
    methods->Proceed();
  }

 private:
  static bool Answers(InterceptorBatchMethods* methods) {
    return methods->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_MESSAGE) ||
           (methods->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_STATUS) &&
            Understood(methods->GetSendStatus().error_code()));
  }

  listen::Guard& guard_;
  const bool authorises_;
  const std::string peer_;
  std::atomic<bool> heard_ = false;  // used by reads
  bool answered_ = false;            // used by writes
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
