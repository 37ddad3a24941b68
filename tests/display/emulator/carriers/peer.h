// The other end of a carrier's socket, in the hands of a test.
#pragma once

#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

namespace voxeld::display::emulator {

using Bytes = std::vector<std::byte>;

// "00 01 ff" and, for longer runs, "00*24": twenty-four zeros. Throws for anything else.
Bytes Hex(std::string_view text);

class Peer {
 public:
  // One end of a socketpair.
  Peer();
  // A connection; takes it. There is no device end to take.
  explicit Peer(int fd) : fd_(fd) {}
  ~Peer();
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;

  // The device's end; once.
  int TakeDeviceEnd();
  int fd() const { return fd_; }
  // What the socket takes of it; never waits.
  size_t Send(std::span<const std::byte> bytes);
  // All that has come.
  Bytes Take();
  void Close();

 private:
  int fd_ = -1, device_ = -1;
};

}  // namespace voxeld::display::emulator
