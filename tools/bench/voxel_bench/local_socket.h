// The producer's end of the local socket (voxeld/v1/local.proto): sealed memory is passed instead
// of bytes on the stream.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace voxeld::bench {

// Bound to one thread. Waits up to 10 s for each answer.
class LocalSocket {
 public:
  // Connects with Opened.local_socket and local_token.
  static absl::StatusOr<std::unique_ptr<LocalSocket>> Connect(const std::string& path,
                                                              const std::string& token);
  ~LocalSocket();
  LocalSocket(const LocalSocket&) = delete;
  LocalSocket& operator=(const LocalSocket&) = delete;

  // Puts `bytes` into new memory, seals it and passes it to the daemon. This process keeps no
  // reference to it.
  absl::Status Hold(uint64_t id, std::string_view bytes);
  // Sends the release immediately. The next Hold reads the daemon's answer, and fails if that is an
  // error.
  absl::Status Release(uint64_t id);

 private:
  explicit LocalSocket(int fd) : fd_(fd) {}
  // Sends a LocalMessage, with a descriptor unless `descriptor` is negative.
  absl::Status Say(const std::string& packet, int descriptor);
  // Waits for the answers to everything sent. Returns an error with the message if one is Refused.
  absl::Status Answered();

  const int fd_;
  int unanswered_ = 0;
};

}  // namespace voxeld::bench
