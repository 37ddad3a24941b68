#include "daemon/services/server.h"

#include <grpc/grpc.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/impl/service_type.h>
#include <grpcpp/security/server_credentials.h>
#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>
#include <sys/stat.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "daemon/services/services.h"

namespace voxeld::daemon::services {
namespace {

constexpr const char* kServices[] = {"voxeld.v1.SceneService", "voxeld.v1.DisplayService"};

// Bytes that a stream may have on the way before they are asked for: HTTP/2's own window is no
// back-pressure, and with the bandwidth probe it grows to megabytes that wait unseen.
constexpr int kLookaheadBytes = 256 << 10;

// Of a client that pings on its own.
constexpr int kLeastPingIntervalMs = 5'000;

constexpr sync::TimeNs kLastCallsLimit = 200 * sync::kMillisecond;
constexpr mode_t kSocketMode = 0660;

// gRPC's threads stay until the process ends. Else the last server to go joins them, and one that
// polls for a connection whose client read slowly returns only after up to ten seconds.
void KeepGrpcUp() {
  static const bool up = (grpc_init(), true);
  (void)up;
}

int Milliseconds(sync::TimeNs time) { return static_cast<int>(time / sync::kMillisecond); }

}  // namespace

class Server::Impl {
 public:
  Impl(Core& core, sync::Clock& clock, ServerOptions options)
      : context_{core, clock, options.version, options.log, options.streams},
        options_(std::move(options)),
        scene_(MakeSceneService(context_)),
        display_(MakeDisplayService(context_)) {}

  ~Impl() { Shutdown(0); }

  absl::Status Start() {
    KeepGrpcUp();
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
    grpc::ServerBuilder builder;
    const uint64_t greatest = std::numeric_limits<int>::max();
    builder.SetMaxReceiveMessageSize(
        static_cast<int>(std::min(context_.core.limits().max_message_bytes, greatest)));
    builder.SetMaxSendMessageSize(-1);
    builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);  // a busy port is an error
    builder.AddChannelArgument(GRPC_ARG_HTTP2_BDP_PROBE, 0);
    builder.AddChannelArgument(GRPC_ARG_HTTP2_STREAM_LOOKAHEAD_BYTES, kLookaheadBytes);
    builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS,
                               Milliseconds(options_.keepalive_interval_ns));
    builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS,
                               Milliseconds(options_.keepalive_timeout_ns));
    builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS,
                               kLeastPingIntervalMs);
    builder.AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS,
                               static_cast<int>(options_.max_calls_per_connection));
    builder.RegisterService(scene_.get());
    builder.RegisterService(display_.get());

    if (options_.listen.empty()) {
      return absl::InvalidArgumentError("no address to listen on; give at least one");
    }
    std::vector<int> ports(options_.listen.size(), 0);
    for (size_t i = 0; i < options_.listen.size(); ++i) {
      const Address& address = options_.listen[i];
      if (absl::Status ready = PrepareToListen(address); !ready.ok()) return ready;
      builder.AddListeningPort(address.ToString(), grpc::InsecureServerCredentials(), &ports[i]);
    }
    if (options_.local.has_value()) {  // there before the first stream that is told of it
      absl::StatusOr<std::unique_ptr<local::LocalSocket>> local =
          local::LocalSocket::Start(context_.clock, *options_.local);
      if (!local.ok()) return local.status();
      context_.local = *std::move(local);
    }
    server_ = builder.BuildAndStart();
    for (size_t i = 0; i < options_.listen.size(); ++i) {
      Address address = options_.listen[i];
      if (ports[i] == 0) {
        return absl::UnavailableError(absl::StrCat(address.ToString(), " cannot be listened on"));
      }
      if (address.unix_socket) {
        chmod(address.path.c_str(), kSocketMode);
      } else {
        address.port = static_cast<uint16_t>(ports[i]);
      }
      addresses_.push_back(std::move(address));
    }
    if (server_ == nullptr) return absl::InternalError("the gRPC server could not be started");
    for (const char* service : kServices) {
      server_->GetHealthCheckService()->SetServingStatus(service, true);
    }
    return absl::OkStatus();
  }

  void SetServing(bool serving) {
    sync::MutexLock lock(serving_mutex_);
    if (down_) return;
    for (const char* service : kServices) {
      server_->GetHealthCheckService()->SetServingStatus(service, serving);
    }
    server_->GetHealthCheckService()->SetServingStatus("", serving);
  }

  void Shutdown(sync::TimeNs limit) {
    {
      sync::MutexLock lock(serving_mutex_);
      if (std::exchange(down_, true)) return;
    }
    if (server_ == nullptr) return;
    server_->GetHealthCheckService()->Shutdown();
    context_.calls.EndAll(absl::UnavailableError("shutting down"));
    const sync::TimeNs deadline = context_.clock.Now() + limit;
    const size_t calls = context_.calls.AwaitNone(context_.clock, deadline);
    const size_t short_calls = context_.short_calls.AwaitNone(context_.clock, deadline);
    if (options_.log != nullptr && calls + short_calls > 0) {
      options_.log->Warn("calls are cut off, their clients do not read or the core is busy",
                         {{"streams", absl::StrCat(calls)}, {"calls", absl::StrCat(short_calls)}});
    }
    // gRPC waits until every call has finished, and the core may be busy for longer than that.
    context_.short_calls.EndAll(
        absl::UnavailableError("shutting down; whether the call was carried out is not known"));
    // What is left are clients whose threads do not look at their connections:
    // gRPC would wait for those to the end.
    const sync::TimeNs rest =
        std::clamp<sync::TimeNs>(deadline - context_.clock.Now(), 0, kLastCallsLimit);
    server_->Shutdown(
        gpr_time_add(gpr_now(GPR_CLOCK_MONOTONIC), gpr_time_from_nanos(rest, GPR_TIMESPAN)));
    server_->Wait();
    server_.reset();
  }

  const std::vector<Address>& addresses() const { return addresses_; }

 private:
  ServiceContext context_;
  const ServerOptions options_;
  const std::unique_ptr<grpc::Service> scene_, display_;
  std::unique_ptr<grpc::Server> server_;
  sync::Mutex serving_mutex_;
  bool down_ VOXELD_GUARDED_BY(serving_mutex_) = false;
  std::vector<Address> addresses_;
};

Server::Server(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Server::~Server() = default;

absl::StatusOr<std::unique_ptr<Server>> Server::Start(Core& core, sync::Clock& clock,
                                                      ServerOptions options) {
  auto impl = std::make_unique<Impl>(core, clock, std::move(options));
  if (absl::Status status = impl->Start(); !status.ok()) return status;
  return std::unique_ptr<Server>(new Server(std::move(impl)));
}

const std::vector<Address>& Server::addresses() const { return impl_->addresses(); }
void Server::SetServing(bool serving) { impl_->SetServing(serving); }
void Server::Shutdown(sync::TimeNs limit) { impl_->Shutdown(limit); }

}  // namespace voxeld::daemon::services
