#include "display/emulator/carriers/byte_stream.h"

#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>

namespace voxeld::display::emulator {
namespace {

constexpr int kSocketBytes = 8 << 20;

}  // namespace

ByteStream::ByteStream(int fd) : fd_(fd) {
  fcntl(fd_, F_SETFL, fcntl(fd_, F_GETFL) | O_NONBLOCK);
  // As large as the system allows; affects only throughput.
  setsockopt(fd_, SOL_SOCKET, SO_SNDBUF, &kSocketBytes, sizeof(kSocketBytes));
  setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &kSocketBytes, sizeof(kSocketBytes));
}

ByteStream::~ByteStream() { close(fd_); }

void ByteStream::Shutdown() {
  shutdown(fd_, SHUT_RDWR);
  open_ = false;
}

size_t ByteStream::Write(std::span<const std::byte> bytes) {
  size_t written = 0;
  while (open_ && written < bytes.size()) {
    const ssize_t n = send(fd_, bytes.data() + written, bytes.size() - written, MSG_NOSIGNAL);
    if (n > 0) {
      written += static_cast<size_t>(n);
    } else if (errno == EAGAIN) {
      break;
    } else if (errno != EINTR) {
      open_ = false;
    }
  }
  return written;
}

void ByteStream::Send(std::span<const std::byte> bytes) {
  if (!wants_to_send()) bytes = bytes.subspan(Write(bytes));
  if (!open_ || bytes.empty()) return;
  if (sent_ > out_.size() / 2) {
    out_.erase(out_.begin(), out_.begin() + static_cast<ptrdiff_t>(sent_));
    sent_ = 0;
  }
  out_.insert(out_.end(), bytes.begin(), bytes.end());
}

void ByteStream::SendWaiting() {
  sent_ += Write(std::span(out_).subspan(sent_));
  if (sent_ < out_.size()) return;
  out_.clear();
  sent_ = 0;
}

size_t ByteStream::Receive(std::span<std::byte> bytes) {
  while (open_ && !bytes.empty()) {
    const ssize_t n = recv(fd_, bytes.data(), bytes.size(), 0);
    if (n > 0) return static_cast<size_t>(n);
    if (n == 0 || (errno != EAGAIN && errno != EINTR)) open_ = false;
    if (n < 0 && errno == EAGAIN) break;
  }
  return 0;
}

}  // namespace voxeld::display::emulator
