// A WebSocket (RFC 6455) of the HTTP port after its upgrade, without compression.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

namespace voxeld::daemon::http {

// The server's end of a WebSocket, used by the service. Thread-safe; keeps only itself alive.
class WebSocketPeer {
 public:
  virtual ~WebSocketPeer() = default;
  // Sends messages in the order of the calls; drops them once the socket is closed. Reading is
  // suspended while more than a megabyte is queued, so a service should send only in response to
  // messages, and a bounded number for each.
  virtual void Send(std::string message, bool binary) = 0;
  // Calls `what` on the server's thread unless the socket is closed by then. Use it for results
  // from other threads.
  virtual void Post(std::function<void()> what) = 0;
  // Closes the socket after the messages sent so far. `why` is sent to the client, at most 123
  // bytes.
  virtual void Close(std::string why) = 0;
};

// Serves a WebSocket: called on the server's thread, one call after another, until OnClosed or the
// end of the server. Must not block.
class WebSocketService {
 public:
  virtual ~WebSocketService() = default;
  // Receives a complete text message: UTF-8, at most kGreatestMessage bytes. Other messages close
  // the connection.
  virtual void OnText(std::string message) = 0;
};

inline constexpr uint64_t kGreatestMessage = 16384;

}  // namespace voxeld::daemon::http
