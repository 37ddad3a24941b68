#include "tests/client/cpp/relay.h"

#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>

namespace voxeld::client {
namespace {

sockaddr_un AddressOf(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  EXPECT_LT(path.size(), sizeof(address.sun_path));
  path.copy(address.sun_path, sizeof(address.sun_path) - 1);
  return address;
}

int NewSocket() { return socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0); }

// Returns false at the end of the stream.
bool Carry(int from, int to) {
  std::array<char, 65536> bytes;
  const ssize_t size = read(from, bytes.data(), bytes.size());
  for (ssize_t done = 0; done < size;) {
    const ssize_t sent =
        send(to, bytes.data() + done, static_cast<size_t>(size - done), MSG_NOSIGNAL);
    if (sent <= 0) return false;
    done += sent;
  }
  return size > 0;
}

}  // namespace

Relay::Relay(const std::string& here, const std::string& there) : there_(there) {
  listening_ = NewSocket();
  const sockaddr_un address = AddressOf(here);
  EXPECT_EQ(bind(listening_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  EXPECT_EQ(listen(listening_, 16), 0);
  EXPECT_EQ(pipe(wake_), 0);
  thread_ = std::thread([this] { Run(); });
}

Relay::~Relay() {
  if (thread_.joinable()) FallSilent();
  for (const auto& [from, to] : carried_) close(from);
  for (const int fd : {listening_, wake_[0], wake_[1]}) close(fd);
}

void Relay::FallSilent() {
  EXPECT_EQ(write(wake_[1], "x", 1), 1);
  thread_.join();
}

void Relay::Accept() {
  const int near = accept(listening_, nullptr, nullptr);
  const int far = NewSocket();
  const sockaddr_un address = AddressOf(there_);
  if (connect(far, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    close(near);
    close(far);
    return;
  }
  carried_.emplace_back(near, far);
  carried_.emplace_back(far, near);
}

void Relay::Run() {
  std::vector<pollfd> waited;
  for (;;) {
    waited = {{wake_[0], POLLIN, 0}, {listening_, POLLIN, 0}};
    for (const auto& [from, to] : carried_) waited.push_back({from, POLLIN, 0});
    if (poll(waited.data(), waited.size(), -1) < 0 || waited[0].revents != 0) return;
    std::vector<std::pair<int, int>> over;
    for (size_t i = 2; i < waited.size(); ++i) {
      if (waited[i].revents != 0 && !Carry(carried_[i - 2].first, carried_[i - 2].second))
        over.push_back(carried_[i - 2]);
    }
    for (const auto& [from, to] : over) {
      const auto with = [from = from, to = to](const auto& pair) {
        return pair.first == from || pair.first == to;
      };
      if (std::erase_if(carried_, with) == 0) continue;  // both directions ended at once
      close(from);
      close(to);
    }
    if (waited[1].revents != 0) Accept();
  }
}

}  // namespace voxeld::client
