#include "daemon/listen/watcher.h"

#include <sys/epoll.h>
#include <sys/eventfd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <thread>
#include <unordered_set>
#include <utility>
#include <vector>

#include "daemon/listen/socket.h"

namespace voxeld::daemon::listen {
namespace {

constexpr ConnectionId kWakeConnection = 0;  // value of epoll events; no connection has it
constexpr int kWatcherEvents = 64;

bool Control(int operation, int epoll, int descriptor, uint32_t events, ConnectionId word) {
  epoll_event event = {};
  event.events = events;
  event.data.u64 = word;
  return epoll_ctl(epoll, operation, descriptor, &event) == 0;
}

// Connections that epoll no longer reports. Wires may outlive the watcher, so they share this
// object.
class Unwatched {
 public:
  Descriptor wake;  // eventfd of the watcher's thread

  void Wake() const {
    const uint64_t one = 1;
    [[maybe_unused]] const ssize_t n = write(wake.get(), &one, sizeof(one));
  }
  void Add(ConnectionId id) {
    sync::MutexLock lock(mutex_);
    ids_.push_back(id);
    Wake();
  }
  std::vector<ConnectionId> Take() {
    sync::MutexLock lock(mutex_);
    return std::exchange(ids_, {});
  }

 private:
  sync::Mutex mutex_;
  std::vector<ConnectionId> ids_ VOXELD_GUARDED_BY(mutex_);
};

class WatchedWire final : public SocketWire {
 public:
  WatchedWire(Descriptor descriptor, bool tcp, int epoll, std::shared_ptr<Unwatched> unwatched)
      : SocketWire(std::move(descriptor), tcp), epoll_(epoll), unwatched_(std::move(unwatched)) {}
  void SetWord(ConnectionId word) { word_ = word; }
  // EPOLLONESHOT applies to the end of the connection too: it is reported only while the wire is
  // armed.
  void Arm() override {
    if (Rearm()) return;
    // Add has not registered this descriptor yet. The guard found the wire by the name of an
    // earlier connection, whose call was answered before.
    if (errno == ENOENT) return;
    if (Rearm()) return;
    // The end would not be reported, so disconnect now.
    Cut();
    unwatched_->Add(word_);
  }

 private:
  bool Rearm() {
    return Control(EPOLL_CTL_MOD, epoll_, descriptor(), EPOLLET | EPOLLIN | EPOLLONESHOT, word_);
  }

  const int epoll_;
  const std::shared_ptr<Unwatched> unwatched_;
  std::atomic<ConnectionId> word_ = kWakeConnection;
};

}  // namespace

class Watcher::Impl {
 public:
  Impl(Guard& guard, sync::Clock& clock) : guard_(guard), clock_(clock) {}

  ~Impl() {
    {
      sync::MutexLock lock(mutex_);
      stop_ = true;
    }
    unwatched_->Wake();
    if (thread_.joinable()) thread_.join();
    for (const ConnectionId id : connections_) guard_.Leave(id);
  }

  absl::Status Start() {
    epoll_.Reset(epoll_create1(EPOLL_CLOEXEC));
    Descriptor& wake = unwatched_->wake;
    wake.Reset(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
    if (!epoll_.ok() || !wake.ok() ||
        !Control(EPOLL_CTL_ADD, epoll_.get(), wake.get(), EPOLLIN, kWakeConnection)) {
      return absl::ErrnoToStatus(errno, "watching connections");
    }
    thread_ = std::thread([this] { Run(); });
    return absl::OkStatus();
  }

  absl::StatusOr<ConnectionId> Add(const Peer& peer, bool own, Descriptor connection) {
    const int descriptor = connection.get();
    ConnectionId id = 0;
    auto wire = std::make_unique<WatchedWire>(std::move(connection), !peer.unix_socket,
                                              epoll_.get(), unwatched_);
    WatchedWire* const watched = wire.get();  // the guard's until Leave, here or on the thread
    {
      sync::MutexLock lock(mutex_);
      id = guard_.Enter(peer, own, std::move(wire));
      watched->SetWord(id);
      connections_.insert(id);
    }
    // Edge-triggered; epoll always reports the end.
    const uint32_t events = peer.unix_socket ? EPOLLET : EPOLLET | EPOLLIN;
    if (!Control(EPOLL_CTL_ADD, epoll_.get(), descriptor, events, id)) {
      const int error = errno;
      Leave(id);
      return absl::ErrnoToStatus(error, "watching a connection");
    }
    unwatched_->Wake();  // the thread may have to begin its checks
    return id;
  }

 private:
  void Leave(ConnectionId id) {
    sync::MutexLock lock(mutex_);
    connections_.erase(id);
    guard_.Leave(id);
  }

  void Run() {
    sync::TimeNs look = sync::kNever;
    std::array<epoll_event, kWatcherEvents> events;
    for (;;) {
      {
        sync::MutexLock lock(mutex_);
        if (stop_) return;
      }
      const int n = epoll_wait(epoll_.get(), events.data(), kWatcherEvents, Timeout(look));
      bool woken = false;
      for (int i = 0; i < n; ++i) {
        const epoll_event& event = events[static_cast<size_t>(i)];
        if (event.data.u64 == kWakeConnection) {
          woken = true;
          uint64_t count = 0;
          [[maybe_unused]] const ssize_t read_bytes =
              read(unwatched_->wake.get(), &count, sizeof(count));
        } else {
          Handle(event);
        }
      }
      for (const ConnectionId id : unwatched_->Take()) Leave(id);
      if (woken || look <= clock_.Now()) look = guard_.Look();
    }
  }

  int Timeout(sync::TimeNs look) const {
    if (look == sync::kNever) return -1;
    const sync::TimeNs left = std::max<sync::TimeNs>(0, look - clock_.Now());
    return static_cast<int>((left + sync::kMillisecond - 1) / sync::kMillisecond);
  }

  void Handle(const epoll_event& event) {
    const ConnectionId id = event.data.u64;
    if ((event.events & EPOLLHUP) != 0) return Leave(id);
    guard_.OnBytes(id);
  }

  Guard& guard_;
  sync::Clock& clock_;
  Descriptor epoll_;
  const std::shared_ptr<Unwatched> unwatched_ = std::make_shared<Unwatched>();
  sync::Mutex mutex_;
  bool stop_ VOXELD_GUARDED_BY(mutex_) = false;
  // Connections that have entered and not left.
  std::unordered_set<ConnectionId> connections_ VOXELD_GUARDED_BY(mutex_);
  std::thread thread_;
};

Watcher::Watcher(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Watcher::~Watcher() = default;

absl::StatusOr<std::unique_ptr<Watcher>> Watcher::Start(Guard& guard, sync::Clock& clock) {
  auto impl = std::make_unique<Impl>(guard, clock);
  if (absl::Status status = impl->Start(); !status.ok()) return status;
  return std::unique_ptr<Watcher>(new Watcher(std::move(impl)));
}

absl::StatusOr<ConnectionId> Watcher::Add(const Peer& peer, bool own, Descriptor connection) {
  return impl_->Add(peer, own, std::move(connection));
}

}  // namespace voxeld::daemon::listen
