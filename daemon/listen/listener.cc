#include "daemon/listen/listener.h"

#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/ioctl.h>
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <map>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "daemon/listen/greeting.h"
#include "daemon/listen/watcher.h"

namespace voxeld::daemon::listen {
namespace {

// Values of epoll events: listening sockets use 1 and up, connections kConnections and up.
constexpr uint64_t kWake = 0, kConnections = uint64_t{1} << 32;
constexpr int kEvents = 64;
constexpr int kAcceptsAtOnce = 64;  // per address, before other addresses have their turn

// Returns: whether the error concerns only one connection that failed before it was accepted.
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
        sockets_(std::move(sockets)),
        resting_(sockets_.size(), false) {}

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
    Reserve();
    epoll_.Reset(epoll_create1(EPOLL_CLOEXEC));
    wake_.Reset(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
    bool ready = epoll_.ok() && wake_.ok() && reserve_.ok() && Watch(wake_.get(), EPOLLIN, kWake);
    for (size_t i = 0; ready && i < sockets_.size(); ++i) {
      ready = Watch(sockets_[i].descriptor(), EPOLLIN, 1 + i);
    }
    if (!ready) return absl::ErrnoToStatus(errno, "the listener");
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
        if (stop_ || deaf_) {
          sockets_.clear();
          while (!strangers_.empty()) Drop(strangers_.begin());
        }
        if (sockets_.empty() && !std::exchange(sockets_closed_, true)) closed_.NotifyAll();
        if (stop_) return;
      }
      const int n = epoll_wait(epoll_.get(), events.data(), kEvents, Timeout());
      for (int i = 0; i < n; ++i) Handle(events[static_cast<size_t>(i)]);
      const sync::TimeNs now = clock_.Now();
      if (retry_ <= now) Resume();
      if (rest_until_ <= now) EndRest();
    }
  }

  int Timeout() const {
    const sync::TimeNs due = std::min(retry_, rest_until_);
    if (due == sync::kNever) return -1;
    const sync::TimeNs left = std::max<sync::TimeNs>(0, due - clock_.Now());
    return static_cast<int>((left + sync::kMillisecond - 1) / sync::kMillisecond);
  }

  void Handle(const epoll_event& event) {
    const uint64_t word = event.data.u64;
    if (word == kWake) {
      uint64_t count = 0;
      [[maybe_unused]] const ssize_t n = read(wake_.get(), &count, sizeof(count));
      return;
    }
    if (word < kConnections) {
      if (word - 1 < sockets_.size()) Accept(word - 1);
      return;
    }
    const auto stranger = strangers_.find(word - kConnections);
    if (stranger == strangers_.end()) return;
    if ((event.events & EPOLLHUP) != 0) return Drop(stranger);
    Greet(stranger, (event.events & EPOLLRDHUP) != 0);
  }

  // Reserves a descriptor, so that the last connection that can be accepted also gets its second
  // descriptor and is not lost.
  bool Reserve() {
    rlimit limit = {};
    // If the limit was lowered, a reserved number beyond it cannot be reused.
    if (reserve_.ok() && getrlimit(RLIMIT_NOFILE, &limit) == 0 &&
        static_cast<rlim_t>(reserve_.get()) >= limit.rlim_cur) {
      reserve_.Reset(-1);
    }
    if (!reserve_.ok()) reserve_.Reset(open("/dev/null", O_RDONLY | O_CLOEXEC));
    return reserve_.ok();
  }

  void Accept(size_t index) {
    const ListeningSocket& socket = sockets_[index];
    for (int i = 0; i < kAcceptsAtOnce; ++i) {
      if (refusals_ >= kRefusals && MustRest()) return Rest(index);
      if (!Reserve()) return Pause(std::strerror(errno));
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

  Descriptor Second(int descriptor) {
    Descriptor out(fcntl(descriptor, F_DUPFD_CLOEXEC, 0));
    if (out.ok() || (errno != EMFILE && errno != ENFILE)) return out;
    reserve_.Reset(-1);
    return Descriptor(fcntl(descriptor, F_DUPFD_CLOEXEC, 0));
  }

  // Takes an accepted connection. Returns: false if the listener pauses.
  bool Take(const ListeningSocket& socket, const SocketName& name, Descriptor connection) {
    Peer peer = PeerOf(name.address, name.length);
    const bool own = own_.Has(peer.name);
    Accepted accepted{.listening = socket.descriptor(), .tls = socket.address().tls};
    if (peer.unix_socket) {
      const absl::StatusOr<PeerCredentials> who = CredentialsOf(connection.get());
      if (!who.ok()) return true;  // the client has gone
      peer.address = absl::StrCat("user ", who->user);
      accepted.user = who->user;
      if (!own) {
        gate_.Log(Logger::Level::kInfo, "local connection", peer.name,
                  absl::StrCat("user ", who->user, ", process ", who->process));
      }
    }
    const absl::Status may = own ? absl::OkStatus() : guard_.MayEnter(peer);
    if (!may.ok()) {
      if (!accepted.tls && absl::IsResourceExhausted(may)) {
        constexpr std::string_view kAnswer = Greeting::kRefusal;
        send(connection.get(), kAnswer.data(), kAnswer.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
      }
      if (refusals_++ == 0) refusing_since_ = clock_.Now();
      return true;
    }
    if (!peer.unix_socket) {
      const int on = 1;
      setsockopt(connection.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
      const auto limit = static_cast<unsigned>(options_.send_limit_ns / sync::kMillisecond);
      setsockopt(connection.get(), IPPROTO_TCP, TCP_USER_TIMEOUT, &limit, sizeof(limit));
    }
    Descriptor second = Second(connection.get());
    if (!second.ok()) {
      Pause(std::strerror(errno));
      return false;
    }
    const absl::StatusOr<ConnectionId> id = watcher_->Add(peer, own, std::move(second));
    if (!id.ok()) {  // an unguarded connection would be worse than a refused one
      Pause(std::string(id.status().message()));
      return false;
    }
    if (peer.unix_socket) {
      if (!serve_(accepted, std::move(connection))) {
        gate_.Log(Logger::Level::kWarn, "connection refused", peer.name,
                  absl::StrCat(peer.address, " is one more than are known apart"));
      }
      return true;
    }
    const int descriptor = connection.get();
    const auto stranger =
        strangers_.try_emplace(*id, accepted, std::move(connection), guard_.most_first_message())
            .first;
    // Data that has already arrived triggers an edge as well.
    if (!Watch(descriptor, EPOLLIN | EPOLLRDHUP | EPOLLET, kConnections + *id)) Drop(stranger);
    return true;
  }

  // A TCP connection on which no call has begun.
  struct Stranger {
    Stranger(const Accepted& accepted, Descriptor connection, uint64_t most_message)
        : accepted(accepted), connection(std::move(connection)), greeting(most_message) {}
    Accepted accepted;
    Descriptor connection;
    Greeting greeting;
    bool answered = false;  // the daemon's SETTINGS were sent
  };
  using Strangers = std::map<ConnectionId, Stranger>;

  // Reads what has arrived. `over`: nothing more will arrive. The bytes stay in the socket for the
  // server.
  void Greet(Strangers::iterator at, bool over) {
    Stranger& stranger = at->second;
    const int descriptor = stranger.connection.get();
    int bytes = 0;
    Greeting::Verdict verdict = Greeting::Verdict::kMore;
    if (ioctl(descriptor, FIONREAD, &bytes) == 0 &&
        static_cast<size_t>(bytes) >= stranger.greeting.needed()) {
      std::array<char, Greeting::kMostBytes> buffer;
      const ssize_t n = recv(descriptor, buffer.data(), buffer.size(), MSG_PEEK | MSG_DONTWAIT);
      const std::string_view got(buffer.data(), static_cast<size_t>(std::max<ssize_t>(0, n)));
      if (n > 0) {
        verdict =
            stranger.accepted.tls ? stranger.greeting.ReadTls(got) : stranger.greeting.Read(got);
      }
    }
    switch (verdict) {
      case Greeting::Verdict::kWrong:
        guard_.OnWrongGreeting(at->first, stranger.greeting.why());
        return Drop(at);
      case Greeting::Verdict::kMore:
        if (over) return Drop(at);
        if (stranger.greeting.speaks_http2() && !std::exchange(stranger.answered, true)) {
          const std::string_view settings = Greeting::kServerSettings;
          send(descriptor, settings.data(), settings.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
        }
        return;
      case Greeting::Verdict::kCall:
        break;
    }
    epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, descriptor, nullptr);
    SocketWire::Narrow(descriptor);
    const Accepted accepted = stranger.accepted;
    Descriptor connection = std::move(stranger.connection);
    strangers_.erase(at);
    serve_(accepted, std::move(connection));
  }

  // Closes the connection. The guard's descriptor is closed when the watcher sees the end.
  void Drop(Strangers::iterator at) {
    const int descriptor = at->second.connection.get();
    epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, descriptor, nullptr);
    shutdown(descriptor, SHUT_RDWR);
    strangers_.erase(at);
  }

  bool MustRest() {
    if (clock_.Now() < refusing_since_ + kRefusalInterval) return true;
    refusals_ = 0;
    return false;
  }

  void Rest(size_t index) {
    rest_until_ = refusing_since_ + kRefusalInterval;
    resting_[index] = true;
    Change(sockets_[index].descriptor(), 0, 1 + index);
  }

  void EndRest() {
    rest_until_ = sync::kNever;
    refusals_ = 0;
    for (size_t i = 0; i < sockets_.size(); ++i) {
      if (resting_[i] && retry_ == sync::kNever) Change(sockets_[i].descriptor(), EPOLLIN, 1 + i);
    }
    resting_.assign(resting_.size(), false);
  }

  void Pause(const std::string& why) {
    counters_.NoteAcceptFailure(clock_.Now(), why);
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
      resting_[i] = false;
      Change(sockets_[i].descriptor(), EPOLLIN, 1 + i);
      if (!paused_) Accept(i);
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

  // Used by the listener's thread only.
  std::vector<ListeningSocket> sockets_;
  Strangers strangers_;
  Descriptor reserve_;
  sync::TimeNs retry_ = sync::kNever;
  bool paused_ = false;  // accepting failed again during Resume
  // Refusals since `refusing_since_`. Some addresses rest until `rest_until_`.
  int refusals_ = 0;
  sync::TimeNs refusing_since_ = 0, rest_until_ = sync::kNever;
  std::vector<bool> resting_;
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
