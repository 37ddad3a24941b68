// A worker that the test plays by hand, behind a socket in place of a program: it receives what its
// owner sends, and sends what the test specifies, in the test's own thread.
#pragma once

#include <gtest/gtest.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <utility>

#include "gpu/bulk/segment.h"
#include "gpu/worker/message.h"

namespace voxeld::gpu {

class HandPlayedWorker {
 public:
  HandPlayedWorker() {
    folder_ = (std::filesystem::temp_directory_path() / "voxeld-worker-XXXXXX").string();
    EXPECT_NE(mkdtemp(folder_.data()), nullptr);
    sockaddr_un name = {};
    name.sun_family = AF_UNIX;
    std::strncpy(name.sun_path, path().c_str(), sizeof(name.sun_path) - 1);
    listening_ = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    EXPECT_EQ(bind(listening_, reinterpret_cast<sockaddr*>(&name), sizeof(name)), 0);
    EXPECT_EQ(listen(listening_, 8), 0);
  }
  ~HandPlayedWorker() {
    HangUp();
    close(listening_);
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  HandPlayedWorker(const HandPlayedWorker&) = delete;
  HandPlayedWorker& operator=(const HandPlayedWorker&) = delete;

  std::string program() const { return "unix:" + path(); }

  // Takes the connection of the engine that has been made, in place of the previous one.
  void Take() {
    HangUp();
    control_ = accept4(listening_, nullptr, nullptr, SOCK_CLOEXEC);
    ASSERT_GE(control_, 0);
    const absl::StatusOr<Message> message = ReceiveMessage(control_);
    ASSERT_TRUE(message.ok() && message->type == MessageType::kConnect && message->fd >= 0);
    connection_ = message->fd;
    const timeval patience = {.tv_sec = 30, .tv_usec = 0};
    setsockopt(connection_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
  }

  // Returns the next message; segments are kept and skipped.
  Message Hear() {
    for (;;) {
      absl::StatusOr<Message> message = ReceiveMessage(connection_);
      EXPECT_TRUE(message.ok()) << message.status();
      if (!message.ok()) return {};
      if (message->type == MessageType::kSegment) {
        const auto named = *message->As<SegmentMessage>();
        segments_[named.segment] = *Segment::Adopt(message->fd, named.size);
        continue;
      }
      if (message->fd >= 0) close(std::exchange(message->fd, -1));
      return *std::move(message);
    }
  }
  void Say(const Message& message) { EXPECT_TRUE(SendMessage(connection_, message).ok()); }
  void SayDone(const Message& asked, const absl::Status& status = absl::OkStatus()) {
    Say(MakeDone(asked.call, status));
  }
  std::span<std::byte> segment(uint32_t id) { return segments_.at(id)->bytes(); }

  void HangUp() {
    for (int* const end : {&connection_, &control_}) {
      if (*end >= 0) close(std::exchange(*end, -1));
    }
  }

 private:
  std::string path() const { return folder_ + "/socket"; }

  std::string folder_;
  int listening_ = -1, control_ = -1, connection_ = -1;
  std::map<uint32_t, std::shared_ptr<Segment>> segments_;
};

}  // namespace voxeld::gpu
