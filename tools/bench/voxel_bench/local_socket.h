// The producer's end of the local socket (voxeld/v1/local.proto): sealed memory handed over in
// place of bytes on the stream.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace voxeld::bench {

// Bound to one thread. Waits for each answer, for at most 10 s.
class LocalSocket {
 public:
  // With Opened.local_socket and local_token.
  static absl::StatusOr<std::unique_ptr<LocalSocket>> Connect(const std::string& path,
                                                              const std::string& token);
  ~LocalSocket();
  LocalSocket(const LocalSocket&) = delete;
  LocalSocket& operator=(const LocalSocket&) = delete;

  // Puts `bytes` into new memory, seals it and hands it over. This process keeps nothing of it.
  absl::Status Hold(uint64_t id, std::string_view bytes);
  // Said at once; what the daemon answers is read by the next Hold, which fails if that is an error.
  absl::Status Release(uint64_t id);

 private:
  explicit LocalSocket(int fd) : fd_(fd) {}
  // Sends a LocalMessage, with a descriptor unless that is below 0.
  absl::Status Say(const std::string& packet, int descriptor);
  // Waits for the answers to all that was said; an error with what it said if one is Refused.
  absl::Status Answered();

  const int fd_;
  int unanswered_ = 0;
};

}  // namespace voxeld::bench
