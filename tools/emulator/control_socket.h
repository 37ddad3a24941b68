// The socket through which a running emulator receives faults and reports its status.
#pragma once

#include <list>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"

struct pollfd;

namespace voxeld::emulator {

// Single-threaded and non-blocking.
class ControlSocket {
 public:
  // Listens on a unix socket at `path`, which is removed on destruction. Errors: AlreadyExists if
  // another process listens there.
  static absl::StatusOr<std::unique_ptr<ControlSocket>> Listen(const std::string& path);
  ~ControlSocket();
  ControlSocket(const ControlSocket&) = delete;
  ControlSocket& operator=(const ControlSocket&) = delete;

  // Adds the descriptors to poll for reading.
  void AddTo(std::vector<pollfd>& fds) const;
  // Accepts connections, reads, and answers every complete line with the result of `answer`.
  void Serve(absl::FunctionRef<std::string(std::string_view line)> answer);

 private:
  struct Peer {
    int fd = -1;
    std::string line;
  };
  ControlSocket(int fd, std::string path) : fd_(fd), path_(std::move(path)) {}
  // Returns false if the peer has disconnected.
  static bool ServeOne(Peer& peer, absl::FunctionRef<std::string(std::string_view line)> answer);

  const int fd_;
  const std::string path_;
  std::list<Peer> peers_;
};

}  // namespace voxeld::emulator
