#include "daemon/listen/probe.h"

#include <netinet/in.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <poll.h>
#include <sys/un.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <memory>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace voxeld::daemon::listen {
namespace {

using std::chrono::steady_clock;

// HTTP/2 (RFC 9113): a frame header has 24 bits of length, type, flags and 31 bits of stream.
constexpr size_t kFrameHeadBytes = 9;
constexpr char kDataFrame = 0, kHeadersFrame = 1, kSettingsFrame = 4, kGoAwayFrame = 7;
constexpr char kEndStreamFlag = 1, kEndHeadersFlag = 4;
constexpr std::string_view kClientPreface = "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";

void AddFrame(char type, char flags, char stream, std::string_view payload, std::string* out) {
  const size_t size = payload.size();
  const char head[kFrameHeadBytes] = {static_cast<char>(size >> 16),
                                      static_cast<char>(size >> 8),
                                      static_cast<char>(size),
                                      type,
                                      flags,
                                      0,
                                      0,
                                      0,
                                      stream};
  out->append(head, sizeof(head));
  out->append(payload);
}

// Adds a literal field without indexing (RFC 7541, 6.2.2). Requires: both texts are short.
void AddField(std::string_view name, std::string_view value, std::string* out) {
  out->push_back('\0');
  for (const std::string_view text : {name, value}) {
    out->push_back(static_cast<char>(text.size()));
    out->append(text);
  }
}

// Returns: a call of grpc.health.v1.Health/Check with an empty request, on stream 1.
std::string HealthCheck() {
  std::string fields;
  AddField(":method", "POST", &fields);
  AddField(":scheme", "http", &fields);
  AddField(":path", "/grpc.health.v1.Health/Check", &fields);
  AddField(":authority", "voxeld", &fields);
  AddField("content-type", "application/grpc", &fields);
  AddField("te", "trailers", &fields);
  std::string out(kClientPreface);
  AddFrame(kSettingsFrame, 0, 0, "", &out);
  AddFrame(kHeadersFrame, kEndHeadersFlag, 1, fields, &out);
  AddFrame(kDataFrame, kEndStreamFlag, 1, std::string_view("\0\0\0\0\0", 5), &out);
  return out;
}

class Attempt {
 public:
  Attempt(int descriptor, sync::TimeNs limit)
      : descriptor_(descriptor), end_(steady_clock::now() + std::chrono::nanoseconds(limit)) {}

  absl::Status Connect(const SocketName& name) {
    if (connect(descriptor_, name.get(), name.length) == 0) return absl::OkStatus();
    if (errno != EINPROGRESS) return absl::ErrnoToStatus(errno, "connect");
    if (absl::Status status = Await(POLLOUT); !status.ok()) return status;
    int error = 0;
    socklen_t length = sizeof(error);
    getsockopt(descriptor_, SOL_SOCKET, SO_ERROR, &error, &length);
    return error == 0 ? absl::OkStatus() : absl::ErrnoToStatus(error, "connect");
  }

  // Does the handshake until the daemon has sent its certificate or an alert.
  absl::Status ShakeHands() {
    const std::unique_ptr<SSL_CTX, decltype(&SSL_CTX_free)> context(
        SSL_CTX_new(TLS_client_method()), &SSL_CTX_free);
    if (context == nullptr) return absl::ResourceExhaustedError("TLS");
    constexpr unsigned char kHttp2[] = {2, 'h', '2'};
    SSL_CTX_set_alpn_protos(context.get(), kHttp2, sizeof(kHttp2));
    SSL_CTX_set_verify(context.get(), SSL_VERIFY_NONE, nullptr);  // the daemon's own certificate
    const std::unique_ptr<SSL, decltype(&SSL_free)> ssl(SSL_new(context.get()), &SSL_free);
    if (ssl == nullptr || SSL_set_fd(ssl.get(), descriptor_) != 1) {
      return absl::ResourceExhaustedError("TLS");
    }
    for (;;) {
      ERR_clear_error();
      const int done = SSL_connect(ssl.get());
      if (done == 1) return absl::OkStatus();
      switch (SSL_get_error(ssl.get(), done)) {
        case SSL_ERROR_WANT_READ:
          if (absl::Status status = Await(POLLIN); !status.ok()) return status;
          break;
        case SSL_ERROR_WANT_WRITE:
          if (absl::Status status = Await(POLLOUT); !status.ok()) return status;
          break;
        case SSL_ERROR_SSL:  // an alert: the address speaks TLS and rejected the probe
          return absl::OkStatus();
        default:
          return absl::UnavailableError("the connection was closed without an answer");
      }
    }
  }

  absl::Status Ask() {
    const std::string request = HealthCheck();
    const ssize_t sent = send(descriptor_, request.data(), request.size(), MSG_NOSIGNAL);
    if (sent != static_cast<ssize_t>(request.size())) return absl::ErrnoToStatus(errno, "send");
    std::string got;
    for (;;) {
      while (got.size() >= kFrameHeadBytes) {
        const auto byte = [&](size_t i) {
          return static_cast<size_t>(static_cast<uint8_t>(got[i]));
        };
        const size_t size = byte(0) << 16 | byte(1) << 8 | byte(2);
        if (got[3] == kHeadersFrame && got[8] == 1) return absl::OkStatus();
        if (got[3] == kGoAwayFrame) return absl::UnavailableError("it was sent away");
        if (got.size() < kFrameHeadBytes + size) break;
        got.erase(0, kFrameHeadBytes + size);
      }
      if (absl::Status status = Await(POLLIN); !status.ok()) return status;
      char buffer[4096];
      const ssize_t n = recv(descriptor_, buffer, sizeof(buffer), 0);
      if (n == 0) return absl::UnavailableError("the connection was closed without an answer");
      if (n < 0 && errno != EAGAIN) return absl::ErrnoToStatus(errno, "recv");
      if (n > 0) got.append(buffer, static_cast<size_t>(n));
    }
  }

 private:
  absl::Status Await(short events) {
    for (;;) {
      const auto left =
          std::chrono::duration_cast<std::chrono::milliseconds>(end_ - steady_clock::now());
      pollfd poll_fd = {descriptor_, events, 0};
      const int n = poll(&poll_fd, 1, static_cast<int>(std::max<int64_t>(0, left.count())));
      if (n > 0) return absl::OkStatus();
      if (n == 0) return absl::DeadlineExceededError("no answer came in time");
      if (errno != EINTR) return absl::ErrnoToStatus(errno, "poll");
    }
  }

  const int descriptor_;
  const steady_clock::time_point end_;
};

// Returns: the address at which a client on this machine reaches the socket `name`.
SocketName Near(SocketName name) {
  if (name.address.ss_family == AF_INET) {
    auto* v4 = reinterpret_cast<sockaddr_in*>(&name.address);
    if (v4->sin_addr.s_addr == htonl(INADDR_ANY)) v4->sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  } else if (name.address.ss_family == AF_INET6) {
    auto* v6 = reinterpret_cast<sockaddr_in6*>(&name.address);
    if (IN6_IS_ADDR_UNSPECIFIED(&v6->sin6_addr)) v6->sin6_addr = in6addr_loopback;
  }
  return name;
}

// Binds the socket to any port, or to any unix socket name that the kernel chooses, so that the
// listener recognises it. Returns: its name.
absl::StatusOr<std::string> BindAnywhere(int descriptor, const SocketName& target) {
  SocketName name = target;
  if (name.address.ss_family == AF_INET) {
    reinterpret_cast<sockaddr_in*>(&name.address)->sin_port = 0;
  } else if (name.address.ss_family == AF_INET6) {
    reinterpret_cast<sockaddr_in6*>(&name.address)->sin6_port = 0;
  } else {
    name.length = sizeof(sa_family_t);
  }
  if (bind(descriptor, name.get(), name.length) != 0) return absl::ErrnoToStatus(errno, "bind");
  name.length = sizeof(name.address);
  if (getsockname(descriptor, name.get(), &name.length) != 0) {
    return absl::ErrnoToStatus(errno, "getsockname");
  }
  return PeerOf(name.address, name.length).name;
}

}  // namespace

absl::Status Reach(const ProbeTarget& target, OwnPeers& own, sync::TimeNs limit) {
  const SocketName name = Near(target.name);
  const Descriptor descriptor(
      socket(name.address.ss_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!descriptor.ok()) return absl::ErrnoToStatus(errno, "socket");
  const absl::StatusOr<std::string> peer = BindAnywhere(descriptor.get(), name);
  if (!peer.ok()) return peer.status();
  own.Add(*peer);
  Attempt attempt(descriptor.get(), limit);
  absl::Status status = attempt.Connect(name);
  if (status.ok()) status = target.tls ? attempt.ShakeHands() : attempt.Ask();
  own.Remove(*peer);
  return status;
}

Probe::Probe(std::vector<ProbeTarget> targets, sync::TimeNs interval, Try attempt,
             OnChange on_change, Counters& counters, sync::Clock& clock, Logger* log)
    : targets_(std::move(targets)),
      interval_(interval),
      attempt_(std::move(attempt)),
      on_change_(std::move(on_change)),
      counters_(counters),
      clock_(clock),
      log_(log),
      failures_(targets_.size(), 0),
      thread_([this] { Run(); }) {}

Probe::~Probe() {
  Stop();
  thread_.join();
}

void Probe::Stop() {
  sync::MutexLock lock(mutex_);
  stop_ = true;
  changed_.NotifyAll();
}

bool Probe::Stopped() {
  sync::MutexLock lock(mutex_);
  return stop_;
}

void Probe::Run() {
  for (;;) {
    {
      sync::MutexLock lock(mutex_);
      const sync::TimeNs due = clock_.Now() + interval_;
      while (!stop_ && clock_.Now() < due) clock_.WaitUntil(mutex_, changed_, due);
      if (stop_) return;
    }
    Round();
  }
}

void Probe::Round() {
  std::vector<std::string> reasons;
  for (size_t i = 0; i < targets_.size(); ++i) {
    const absl::Status status = attempt_(targets_[i]);
    if (Stopped()) return;
    if (status.ok()) {
      failures_[i] = 0;
      continue;
    }
    ++counters_.probe_failures;
    if (++failures_[i] < kFailures) continue;
    reasons.push_back(absl::StrCat(targets_[i].text, ": ", status.message()));
  }
  const std::string why = absl::StrJoin(reasons, "; ");
  counters_.SetUnreachable(why);
  const bool reachable = reasons.empty();
  if (std::exchange(reachable_, reachable) == reachable) return;
  if (log_ != nullptr) {
    if (reachable) {
      log_->Info("reachable again");
    } else {
      log_->Error("not reachable: a connection to itself fails", {{"why", why}});
    }
  }
  on_change_(reachable);
}

}  // namespace voxeld::daemon::listen
