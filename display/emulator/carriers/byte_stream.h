// A stream socket as carriers use it: nothing blocks, what cannot be sent yet waits here.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace voxeld::display::emulator {

class ByteStream {
 public:
  // Takes the descriptor, and makes it non-blocking.
  explicit ByteStream(int fd);
  ~ByteStream();
  ByteStream(const ByteStream&) = delete;
  ByteStream& operator=(const ByteStream&) = delete;

  int fd() const { return fd_; }
  bool open() const { return open_; }
  bool wants_to_send() const { return open_ && waiting() > 0; }
  // Bytes that the other side has not taken yet.
  size_t waiting() const { return out_.size() - sent_; }
  void Shutdown();

  // Sends at once what the socket takes.
  void Send(std::span<const std::byte> bytes);
  void SendWaiting();
  // Reads into `bytes` what is there; 0 when nothing is, or the other side is gone.
  size_t Receive(std::span<std::byte> bytes);

 private:
  // How many of them went out.
  size_t Write(std::span<const std::byte> bytes);

  const int fd_;
  bool open_ = true;
  std::vector<std::byte> out_;
  size_t sent_ = 0;  // of out_
};

}  // namespace voxeld::display::emulator
