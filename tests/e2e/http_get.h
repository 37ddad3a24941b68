// Just enough HTTP to ask a daemon.
#pragma once

#include <string>

namespace voxeld::e2e {

// An open TCP connection; `address` is HOST:PORT with a number for a host.
class HttpConnection {
 public:
  explicit HttpConnection(const std::string& address);
  ~HttpConnection();
  HttpConnection(const HttpConnection&) = delete;
  HttpConnection& operator=(const HttpConnection&) = delete;

  // Asks for `path`, and reads to the end of the connection.
  std::string Get(const std::string& path);

 private:
  const int fd_;
};

// The same from a server that may end meanwhile; empty if it does.
std::string HttpGetIfThere(const std::string& address, const std::string& path);

// Head and body.
inline std::string HttpGet(const std::string& address, const std::string& path) {
  return HttpConnection(address).Get(path);
}

}  // namespace voxeld::e2e
