// A WebSocket's connection: reads whole messages, writes one message at a time, and pings the
// client.
#pragma once

#include <chrono>
#include <functional>
#include <memory>

#include "daemon/http/connection_stream.h"
#include "daemon/http/http_server.h"
#include "daemon/http/web_socket.h"

namespace voxeld::daemon::http {

class WebSocketSession {
 public:
  virtual ~WebSocketSession() = default;
  virtual void Close() = 0;  // immediately
};

// Call on the server's thread. Answers `request`, an upgrade, and serves until either end closes or
// the client has not read a message within `message_limit`; then calls `closed` once. The session
// keeps itself alive while it is open.
std::shared_ptr<WebSocketSession> StartWebSocket(
    std::shared_ptr<boost::asio::io_context> io, ConnectionStream stream,
    const RequestMessage& request, std::chrono::nanoseconds message_limit,
    const std::function<std::unique_ptr<WebSocketService>(std::shared_ptr<WebSocketPeer>)>& serve,
    std::function<void(WebSocketSession*)> closed);

}  // namespace voxeld::daemon::http
