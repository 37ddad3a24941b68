// A small HTTP/1.1 server through which people and machines query the daemon. It serves GET and
// HEAD for a few paths, POST with bodies, and WebSockets (web_socket.h). It runs asynchronously on
// one thread and limits connections, request sizes and times.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "daemon/address/address.h"
#include "daemon/http/web_socket.h"
#include "display/sync/clock.h"

namespace voxeld::daemon::http {

struct Response {
  unsigned status = 200;
  std::string content_type = "text/plain; charset=utf-8";
  std::string body;
  std::vector<std::pair<std::string, std::string>> headers;  // in addition to the standard ones
};

// A GET, HEAD or POST request. Its views are valid during the call that receives it.
struct Request {
  std::string_view path;   // begins with '/', without the query
  std::string_view query;  // after '?'
  // Header fields; empty if absent.
  std::string_view host, origin, cookie, accept_encoding;
  bool head = false;  // the method is HEAD: the response is sent without its body
};

// Handles a path by calling `done` once, from any thread, at once or later. Returns: false if the
// path does not exist; `done` is then not called. Called on the server's thread; must not block.
using Done = std::function<void(Response)>;
using Handler = std::function<bool(const Request& request, Done done)>;

// Receives a request's body in pieces: on the server's thread, one call after another. Destroyed
// after the response, or when the request is aborted. Must not block.
class BodyReceiver {
 public:
  virtual ~BodyReceiver() = default;
  // Takes the next piece. Call `then` from any thread: with nothing to get the next piece, or with
  // a response to end the request. If it is not called within answer_limit_ns, the receiver is
  // destroyed as if the request had been aborted.
  virtual void Take(std::string piece, std::function<void(std::optional<Response>)> then) = 0;
  // The body is complete. Calls `done` once with the response, from any thread and within the same
  // time.
  virtual void Whole(Done done) = 0;
};

// The decision about a POST request.
struct Reception {
  std::unique_ptr<BodyReceiver> receiver;  // null: respond with `refusal`
  uint64_t max_bytes = 0;                  // larger bodies get 413
  Response refusal;
};

// Returns: how to receive a body at the request's path, or nothing to respond with 405. Called on
// the server's thread. Empty: no bodies are accepted.
using Receive = std::function<std::optional<Reception>(const Request& request)>;

// Returns: a function that serves a WebSocket request, or the reason for refusing it: NotFound
// (404), ResourceExhausted (503), else 403. Called on the server's thread. Empty: there are no
// WebSockets.
using ServeWebSocket =
    std::function<std::unique_ptr<WebSocketService>(std::shared_ptr<WebSocketPeer>)>;
using Upgrade = std::function<absl::StatusOr<ServeWebSocket>(const Request& request)>;

struct ServerOptions {
  Address listen;
  // Number of places. Requests, connections that are kept open after one, and WebSockets take a
  // place each. If no place is free, the connection that has been idle longest is closed, at the
  // address that has most idle ones; if all are active, the request is answered with 503. One
  // address has at most seven eighths of the places; unix sockets, which have no address, may have
  // all.
  uint32_t max_connections = 64;
  // These paths have kReservedPlaces of their own, so that health can always be read.
  std::vector<std::string> reserved_paths;
  uint32_t max_header_bytes = 8192;  // larger headers get 431
  // Limit on receiving a request and on sending a response.
  sync::TimeNs idle_limit_ns = 10 * sync::kSecond;
  sync::TimeNs answer_limit_ns = 5 * sync::kSecond;    // for the handler and the receiver; then 503
  sync::TimeNs message_limit_ns = 30 * sync::kSecond;  // for the client to read a WebSocket message
  // Minimum average rate of a body. In addition, each piece must arrive within idle_limit_ns.
  uint64_t body_bytes_per_s = 32 << 10;
  // Called on the server's thread when no connection can be accepted, because descriptors have run
  // out, for example. Accepting is retried; this is called again only after it has succeeded in
  // between. May be empty.
  std::function<void(const std::string& why)> accept_failed;
};

// Uses system time, because sockets support no other clock.
class Server {
 public:
  static constexpr size_t kReservedPlaces = 8;
  // A connection takes no place before its first request. If this many wait, the one that has
  // waited longest is closed when another arrives, but not before kFirstRequest.
  static constexpr size_t kMostWaiting = 1024;
  static constexpr sync::TimeNs kFirstRequest = 200 * sync::kMillisecond;

  // Errors: AlreadyExists if another server listens there.
  static absl::StatusOr<std::unique_ptr<Server>> Start(ServerOptions options, Handler handler,
                                                       Upgrade upgrade = nullptr,
                                                       Receive receive = nullptr);
  // Closes every connection and joins the thread; `done` functions may still be called afterwards.
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  const Address& address() const;  // with the chosen port

 private:
  class Impl;
  explicit Server(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld::daemon::http
