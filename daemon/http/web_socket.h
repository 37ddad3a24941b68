// A WebSocket (RFC 6455) of the http port, from its upgrade on. Not compressed.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

namespace voxeld::daemon::http {

// The server's end, for whoever serves it. Thread-safe; keeps nothing alive but itself.
class WebSocketPeer {
 public:
  virtual ~WebSocketPeer() = default;
  // In the order of the calls. Dropped once it is closed. While more than a megabyte waits nothing is read: serve by
  // what the other end asks for, a bounded number of answers for each message.
  virtual void Send(std::string message, bool binary) = 0;
  // Calls `what` on the server's thread, unless it is closed by then: for answers that come elsewhere.
  virtual void Post(std::function<void()> what) = 0;
  // After what was sent before; `why` is told to the other end, 123 bytes at most.
  virtual void Close(std::string why) = 0;
};

// What serves it: on the server's thread, one call after another, until OnClosed or the server's end. Must not block.
class WebSocketService {
 public:
  virtual ~WebSocketService() = default;
  // Whole messages of text, UTF-8 and at most kGreatestMessage bytes; others end the connection.
  virtual void OnText(std::string message) = 0;
};

inline constexpr uint64_t kGreatestMessage = 16384;

}  // namespace voxeld::daemon::http
