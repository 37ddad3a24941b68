// A non-blocking stream socket for carriers: bytes that cannot be sent yet wait here.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace voxeld::display::emulator {

class ByteStream {
 public:
  // Takes ownership of the descriptor, and makes it non-blocking.
  explicit ByteStream(int fd);
  ~ByteStream();
  ByteStream(const ByteStream&) = delete;
  ByteStream& operator=(const ByteStream&) = delete;

  int fd() const { return fd_; }
  bool open() const { return open_; }
  bool wants_to_send() const { return open_ && waiting() > 0; }
  // Returns the bytes that the peer has not accepted yet.
  size_t waiting() const { return out_.size() - sent_; }
  void Shutdown();

  // Sends at once what the socket accepts, and keeps the rest.
  void Send(std::span<const std::byte> bytes);
  void SendWaiting();
  // Reads available data into `bytes`; returns 0 if none is available, or the peer is gone.
  size_t Receive(std::span<std::byte> bytes);

 private:
  // Returns how many of the bytes were sent.
  size_t Write(std::span<const std::byte> bytes);

  const int fd_;
  bool open_ = true;
  std::vector<std::byte> out_;
  size_t sent_ = 0;  // bytes of out_
};

}  // namespace voxeld::display::emulator
