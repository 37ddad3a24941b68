#include "daemon/listen/listener.h"

#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "daemon/listen/watcher.h"

namespace voxeld::daemon::listen {
namespace {

constexpr uint64_t kWake = 0;  // epoll's word; listening sockets have those from 1 on
constexpr int kEvents = 64;
constexpr int kAcceptsAtOnce = 64;  // of one address, before others have their turn

// What one connection's failure before it was accepted looks like; the next one may be well.
bool OfOneConnection(int error) {
  switch (error) {
    case EINTR:
    case ECONNABORTED:
    case EPROTO:
    case EPERM:
    case ENETDOWN:
    case ENOPROTOOPT:
    case EHOSTDOWN:
    case ENONET:
    case EHOSTUNREACH:
    case EOPNOTSUPP:
    case ENETUNREACH:
      return true;
    default:
      return false;
  }
}

}  // namespace

class Listener::Impl {
 public:
  Impl(std::vector<ListeningSocket> sockets, Guard& guard, Counters& counters, const OwnPeers& own,
       sync::Clock& clock, Serve serve, ListenerOptions options)
      : guard_(guard),
        counters_(counters),
        own_(own),
        clock_(clock),
        serve_(std::move(serve)),
        options_(options),
        gate_(clock, options.log),
        sockets_(std::move(sockets)) {}

  ~Impl() {
    {
      sync::MutexLock lock(mutex_);
      stop_ = true;
    }
    Wake();
    if (thread_.joinable()) thread_.join();
  }

  absl::Status Start() {
    absl::StatusOr<std::unique_ptr<Watcher>> watcher = Watcher::Start(guard_, clock_);
    if (!watcher.ok()) return watcher.status();
    watcher_ = *std::move(watcher);
    epoll_.Reset(epoll_create1(EPOLL_CLOEXEC));
    wake_.Reset(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
    if (!epoll_.ok() || !wake_.ok()) return absl::ErrnoToStatus(errno, "the listener");
    Watch(wake_.get(), EPOLLIN, kWake);
    for (size_t i = 0; i < sockets_.size(); ++i) Watch(sockets_[i].descriptor(), EPOLLIN, 1 + i);
    thread_ = std::thread([this] { Run(); });
    return absl::OkStatus();
  }

  void StopAccepting() {
    sync::MutexLock lock(mutex_);
    deaf_ = true;
    Wake();
    while (!sockets_closed_) closed_.Wait(mutex_);
  }

 private:
  void Wake() {
    const uint64_t one = 1;
    [[maybe_unused]] const ssize_t n = write(wake_.get(), &one, sizeof(one));
  }

  bool Watch(int descriptor, uint32_t events, uint64_t word) {
    epoll_event event = {};
    event.events = events;
    event.data.u64 = word;
    return epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, descriptor, &event) == 0;
  }

  void Change(int descriptor, uint32_t events, uint64_t word) {
    epoll_event event = {};
    event.events = events;
    event.data.u64 = word;
    epoll_ctl(epoll_.get(), EPOLL_CTL_MOD, descriptor, &event);
  }

  void Run() {
    std::array<epoll_event, kEvents> events;
    for (;;) {
      {
        sync::MutexLock lock(mutex_);
        if (stop_ || deaf_) sockets_.clear();
        if (sockets_.empty() && !std::exchange(sockets_closed_, true)) closed_.NotifyAll();
        if (stop_) return;
      }
      const int n = epoll_wait(epoll_.get(), events.data(), kEvents, Timeout());
      for (int i = 0; i < n; ++i) Handle(events[static_cast<size_t>(i)]);
      if (retry_ <= clock_.Now()) Resume();
    }
  }

  int Timeout() const {
    if (retry_ == sync::kNever) return -1;
    const sync::TimeNs left = std::max<sync::TimeNs>(0, retry_ - clock_.Now());
    return static_cast<int>((left + sync::kMillisecond - 1) / sync::kMillisecond);
  }

  void Handle(const epoll_event& event) {
    const uint64_t word = event.data.u64;
    if (word == kWake) {
      uint64_t count = 0;
      [[maybe_unused]] const ssize_t n = read(wake_.get(), &count, sizeof(count));
      return;
    }
    if (word - 1 < sockets_.size()) Accept(sockets_[word - 1]);
  }

  void Accept(const ListeningSocket& socket) {
    for (int i = 0; i < kAcceptsAtOnce; ++i) {
      SocketName name;
      Descriptor connection(
          accept4(socket.descriptor(), name.get(), &name.length, SOCK_NONBLOCK | SOCK_CLOEXEC));
      if (!connection.ok()) {
        if (errno == EAGAIN || errno == EWOULDBLOCK) return;
        if (OfOneConnection(errno)) continue;
        return Pause(std::strerror(errno));
      }
      if (!Take(socket, name, std::move(connection))) return;
    }
  }

  // False: the listener pauses.
  bool Take(const ListeningSocket& socket, const SocketName& name, Descriptor connection) {
    Peer peer = PeerOf(name.address, name.length);
    const bool own = own_.Has(peer.name);
    if (peer.unix_socket) {
      const absl::StatusOr<PeerCredentials> who = CredentialsOf(connection.get());
      if (!who.ok()) return true;  // it is gone
      peer.address = absl::StrCat("user ", who->user);
      if (!own) {
        gate_.Log(Logger::Level::kInfo, "local connection", peer.name,
                  absl::StrCat("user ", who->user, ", process ", who->process));
      }
    } else {
      const int on = 1;
      setsockopt(connection.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
      const auto limit = static_cast<unsigned>(options_.send_limit_ns / sync::kMillisecond);
      setsockopt(connection.get(), IPPROTO_TCP, TCP_USER_TIMEOUT, &limit, sizeof(limit));
    }
    if (!own && !guard_.MayEnter(peer).ok()) return true;

    Descriptor second(fcntl(connection.get(), F_DUPFD_CLOEXEC, 0));
    absl::Status added = absl::ErrnoToStatus(errno, "a second descriptor");
    if (second.ok()) added = watcher_->Add(peer, own, std::move(second));
    if (!added.ok()) {  // unguarded it would be worse than refused
      Pause(std::string(added.message()));
      return false;
    }
    serve_(socket.descriptor(), std::move(connection));
    return true;
  }

  void Pause(const std::string& why) {
    ++counters_.accept_failures;
    if (retry_ == sync::kNever && options_.log != nullptr) {
      rlimit limit = {};
      getrlimit(RLIMIT_NOFILE, &limit);
      options_.log->Warn(
          "no connection can be accepted",
          {{"why", why},
           {"connections", absl::StrCat(counters_.open.load())},
           {"descriptors", absl::StrCat(limit.rlim_cur)},
           {"hint",
            "each connection takes two descriptors: raise LimitNOFILE or lower max_connections"}});
    }
    paused_ = true;
    retry_ = clock_.Now() + kRetry;
    for (size_t i = 0; i < sockets_.size(); ++i) Change(sockets_[i].descriptor(), 0, 1 + i);
  }

  void Resume() {
    paused_ = false;
    for (size_t i = 0; i < sockets_.size(); ++i) {
      Change(sockets_[i].descriptor(), EPOLLIN, 1 + i);
      if (!paused_) Accept(sockets_[i]);
    }
    if (paused_) return;
    retry_ = sync::kNever;
    if (options_.log != nullptr) options_.log->Info("connections are accepted again");
  }

  Guard& guard_;
  Counters& counters_;
  const OwnPeers& own_;
  sync::Clock& clock_;
  const Serve serve_;
  const ListenerOptions options_;
  LogGate gate_;
  std::unique_ptr<Watcher> watcher_;
  Descriptor epoll_, wake_;
  sync::Mutex mutex_;
  sync::CondVar closed_;
  bool stop_ VOXELD_GUARDED_BY(mutex_) = false;
  bool deaf_ VOXELD_GUARDED_BY(mutex_) = false;
  bool sockets_closed_ VOXELD_GUARDED_BY(mutex_) = false;

  // The thread's own.
  std::vector<ListeningSocket> sockets_;
  sync::TimeNs retry_ = sync::kNever;
  bool paused_ = false;  // during Resume: again
  std::thread thread_;
};

Listener::Listener(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Listener::~Listener() = default;

absl::StatusOr<std::unique_ptr<Listener>> Listener::Start(std::vector<ListeningSocket> sockets,
                                                          Guard& guard, Counters& counters,
                                                          const OwnPeers& own, sync::Clock& clock,
                                                          Serve serve, ListenerOptions options) {
  auto impl = std::make_unique<Impl>(std::move(sockets), guard, counters, own, clock,
                                     std::move(serve), options);
  if (absl::Status status = impl->Start(); !status.ok()) return status;
  return std::unique_ptr<Listener>(new Listener(std::move(impl)));
}

void Listener::StopAccepting() { impl_->StopAccepting(); }

}  // namespace voxeld::daemon::listen
