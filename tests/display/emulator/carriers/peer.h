// The peer of a carrier's socket, controlled by a test.
#pragma once

#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

namespace voxeld::display::emulator {

using Bytes = std::vector<std::byte>;

// Parses "00 01 ff" and, for longer runs, "00*24": twenty-four zeros. Throws for anything else.
Bytes Hex(std::string_view text);

class Peer {
 public:
  // One end of a socketpair.
  Peer();
  // Takes ownership of a connection. It has no device end.
  explicit Peer(int fd) : fd_(fd) {}
  ~Peer();
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;

  // Returns the device's end; may be called once.
  int TakeDeviceEnd();
  int fd() const { return fd_; }
  // Returns how much of it the socket accepts; never blocks.
  size_t Send(std::span<const std::byte> bytes);
  // Returns everything that has arrived.
  Bytes Take();
  void Close();

 private:
  int fd_ = -1, device_ = -1;
};

}  // namespace voxeld::display::emulator
