#include "daemon/local/local_socket.h"

#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <map>
#include <span>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/address/descriptor.h"
#include "daemon/listen/socket.h"
#include "daemon/local/connection.h"
#include "daemon/local/doorbell.h"

namespace voxeld::daemon::local {
namespace {

// How often the clock is checked while a connection has not sent its Hello (the clock may differ
// from the kernel's), and how often accepting is retried.
constexpr int kTickMs = 50;

// Values of epoll events; connections count on from here.
constexpr uint64_t kBell = 0, kListener = 1, kFirstConnection = 2;

absl::StatusOr<std::vector<listen::ListeningSocket>> Listen(const Address& address) {
  if (!address.unix_socket) {
    return absl::InvalidArgumentError(
        absl::StrCat("the local socket at ", address.ToString(), "; give unix:PATH"));
  }
  return listen::ListeningSocket::Listen(address, SOCK_SEQPACKET);
}

}  // namespace

// Everything except Make, Begin and the destructor runs on the socket's thread.
class LocalSocket::Impl {
 public:
  Impl(sync::Clock& clock, LocalSocketOptions options, std::shared_ptr<Doorbell> bell)
      : clock_(clock),
        options_(std::move(options)),
        bell_(std::move(bell)),
        tokens_(std::make_shared<Tokens>(options_.limits, bell_, options_.budget)) {}

  ~Impl() {
    if (!thread_.joinable()) return;
    stopping_ = true;
    bell_->Ring();
    thread_.join();
  }

  absl::Status Start() {
    epoll_ = Descriptor(epoll_create1(EPOLL_CLOEXEC));
    if (epoll_.get() < 0) return absl::ErrnoToStatus(errno, "epoll_create1");
    auto listener = Listen(options_.listen);
    if (!listener.ok()) return listener.status();
    listener_ = *std::move(listener);
    if (!Watch(EPOLL_CTL_ADD, bell_->descriptor(), kBell, EPOLLIN) ||
        !Watch(EPOLL_CTL_ADD, listener_.front().descriptor(), kListener, EPOLLIN)) {
      return absl::ErrnoToStatus(errno, "epoll_ctl");
    }
    thread_ = std::thread([this] { Run(); });
    return absl::OkStatus();
  }

  const Address& address() const { return options_.listen; }
  const std::shared_ptr<Tokens>& tokens() const { return tokens_; }

 private:
  using Connections = std::map<uint64_t, std::unique_ptr<Connection>>;

  void Run() {
    std::array<epoll_event, 32> events;
    while (!stopping_) {
      const bool ticking = without_hello_ > 0 || !accepting_;
      const int count = epoll_wait(epoll_.get(), events.data(), static_cast<int>(events.size()),
                                   ticking ? kTickMs : -1);
      for (const epoll_event& event :
           std::span(events).first(count > 0 ? static_cast<size_t>(count) : 0)) {
        if (event.data.u64 == kBell) {
          bell_->Quiet();
          EndWithSessions();
        } else if (event.data.u64 == kListener) {
          Accept();
        } else {
          Serve(event.data.u64);
        }
      }
      EndOverdue();
      ListenAgain();
    }
    connections_.clear();
  }

  bool Watch(int operation, int fd, uint64_t what, uint32_t events) {
    epoll_event event = {};
    event.events = events;
    event.data.u64 = what;
    return epoll_ctl(epoll_.get(), operation, fd, &event) == 0;
  }

  void Accept() {
    Descriptor socket(
        accept4(listener_.front().descriptor(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
    if (socket.get() < 0) {
      if (errno == EAGAIN || errno == EINTR || errno == ECONNABORTED) return;
      accept_failed_ = true;  // no descriptors left, for example; open ones may be closed
      return StopAccepting();
    }
    auto connection = std::make_unique<Connection>(
        std::move(socket), clock_.Now() + options_.hello_limit_ns, options_.log);
    const uint64_t number = next_++;
    if (!Watch(EPOLL_CTL_ADD, connection->socket(), number, EPOLLIN)) return;
    connections_.emplace(number, std::move(connection));
    if (++without_hello_ >= options_.max_without_hello) StopAccepting();
  }

  void StopAccepting() {
    accepting_ = false;
    Watch(EPOLL_CTL_MOD, listener_.front().descriptor(), kListener, 0);
  }

  // After a failure, accepts again only after another event or a tick.
  void ListenAgain() {
    if (std::exchange(accept_failed_, false) || accepting_) return;
    if (without_hello_ >= options_.max_without_hello) return;
    accepting_ = Watch(EPOLL_CTL_MOD, listener_.front().descriptor(), kListener, EPOLLIN);
  }

  void Serve(uint64_t number) {
    const auto found = connections_.find(number);
    if (found == connections_.end()) return;  // ended by an earlier event
    Connection& connection = *found->second;
    const bool waited = connection.wants_to_write();
    const bool had_hello = connection.memory() != nullptr;
    if (!connection.Serve(*tokens_)) return Remove(found);
    if (!had_hello && connection.memory() != nullptr) {
      --without_hello_;
      TakePlace(number, *connection.memory());
    }
    if (waited != connection.wants_to_write()) {
      Watch(EPOLL_CTL_MOD, connection.socket(), number,
            connection.wants_to_write() ? EPOLLOUT : EPOLLIN);
    }
  }

  void TakePlace(uint64_t newer, const LocalMemory& memory) {
    EndIf(
        [&](uint64_t number, const Connection& connection) {
          return number != newer && connection.memory().get() == &memory;
        },
        "another connection of the session has taken the place of this one");
  }

  void EndWithSessions() {
    EndIf(
        [](uint64_t, const Connection& connection) {
          return connection.memory() != nullptr && connection.memory()->ended();
        },
        "the session has ended");
  }

  void EndOverdue() {
    if (without_hello_ == 0) return;
    const sync::TimeNs now = clock_.Now();
    EndIf(
        [now](uint64_t, const Connection& connection) {
          return connection.memory() == nullptr && connection.hello_deadline() <= now;
        },
        "no hello came in time; send it at once");
  }

  template <typename Condition>
  void EndIf(const Condition& condition, std::string_view why) {
    for (auto at = connections_.begin(); at != connections_.end();) {
      const auto current = at++;
      if (!condition(current->first, *current->second)) continue;
      current->second->Refuse(why);
      Remove(current);
    }
  }

  void Remove(Connections::iterator at) {
    if (at->second->memory() == nullptr) --without_hello_;
    connections_.erase(at);
  }

  sync::Clock& clock_;
  const LocalSocketOptions options_;
  const std::shared_ptr<Doorbell> bell_;
  const std::shared_ptr<Tokens> tokens_;
  Descriptor epoll_;
  std::vector<listen::ListeningSocket> listener_;  // exactly one
  std::atomic<bool> stopping_ = false;
  Connections connections_;
  uint64_t next_ = kFirstConnection;
  uint32_t without_hello_ = 0;
  bool accepting_ = true;
  bool accept_failed_ = false;  // in this round
  std::thread thread_;
};

LocalSocket::LocalSocket(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
LocalSocket::~LocalSocket() = default;

absl::StatusOr<std::unique_ptr<LocalSocket>> LocalSocket::Start(sync::Clock& clock,
                                                                LocalSocketOptions options) {
  absl::StatusOr<std::shared_ptr<Doorbell>> bell = Doorbell::Make();
  if (!bell.ok()) return bell.status();
  auto impl = std::make_unique<Impl>(clock, std::move(options), *std::move(bell));
  if (absl::Status status = impl->Start(); !status.ok()) return status;
  return std::unique_ptr<LocalSocket>(new LocalSocket(std::move(impl)));
}

const Address& LocalSocket::address() const { return impl_->address(); }
const std::shared_ptr<Tokens>& LocalSocket::tokens() const { return impl_->tokens(); }

}  // namespace voxeld::daemon::local
