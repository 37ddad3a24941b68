// What a stream holds of the local socket: its token and memory.
#pragma once

#include <memory>
#include <string>
#include <utility>

#include "daemon/core/core.h"
#include "daemon/local/local_socket.h"
#include "daemon/local/tokens.h"
#include "daemon/wire/memory_source.h"

namespace voxeld::daemon::local {

// Nothing is offered by one that was made without a socket. May outlive the socket. Not thread-safe;
// what memory() gave is.
class LocalSession {
 public:
  LocalSession() = default;
  // `socket` may be none. Without random bytes nothing is offered either.
  LocalSession(const LocalSocket* socket, SessionId session);
  ~LocalSession() { Close(); }
  LocalSession(LocalSession&& other) noexcept { Swap(other); }
  LocalSession& operator=(LocalSession&& other) noexcept {
    Swap(other);
    return *this;
  }

  // For Opened; empty: nothing is offered.
  const std::string& path() const { return path_; }
  const std::string& token() const { return token_; }
  // For DecodeStreamRequest; null: nothing is offered. After Close it finds nothing.
  std::shared_ptr<const wire::MemorySource> memory() const { return memory_; }

  // The stream has let its session go: so its connection ends, and its memory is let go.
  void Close();

 private:
  void Swap(LocalSession& other) {
    std::swap(tokens_, other.tokens_);
    std::swap(path_, other.path_);
    std::swap(token_, other.token_);
    std::swap(memory_, other.memory_);
  }

  std::shared_ptr<Tokens> tokens_;  // null: nothing is registered
  std::string path_, token_;
  std::shared_ptr<LocalMemory> memory_;
};

}  // namespace voxeld::daemon::local
