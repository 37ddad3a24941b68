// A relay between a client and a server on Unix sockets, which can fall silent while both
// connections stay open: this is how a peer looks when its machine has lost power.
#pragma once

#include <string>
#include <thread>
#include <vector>

namespace voxeld::client {

class Relay {
 public:
  // Listens at the path `here`, and forwards everything to and from the socket at `there`.
  Relay(const std::string& here, const std::string& there);
  ~Relay();
  Relay(const Relay&) = delete;
  Relay& operator=(const Relay&) = delete;

  // Once it has returned, nothing is forwarded, accepted or closed.
  void FallSilent();

 private:
  void Run();
  void Accept();

  const std::string there_;
  int listening_ = -1;
  int wake_[2] = {-1, -1};
  std::vector<std::pair<int, int>> carried_;  // from → to
  std::thread thread_;
};

}  // namespace voxeld::client
