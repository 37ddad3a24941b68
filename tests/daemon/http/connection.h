// A connection on which tests send and receive bytes.
#pragma once

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <string>

#include "daemon/address/address.h"

namespace voxeld::daemon::http {

// A blocking connection; every read has its own deadline.
class Connection {
 public:
  explicit Connection(const Address& address) : fd_(Made(address.unix_socket)) { Connect(address); }
  Connection() : fd_(Made(false)) {}  // not connected yet
  // Connects from the local address `from`, for example "127.0.0.2".
  Connection(const Address& address, const char* from) : fd_(Made(false)) {
    sockaddr_in name = {};
    name.sin_family = AF_INET;
    inet_pton(AF_INET, from, &name.sin_addr);
    EXPECT_EQ(bind(fd_, reinterpret_cast<sockaddr*>(&name), sizeof(name)), 0);
    Connect(address);
  }
  ~Connection() { close(fd_); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  void Connect(const Address& address) {
    if (address.unix_socket) {
      sockaddr_un name = {};
      name.sun_family = AF_UNIX;
      std::memcpy(name.sun_path, address.path.c_str(), address.path.size());
      EXPECT_EQ(connect(fd_, reinterpret_cast<sockaddr*>(&name), sizeof(name)), 0);
    } else {
      sockaddr_in name = {};
      name.sin_family = AF_INET;
      name.sin_port = htons(address.port);
      inet_pton(AF_INET, address.host.c_str(), &name.sin_addr);
      EXPECT_EQ(connect(fd_, reinterpret_cast<sockaddr*>(&name), sizeof(name)), 0);
    }
  }

  void Send(const std::string& text) {
    EXPECT_EQ(send(fd_, text.data(), text.size(), MSG_NOSIGNAL), static_cast<ssize_t>(text.size()));
  }
  // Shuts down the sending side.
  void FinishSending() { EXPECT_EQ(shutdown(fd_, SHUT_WR), 0); }
  // Reads up to and including `end`, or to the end of the connection.
  std::string ReadTo(const std::string& end) {
    std::string text;
    char c = 0;
    while (!text.ends_with(end) && recv(fd_, &c, 1, 0) == 1) text += c;
    return text;
  }
  // Returns whether unread bytes, or the end of the connection, have arrived.
  bool Readable() const {
    pollfd socket = {.fd = fd_, .events = POLLIN, .revents = 0};
    return poll(&socket, 1, 0) != 0;
  }
  // Returns how much is accepted before the peer closes.
  size_t SendUntilClosed(const std::string& text) {
    size_t sent = 0;
    for (;;) {
      const ssize_t n = send(fd_, text.data(), text.size(), MSG_NOSIGNAL);
      if (n <= 0) return sent;
      sent += static_cast<size_t>(n);
    }
  }
  std::string ReadAll() {
    std::string text;
    char buffer[4096];
    for (ssize_t n; (n = recv(fd_, buffer, sizeof(buffer), 0)) > 0;) text.append(buffer, n);
    return text;
  }

 private:
  static int Made(bool unix_socket) {
    const int fd = socket(unix_socket ? AF_UNIX : AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const timeval limit = {30, 0};
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof(limit));
    return fd;
  }

  const int fd_;
};

}  // namespace voxeld::daemon::http
