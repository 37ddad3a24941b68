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

HttpConnection::HttpConnection(const std::string& address) {
  const auto parsed = daemon::ParseAddress(address);
  EXPECT_TRUE(parsed.ok()) << parsed.status();
  fd_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in name = {};
  name.sin_family = AF_INET;
  name.sin_port = htons(parsed->port);
  EXPECT_EQ(inet_pton(AF_INET, parsed->host.c_str(), &name.sin_addr), 1);
  EXPECT_EQ(connect(fd_, reinterpret_cast<sockaddr*>(&name), sizeof(name)), 0);
  const timeval limit = {60, 0};
  setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof(limit));
}

HttpConnection::~HttpConnection() { close(fd_); }

std::string HttpConnection::Get(const std::string& path) {
  const std::string request =
      absl::StrCat("GET ", path, " HTTP/1.1\r\nHost: test\r\nConnection: close\r\n\r\n");
  EXPECT_EQ(send(fd_, request.data(), request.size(), MSG_NOSIGNAL),
            static_cast<ssize_t>(request.size()));
  std::string answer;
  char buffer[4096];
  for (ssize_t n; (n = recv(fd_, buffer, sizeof(buffer), 0)) > 0;) {
    answer.append(buffer, static_cast<size_t>(n));
  }
  return answer;
}

}  // namespace voxeld::e2e
