// The socket through which a running emulator is told of faults and asked for what it saw.
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

// Single-threaded; nothing blocks.
class ControlSocket {
 public:
  // A unix socket at `path`, which is removed at the end. AlreadyExists if somebody listens there.
  static absl::StatusOr<std::unique_ptr<ControlSocket>> Listen(const std::string& path);
  ~ControlSocket();
  ControlSocket(const ControlSocket&) = delete;
  ControlSocket& operator=(const ControlSocket&) = delete;

  // What has to be polled, for reading.
  void AddTo(std::vector<pollfd>& fds) const;
  // Accepts, reads, and answers every whole line with `answer`'s.
  void Serve(absl::FunctionRef<std::string(std::string_view line)> answer);

 private:
  struct Peer {
    int fd = -1;
    std::string line;
  };
  ControlSocket(int fd, std::string path) : fd_(fd), path_(std::move(path)) {}
  // False: it has gone.
  static bool ServeOne(Peer& peer, absl::FunctionRef<std::string(std::string_view line)> answer);

  const int fd_;
  const std::string path_;
  std::list<Peer> peers_;
};

}  // namespace voxeld::emulator
