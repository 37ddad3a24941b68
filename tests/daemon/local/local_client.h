// A client of the local socket, as a producer would have it.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/address/descriptor.h"
#include "voxeld/v1/local.pb.h"

namespace voxeld::daemon::local {

inline constexpr int kAllSeals = F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_WRITE;

// Returns a memfd that holds `bytes`, with these seals.
inline Descriptor MakeMemfd(std::string_view bytes, int seals = kAllSeals) {
  Descriptor fd(memfd_create("voxeld-test", MFD_CLOEXEC | MFD_ALLOW_SEALING));
  EXPECT_GE(fd.get(), 0) << std::strerror(errno);
  EXPECT_EQ(write(fd.get(), bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
  EXPECT_EQ(fcntl(fd.get(), F_ADD_SEALS, seals), 0) << std::strerror(errno);
  return fd;
}

inline v1::LocalMessage HelloMessage(const std::string& token) {
  v1::LocalMessage message;
  message.mutable_hello()->set_token(token);
  return message;
}

inline v1::LocalMessage MemoryMessage(uint64_t id, uint64_t size) {
  v1::LocalMessage message;
  message.mutable_memory()->set_id(id);
  message.mutable_memory()->set_size(size);
  return message;
}

inline v1::LocalMessage ReleaseMessage(uint64_t id) {
  v1::LocalMessage message;
  message.mutable_release()->set_id(id);
  return message;
}

class LocalClient {
 public:
  explicit LocalClient(const std::string& path)
      : socket_(socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0)) {
    sockaddr_un name = {};
    name.sun_family = AF_UNIX;
    EXPECT_LT(path.size(), sizeof(name.sun_path));
    std::memcpy(name.sun_path, path.data(), path.size());
    EXPECT_EQ(connect(socket_.get(), reinterpret_cast<const sockaddr*>(&name), sizeof(name)), 0)
        << std::strerror(errno);
  }

  // Returns false if it would have had to wait, or if the server has closed the connection.
  bool SendBytes(std::string_view bytes, const std::vector<int>& fds = {}) {
    iovec part = {const_cast<char*>(bytes.data()), bytes.size()};
    msghdr header = {};
    header.msg_iov = &part;
    header.msg_iovlen = 1;
    alignas(cmsghdr) char control[CMSG_SPACE(64 * sizeof(int))] = {};
    if (!fds.empty()) {
      header.msg_control = control;
      header.msg_controllen = CMSG_SPACE(fds.size() * sizeof(int));
      cmsghdr* rights = CMSG_FIRSTHDR(&header);
      rights->cmsg_level = SOL_SOCKET;
      rights->cmsg_type = SCM_RIGHTS;
      rights->cmsg_len = CMSG_LEN(fds.size() * sizeof(int));
      std::memcpy(CMSG_DATA(rights), fds.data(), fds.size() * sizeof(int));
    }
    return sendmsg(socket_.get(), &header, MSG_NOSIGNAL | MSG_DONTWAIT) >= 0;
  }

  bool Send(const v1::LocalMessage& message, const std::vector<int>& fds = {}) {
    return SendBytes(message.SerializeAsString(), fds);
  }

  // Returns the next answer; nullopt once the server has closed, or after a generous time (a
  // failure).
  std::optional<v1::LocalAnswer> Read() {
    pollfd ready = {socket_.get(), POLLIN, 0};
    if (poll(&ready, 1, 30'000) != 1) {
      ADD_FAILURE() << "no answer in 30 s";
      return {};
    }
    char buffer[4096];
    const ssize_t got = recv(socket_.get(), buffer, sizeof(buffer), 0);
    if (got <= 0) return {};
    v1::LocalAnswer answer;
    EXPECT_TRUE(answer.ParseFromArray(buffer, static_cast<int>(got)));
    return answer;
  }

  // Returns whether an answer has arrived.
  bool CanRead() const {
    pollfd ready = {socket_.get(), POLLIN, 0};
    return poll(&ready, 1, 0) == 1;
  }

  v1::LocalAnswer Call(const v1::LocalMessage& message, const std::vector<int>& fds = {}) {
    EXPECT_TRUE(Send(message, fds)) << std::strerror(errno);
    const std::optional<v1::LocalAnswer> answer = Read();
    EXPECT_TRUE(answer.has_value()) << "the server has closed";
    return answer.value_or(v1::LocalAnswer());
  }

  v1::LocalAnswer Hello(const std::string& token) { return Call(HelloMessage(token)); }

  // When this returns, the server has handled everything that it had received before.
  void RoundTrips() {
    for (int i = 0; i < 6; ++i) EXPECT_TRUE(Call(ReleaseMessage(~uint64_t{0})).has_refused());
  }

  int socket_fd() const { return socket_.get(); }

 private:
  Descriptor socket_;
};

inline int OpenDescriptors() {
  int count = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    ++count;
  }
  return count;
}

}  // namespace voxeld::daemon::local
