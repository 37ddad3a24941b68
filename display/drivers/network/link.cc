#include "display/drivers/network/link.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <optional>
#include <thread>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "display/sync/mutex.h"

namespace voxeld::display::network {
namespace {

// How much of a stream may wait in the kernel: more would only be late.
constexpr int kSendBuffer = 128 << 10;

struct Address {
  sockaddr_storage storage{};
  socklen_t size = 0;
  int family() const { return storage.ss_family; }
};

std::optional<Address> AddressOf(const Endpoint& endpoint) {
  Address address;
  sockaddr_in v4{};
  sockaddr_in6 v6{};
  if (inet_pton(AF_INET, endpoint.host.c_str(), &v4.sin_addr) == 1) {
    v4.sin_family = AF_INET;
    v4.sin_port = htons(endpoint.port);
    std::memcpy(&address.storage, &v4, sizeof(v4));
    address.size = sizeof(v4);
    return address;
  }
  if (inet_pton(AF_INET6, endpoint.host.c_str(), &v6.sin6_addr) == 1) {
    v6.sin6_family = AF_INET6;
    v6.sin6_port = htons(endpoint.port);
    std::memcpy(&address.storage, &v6, sizeof(v6));
    address.size = sizeof(v6);
    return address;
  }
  return std::nullopt;
}

absl::Status Failed(const Endpoint& to, const char* what, int error) {
  return absl::UnavailableError(absl::StrCat(to.text(), ": ", what, ": ", std::strerror(error)));
}

class Socket {
 public:
  Socket() = default;
  ~Socket() { Close(); }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;

  absl::Status Open(const Endpoint& to, int type) {
    Close();
    const std::optional<Address> address = AddressOf(to);
    if (!address) return absl::InvalidArgumentError(absl::StrCat(to.host, " is no address"));
    fd_ = socket(address->family(), type | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd_ < 0) return Failed(to, "socket", errno);
    if (type == SOCK_STREAM) {
      const int on = 1;
      setsockopt(fd_, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
      setsockopt(fd_, SOL_SOCKET, SO_SNDBUF, &kSendBuffer, sizeof(kSendBuffer));
    }
    if (connect(fd_, reinterpret_cast<const sockaddr*>(&address->storage), address->size) != 0 &&
        errno != EINPROGRESS) {
      const int error = errno;
      Close();
      return Failed(to, "connect", error);
    }
    return absl::OkStatus();
  }
  void Close() {
    if (fd_ >= 0) close(fd_);
    fd_ = -1;
  }
  int fd() const { return fd_; }
  // Returns the error that the kernel noted since the last call; 0: none.
  int TakeError() const {
    int error = 0;
    socklen_t size = sizeof(error);
    return getsockopt(fd_, SOL_SOCKET, SO_ERROR, &error, &size) == 0 ? error : errno;
  }

 private:
  int fd_ = -1;
};

// Sends no more bytes than fit; returns 0 if the socket is full.
absl::StatusOr<size_t> SendOn(const Socket& socket, const Endpoint& to,
                              std::span<const std::byte> bytes) {
  const ssize_t sent = send(socket.fd(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
  if (sent >= 0) return static_cast<size_t>(sent);
  if (errno == EAGAIN || errno == EWOULDBLOCK || errno == ENOBUFS || errno == EINTR) return 0;
  return Failed(to, "send", errno);
}

class UdpLink final : public Link {
 public:
  explicit UdpLink(Endpoint to) : to_(std::move(to)) {}

  absl::Status Open() override { return socket_.Open(to_, SOCK_DGRAM); }
  void Close() override { socket_.Close(); }
  absl::StatusOr<State> Poll() override {
    if (socket_.fd() < 0) return State::kClosed;
    if (const int error = socket_.TakeError(); error != 0) return Failed(to_, "sent to", error);
    return State::kOpen;
  }
  absl::StatusOr<size_t> Send(std::span<const std::byte> bytes) override {
    return SendOn(socket_, to_, bytes);
  }
  void SetWake(std::function<void()> /*wake*/) override {}

 private:
  const Endpoint to_;
  Socket socket_;
};

class TcpLink final : public Link {
 public:
  explicit TcpLink(Endpoint to) : to_(std::move(to)) {}
  ~TcpLink() override { Close(); }

  absl::Status Open() override {
    Close();
    if (absl::Status status = socket_.Open(to_, SOCK_STREAM); !status.ok()) return status;
    event_ = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    if (event_ < 0) {
      const int error = errno;
      socket_.Close();
      return Failed(to_, "eventfd", error);
    }
    connected_ = false;
    {
      sync::MutexLock lock(mutex_);
      ends_ = false;
    }
    Watch(true);
    thread_ = std::thread([this] { Run(); });
    return absl::OkStatus();
  }

  void Close() override {
    if (thread_.joinable()) {
      {
        sync::MutexLock lock(mutex_);
        ends_ = true;
      }
      Stir();
      thread_.join();
    }
    if (event_ >= 0) close(event_);
    event_ = -1;
    socket_.Close();
  }

  absl::StatusOr<State> Poll() override {
    if (socket_.fd() < 0) return State::kClosed;
    if (const int error = socket_.TakeError(); error != 0) return Failed(to_, "connection", error);
    if (!connected_) {
      pollfd now{socket_.fd(), POLLOUT, 0};
      connected_ = poll(&now, 1, 0) == 1 && (now.revents & POLLOUT) != 0;
      if (!connected_) return State::kOpening;
    }
    // The controller sends nothing; any reply means that the connection ended.
    char byte = 0;
    const ssize_t got = recv(socket_.fd(), &byte, 1, MSG_DONTWAIT);
    if (got == 0) return absl::UnavailableError(absl::StrCat(to_.text(), ": it hung up"));
    if (got < 0 && errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR) {
      return Failed(to_, "connection", errno);
    }
    return State::kOpen;
  }

  absl::StatusOr<size_t> Send(std::span<const std::byte> bytes) override {
    absl::StatusOr<size_t> sent = SendOn(socket_, to_, bytes);
    if (sent.ok() && *sent < bytes.size()) Watch(true);
    return sent;
  }

  void SetWake(std::function<void()> wake) override {
    sync::MutexLock lock(mutex_);
    wake_ = std::move(wake);
  }

 private:
  // Watches the socket for a hang-up and, with `room`, for room to send.
  void Watch(bool room) {
    {
      sync::MutexLock lock(mutex_);
      wants_room_ = room;
    }
    Stir();
  }
  void Stir() const {
    const uint64_t one = 1;
    // If the write fails, an earlier one is still unread: the thread is already awake.
    [[maybe_unused]] const ssize_t written = write(event_, &one, sizeof(one));
  }

  void Run() {
    bool hung_up = false;
    while (true) {
      bool room = false;
      {
        sync::MutexLock lock(mutex_);
        if (ends_) return;
        room = wants_room_;
      }
      // A hang-up is reported once.
      const short events = static_cast<short>((room ? POLLOUT : 0) | POLLRDHUP);
      pollfd fds[2] = {{event_, POLLIN, 0}, {hung_up ? -1 : socket_.fd(), events, 0}};
      if (poll(fds, 2, -1) < 0 && errno != EINTR) return;
      uint64_t count = 0;
      [[maybe_unused]] const ssize_t got = read(event_, &count, sizeof(count));
      if (fds[1].revents == 0) continue;
      hung_up = (fds[1].revents & (POLLRDHUP | POLLHUP | POLLERR)) != 0;
      sync::MutexLock lock(mutex_);
      wants_room_ = false;
      if (wake_) wake_();
    }
  }

  const Endpoint to_;
  Socket socket_;
  bool connected_ = false;
  int event_ = -1;
  std::thread thread_;
  sync::Mutex mutex_;
  bool wants_room_ VOXELD_GUARDED_BY(mutex_) = false;
  bool ends_ VOXELD_GUARDED_BY(mutex_) = false;
  std::function<void()> wake_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace

std::string Endpoint::text() const {
  return host.find(':') == std::string::npos ? absl::StrCat(host, ":", port)
                                             : absl::StrCat("[", host, "]:", port);
}

absl::StatusOr<Endpoint> ParseEndpoint(const std::string& text, uint16_t fallback) {
  Endpoint endpoint{text, fallback};
  std::string port;
  if (!text.empty() && text.front() == '[') {
    const size_t end = std::min(text.find(']'), text.size());
    endpoint.host = end < text.size() ? text.substr(1, end - 1) : "";
    port = text.substr(std::min(end + 1, text.size()));
  } else if (const size_t colon = text.find(':');
             colon != std::string::npos && text.find(':', colon + 1) == std::string::npos) {
    endpoint.host = text.substr(0, colon);
    port = text.substr(colon);
  }
  int number = fallback;
  const bool port_ok =
      port.empty() || (port.front() == ':' && absl::SimpleAtoi(port.substr(1), &number) &&
                       number > 0 && number <= UINT16_MAX);
  if (!port_ok || !AddressOf(endpoint)) {
    return absl::InvalidArgumentError(
        "an address in numbers, with a port or without: 192.168.1.20, 192.168.1.20:4048, "
        "[fd00::20]:4048");
  }
  endpoint.port = static_cast<uint16_t>(number);
  return endpoint;
}

std::unique_ptr<Link> MakeUdpLink(const Endpoint& to) { return std::make_unique<UdpLink>(to); }
std::unique_ptr<Link> MakeTcpLink(const Endpoint& to) { return std::make_unique<TcpLink>(to); }

}  // namespace voxeld::display::network
