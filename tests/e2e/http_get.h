// A minimal HTTP client for querying a daemon.
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

  // Requests `path`, and reads to the end of the connection.
  std::string Get(const std::string& path);

 private:
  const int fd_;
};

// The same from a server that may exit in the meantime; returns an empty string if it does.
std::string HttpGetIfThere(const std::string& address, const std::string& path);

// Returns head and body.
inline std::string HttpGet(const std::string& address, const std::string& path) {
  return HttpConnection(address).Get(path);
}

}  // namespace voxeld::e2e
