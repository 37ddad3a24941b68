// A relay between a client and a server on unix sockets, which can fall silent while both connections
// stay open: the other end as it looks when its machine has gone.
#pragma once

#include <string>
#include <thread>
#include <vector>

namespace voxeld::client {

class Relay {
 public:
  // Listens at the path `here`, and carries everything to and from the one at `there`.
  Relay(const std::string& here, const std::string& there);
  ~Relay();
  Relay(const Relay&) = delete;
  Relay& operator=(const Relay&) = delete;

  // From when it returns on nothing is carried, nothing accepted, and nothing closed.
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
