#include "tests/e2e/http_get.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include "absl/strings/str_cat.h"
#include "daemon/address/address.h"

namespace voxeld::e2e {

namespace {

int Connected(const std::string& address) {
  const auto parsed = daemon::ParseAddress(address);
  EXPECT_TRUE(parsed.ok()) << parsed.status();
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in name = {};
  name.sin_family = AF_INET;
  name.sin_port = htons(parsed->port);
  EXPECT_EQ(inet_pton(AF_INET, parsed->host.c_str(), &name.sin_addr), 1);
  const timeval limit = {60, 0};
  setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof(limit));
  if (connect(fd, reinterpret_cast<sockaddr*>(&name), sizeof(name)) == 0) return fd;
  close(fd);
  return -1;
}

// Returns the answer, as far as it arrived.
std::string Exchange(int fd, const std::string& path) {
  const std::string request =
      absl::StrCat("GET ", path, " HTTP/1.1\r\nHost: test\r\nConnection: close\r\n\r\n");
  if (send(fd, request.data(), request.size(), MSG_NOSIGNAL) < 0) return "";
  std::string answer;
  char buffer[4096];
  for (ssize_t n; (n = recv(fd, buffer, sizeof(buffer), 0)) > 0;) {
    answer.append(buffer, static_cast<size_t>(n));
  }
  return answer;
}

}  // namespace

HttpConnection::HttpConnection(const std::string& address) : fd_(Connected(address)) {
  EXPECT_GE(fd_, 0) << "no process listens on " << address;
}

HttpConnection::~HttpConnection() { close(fd_); }

std::string HttpConnection::Get(const std::string& path) { return Exchange(fd_, path); }

std::string HttpGetIfThere(const std::string& address, const std::string& path) {
  const int fd = Connected(address);
  if (fd < 0) return "";
  std::string answer = Exchange(fd, path);
  close(fd);
  return answer;
}

}  // namespace voxeld::e2e
