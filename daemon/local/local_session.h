// A stream's share of the local socket: its token and memory.
#pragma once

#include <memory>
#include <string>
#include <utility>

#include "daemon/core/core.h"
#include "daemon/local/local_socket.h"
#include "daemon/local/tokens.h"
#include "daemon/wire/memory_source.h"

namespace voxeld::daemon::local {

// Offers nothing if it was created without a socket. May outlive the socket. Not thread-safe, but
// the result of memory() is.
class LocalSession {
 public:
  LocalSession() = default;
  // `socket` may be null. Offers nothing if the system has no random bytes.
  LocalSession(const LocalSocket* socket, SessionId session);
  ~LocalSession() { Close(); }
  LocalSession(LocalSession&& other) noexcept { Swap(other); }
  LocalSession& operator=(LocalSession&& other) noexcept {
    Swap(other);
    return *this;
  }

  // Path for Opened; empty: nothing is offered.
  const std::string& path() const { return path_; }
  const std::string& token() const { return token_; }
  // Source for DecodeStreamRequest; null: nothing is offered. After Close it finds nothing.
  std::shared_ptr<const wire::MemorySource> memory() const { return memory_; }

  // The stream has left its session: ends the session's connection and releases its memory.
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
