#include "daemon/services/server.h"

#include <grpc/grpc.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/impl/service_type.h>
#include <grpcpp/resource_quota.h>
#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "daemon/listen/guard.h"
#include "daemon/listen/listener.h"
#include "daemon/listen/probe.h"
#include "daemon/listen/socket.h"
#include "daemon/services/acceptors.h"
#include "daemon/services/call_meter.h"
#include "daemon/services/call_watch.h"
#include "daemon/services/grpc_log.h"
#include "daemon/services/services.h"

namespace voxeld::daemon::services {
namespace {

constexpr const char* kServices[] = {"voxeld.v1.SceneService", "voxeld.v1.DisplayService"};

// Bytes that a stream may have in flight before they are requested. HTTP/2's own window is no
// back-pressure: with the bandwidth probe it grows to megabytes that wait unseen.
constexpr int kLookaheadBytes = 256 << 10;

constexpr sync::TimeNs kLastCallsLimit = 200 * sync::kMillisecond;

// Keeps gRPC's threads until the process exits. Otherwise the last server joins them, and a thread
// that polls for a connection with a slow reader returns only after up to ten seconds.
void KeepGrpcUp() {
  static const bool up = (grpc_init(), true);
  (void)up;
}

listen::ConnectionLimits LimitsOf(listen::ConnectionLimits limits, Core& core) {
  limits.max_message_bytes = core.limits().max_message_bytes;
  limits.lookahead_bytes = kLookaheadBytes;
  return limits;
}

int Milliseconds(sync::TimeNs time) { return static_cast<int>(time / sync::kMillisecond); }

// gRPC represents "never" as the maximum value.
int MillisecondsOrNever(sync::TimeNs time) {
  return time == 0 ? std::numeric_limits<int>::max() : Milliseconds(time);
}

}  // namespace

class Server::Impl {
 public:
  Impl(Core& core, sync::Clock& clock, ServerOptions options)
      : options_(std::move(options)),
        counters_(options_.counters != nullptr ? options_.counters
                                               : std::make_shared<listen::Counters>()),
        context_{.core = core,
                 .clock = clock,
                 .counters = *counters_,
                 .version = options_.version,
                 .log = options_.log,
                 .limits = options_.streams,
                 .scene_watches{"the scene", "max_scene_watches", options_.max_scene_watches},
                 .stalled_watches{"the scene whose clients do not read", "max_scene_watches",
                                  options_.max_scene_watches},
                 .stats_watches{"the statistics", "max_stats_watches", options_.max_stats_watches},
                 .volume_watches{"volumes", "max_volume_watches", options_.max_volume_watches},
                 .access = options_.access,
                 .audit = options_.audit,
                 .assets = options_.assets},
        acceptors_(options_.tls),
        guard_(LimitsOf(options_.connections, core), clock, *counters_, options_.log),
        scene_(MakeSceneService(context_)),
        display_(MakeDisplayService(context_)) {}

  ~Impl() { Shutdown(0); }

  absl::Status Start(std::vector<listen::ListeningSocket> sockets) {
    if (options_.listen.empty() && sockets.empty()) {
      return absl::InvalidArgumentError("no address to listen on; give at least one");
    }
    for (const listen::ListeningSocket& socket : sockets) {
      addresses_.push_back(socket.address());
      targets_.push_back({socket.name(), socket.address().ToString(), socket.address().tls});
    }
    for (const Address& address : options_.listen) {
      if (std::find(addresses_.begin(), addresses_.end(), address) != addresses_.end()) continue;
      if (address.tls && options_.tls == nullptr) {
        return absl::InvalidArgumentError(
            absl::StrCat(address.ToString(),
                         " is to speak TLS, and there is no certificate; give "
                         "tls_certificate, tls_key and tls_client_ca"));
      }
      auto made = listen::ListeningSocket::Listen(address);
      if (!made.ok()) return made.status();
      addresses_.push_back(made->front().address());
      for (listen::ListeningSocket& socket : *made) {
        targets_.push_back({socket.name(), socket.address().ToString(), address.tls});
        sockets.push_back(std::move(socket));
      }
    }
    if (options_.local.has_value()) {  // before the first stream announces it
      local::LocalSocketOptions local = *options_.local;
      local.budget = context_.core.budget();
      auto socket = local::LocalSocket::Start(context_.clock, std::move(local));
      if (!socket.ok()) return socket.status();
      context_.local = *std::move(socket);
    }
    if (absl::Status status = Build(); !status.ok()) return status;
    auto listener = listen::Listener::Start(
        std::move(sockets), guard_, *counters_, own_, context_.clock,
        [this](const listen::Accepted& accepted, Descriptor connection) {
          return acceptors_.Take(accepted, std::move(connection));
        },
        {.send_limit_ns = options_.keepalive_timeout_ns, .log = options_.log});
    if (!listener.ok()) return listener.status();
    listener_ = *std::move(listener);
    meter_ = std::make_unique<CallMeter>(guard_, options_.max_calls_per_connection, context_.clock);
    if (options_.connections.probe_interval_ns > 0) {
      probe_ = std::make_unique<listen::Probe>(
          targets_, options_.connections.probe_interval_ns,
          [this](const listen::ProbeTarget& target) {
            return listen::Reach(target, own_, listen::Probe::kLimit);
          },
          [this](bool reachable) { SetReachable(reachable); }, *counters_, context_.clock,
          options_.log);
    }
    return absl::OkStatus();
  }

  absl::Status Build() {
    KeepGrpcUp();
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
    grpc::ServerBuilder builder;
    const uint64_t greatest = std::numeric_limits<int>::max();
    builder.SetMaxReceiveMessageSize(
        static_cast<int>(std::min(context_.core.limits().max_message_bytes, greatest)));
    builder.SetMaxSendMessageSize(-1);
    grpc::ResourceQuota quota("voxeld");
    quota.Resize(options_.max_arriving_bytes);
    builder.SetResourceQuota(quota);
    for (const auto& [name, value] : {
             std::pair(GRPC_ARG_HTTP2_BDP_PROBE, 0),
             {GRPC_ARG_ENABLE_CHANNELZ, 1},  // needed by call_meter.h
             {GRPC_ARG_HTTP2_STREAM_LOOKAHEAD_BYTES, kLookaheadBytes},
             {GRPC_ARG_KEEPALIVE_TIME_MS, Milliseconds(options_.keepalive_interval_ns)},
             {GRPC_ARG_KEEPALIVE_TIMEOUT_MS, Milliseconds(options_.keepalive_timeout_ns)},
             {GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS,
              Milliseconds(options_.ping_interval_min_ns)},
             {GRPC_ARG_HTTP2_MAX_PING_STRIKES, static_cast<int>(options_.max_ping_strikes)},
             {GRPC_ARG_MAX_CONCURRENT_STREAMS, static_cast<int>(options_.max_calls_per_connection)},
             {GRPC_ARG_MAX_METADATA_SIZE, static_cast<int>(options_.max_metadata_bytes)},
             {GRPC_ARG_SERVER_HANDSHAKE_TIMEOUT_MS, Milliseconds(options_.handshake_limit_ns)},
             {GRPC_ARG_MAX_CONNECTION_IDLE_MS,
              MillisecondsOrNever(options_.connection_idle_limit_ns)},
             {GRPC_ARG_MAX_CONNECTION_AGE_MS,
              MillisecondsOrNever(options_.connection_age_limit_ns)},
             {GRPC_ARG_MAX_CONNECTION_AGE_GRACE_MS, Milliseconds(options_.connection_age_grace_ns)},
         }) {
      builder.AddChannelArgument(name, value);
    }
    builder.RegisterService(scene_.get());
    builder.RegisterService(display_.get());
    std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> watches;
    watches.push_back(MakeCallWatch(guard_));
    builder.experimental().SetInterceptorCreators(std::move(watches));
    acceptors_.AddTo(builder);
    server_ = builder.BuildAndStart();
    if (server_ == nullptr) return absl::InternalError("the gRPC server could not be started");
    for (const char* service : kServices) {
      server_->GetHealthCheckService()->SetServingStatus(service, true);
    }
    return absl::OkStatus();
  }

  void SetServing(bool serving) {
    sync::MutexLock lock(serving_mutex_);
    wanted_ = serving;
    TellHealth();
  }

  void SetReachable(bool reachable) {
    sync::MutexLock lock(serving_mutex_);
    reachable_ = reachable;
    TellHealth();
  }

  void TellHealth() VOXELD_REQUIRES(serving_mutex_) {
    if (down_) return;
    const bool serving = wanted_ && reachable_;
    for (const char* service : kServices) {
      server_->GetHealthCheckService()->SetServingStatus(service, serving);
    }
    server_->GetHealthCheckService()->SetServingStatus("", serving);
  }

  size_t EndRevoked() {
    if (options_.access == nullptr) return 0;
    const size_t ended =
        context_.calls.EndRevoked([access = options_.access](const access::Caller& caller) {
          return access->Recheck(caller);
        });
    counters_->calls_revoked += ended;
    return ended;
  }

  void Shutdown(sync::TimeNs limit) {
    {
      sync::MutexLock lock(serving_mutex_);
      if (std::exchange(down_, true)) return;
    }
    if (server_ == nullptr) return;
    if (probe_ != nullptr) probe_->Stop();
    if (listener_ != nullptr) listener_->StopAccepting();
    server_->GetHealthCheckService()->Shutdown();
    context_.calls.EndAll(absl::UnavailableError("shutting down"));
    const sync::TimeNs deadline = context_.clock.Now() + limit;
    const size_t calls = context_.calls.AwaitNone(context_.clock, deadline);
    const size_t short_calls = context_.short_calls.AwaitNone(context_.clock, deadline);
    if (options_.log != nullptr && calls + short_calls > 0) {
      options_.log->Warn("calls are cut off, their clients do not read or the core is busy",
                         {{"streams", absl::StrCat(calls)}, {"calls", absl::StrCat(short_calls)}});
    }
    // gRPC waits until every call has finished, but the core may be busy for longer.
    context_.short_calls.EndAll(
        absl::UnavailableError("shutting down; whether the call was carried out is not known"));
    // The remaining clients do not read their connections. gRPC would wait for them forever.
    const sync::TimeNs rest =
        std::clamp<sync::TimeNs>(deadline - context_.clock.Now(), 0, kLastCallsLimit);
    server_->Shutdown(
        gpr_time_add(gpr_now(GPR_CLOCK_MONOTONIC), gpr_time_from_nanos(rest, GPR_TIMESPAN)));
    server_->Wait();
    server_.reset();
    meter_.reset();
    listener_.reset();
    probe_.reset();  // its pending requests ended with the server
  }

  const std::vector<Address>& addresses() const { return addresses_; }

 private:
  const ServerOptions options_;
  const std::shared_ptr<listen::Counters> counters_;
  ServiceContext context_;
  Acceptors acceptors_;
  listen::LogGate grpc_gate_{context_.clock, options_.log};
  GrpcLog grpc_log_{grpc_gate_};
  listen::Guard guard_;
  listen::OwnPeers own_;
  std::vector<listen::ProbeTarget> targets_;
  const std::unique_ptr<grpc::Service> scene_, display_;
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<listen::Listener> listener_;
  std::unique_ptr<CallMeter> meter_;
  std::unique_ptr<listen::Probe> probe_;
  sync::Mutex serving_mutex_;
  bool down_ VOXELD_GUARDED_BY(serving_mutex_) = false;
  bool wanted_ VOXELD_GUARDED_BY(serving_mutex_) = true;
  bool reachable_ VOXELD_GUARDED_BY(serving_mutex_) = true;
  std::vector<Address> addresses_;
};

Server::Server(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Server::~Server() = default;

absl::StatusOr<std::unique_ptr<Server>> Server::Start(
    Core& core, sync::Clock& clock, ServerOptions options,
    std::vector<listen::ListeningSocket> inherited) {
  auto impl = std::make_unique<Impl>(core, clock, std::move(options));
  if (absl::Status status = impl->Start(std::move(inherited)); !status.ok()) return status;
  return std::unique_ptr<Server>(new Server(std::move(impl)));
}

const std::vector<Address>& Server::addresses() const { return impl_->addresses(); }
void Server::SetServing(bool serving) { impl_->SetServing(serving); }
size_t Server::EndRevoked() { return impl_->EndRevoked(); }
void Server::Shutdown(sync::TimeNs limit) { impl_->Shutdown(limit); }

}  // namespace voxeld::daemon::services
