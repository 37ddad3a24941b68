#include "daemon/listen/watcher.h"

#include <sys/epoll.h>
#include <sys/eventfd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <thread>
#include <unordered_map>
#include <utility>

#include "daemon/listen/socket.h"

namespace voxeld::daemon::listen {
namespace {

constexpr ConnectionId kWake = 0;  // epoll's word; no connection has it
constexpr int kEvents = 64;

}  // namespace

class Watcher::Impl {
 public:
  Impl(Guard& guard, sync::Clock& clock) : guard_(guard), clock_(clock) {}

  ~Impl() {
    {
      sync::MutexLock lock(mutex_);
      stop_ = true;
    }
    Wake();
    if (thread_.joinable()) thread_.join();
    for (const auto& [id, descriptor] : descriptors_) guard_.Leave(id);
  }

  absl::Status Start() {
    epoll_.Reset(epoll_create1(EPOLL_CLOEXEC));
    wake_.Reset(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
    if (!epoll_.ok() || !wake_.ok() || !Control(EPOLL_CTL_ADD, wake_.get(), EPOLLIN, kWake)) {
      return absl::ErrnoToStatus(errno, "watching connections");
    }
    thread_ = std::thread([this] { Run(); });
    return absl::OkStatus();
  }

  absl::Status Add(const Peer& peer, bool own, Descriptor connection) {
    const int descriptor = connection.get();
    ConnectionId id = 0;
    {
      sync::MutexLock lock(mutex_);
      id = guard_.Enter(peer, own, std::make_unique<SocketWire>(std::move(connection)));
      descriptors_.emplace(id, descriptor);
    }
    // Edges alone; of the end epoll always tells.
    if (!Control(EPOLL_CTL_ADD, descriptor, peer.unix_socket ? EPOLLET : EPOLLET | EPOLLIN, id)) {
      const int error = errno;
      Leave(id);
      return absl::ErrnoToStatus(error, "watching a connection");
    }
    Wake();  // what is looked at may just have begun
    return absl::OkStatus();
  }

 private:
  bool Control(int operation, int descriptor, uint32_t events, ConnectionId word) {
    epoll_event event = {};
    event.events = events;
    event.data.u64 = word;
    return epoll_ctl(epoll_.get(), operation, descriptor, &event) == 0;
  }

  void Wake() {
    const uint64_t one = 1;
    [[maybe_unused]] const ssize_t n = write(wake_.get(), &one, sizeof(one));
  }

  void Leave(ConnectionId id) {
    sync::MutexLock lock(mutex_);
    descriptors_.erase(id);
    guard_.Leave(id);
  }

  void Run() {
    sync::TimeNs look = sync::kNever;
    std::array<epoll_event, kEvents> events;
    for (;;) {
      {
        sync::MutexLock lock(mutex_);
        if (stop_) return;
      }
      const int n = epoll_wait(epoll_.get(), events.data(), kEvents, Timeout(look));
      bool woken = false;
      for (int i = 0; i < n; ++i) {
        const epoll_event& event = events[static_cast<size_t>(i)];
        if (event.data.u64 == kWake) {
          woken = true;
          uint64_t count = 0;
          [[maybe_unused]] const ssize_t read_bytes = read(wake_.get(), &count, sizeof(count));
        } else {
          Handle(event);
        }
      }
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
    if (guard_.OnBytes(id)) return;
    sync::MutexLock lock(mutex_);
    const auto at = descriptors_.find(id);
    if (at != descriptors_.end()) Control(EPOLL_CTL_MOD, at->second, EPOLLET, id);
  }

  Guard& guard_;
  sync::Clock& clock_;
  Descriptor epoll_, wake_;
  sync::Mutex mutex_;
  bool stop_ VOXELD_GUARDED_BY(mutex_) = false;
  // Of what the guard keeps, and closes.
  std::unordered_map<ConnectionId, int> descriptors_ VOXELD_GUARDED_BY(mutex_);
  std::thread thread_;
};

Watcher::Watcher(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Watcher::~Watcher() = default;

absl::StatusOr<std::unique_ptr<Watcher>> Watcher::Start(Guard& guard, sync::Clock& clock) {
  auto impl = std::make_unique<Impl>(guard, clock);
  if (absl::Status status = impl->Start(); !status.ok()) return status;
  return std::unique_ptr<Watcher>(new Watcher(std::move(impl)));
}

absl::Status Watcher::Add(const Peer& peer, bool own, Descriptor connection) {
  return impl_->Add(peer, own, std::move(connection));
}

}  // namespace voxeld::daemon::listen
