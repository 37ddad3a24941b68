// A small HTTP/1.1 server for people's and machines' questions about the daemon: GET and HEAD of a
// few paths, POST of bodies that somebody takes, and WebSockets (web_socket.h); one thread, asynchronous, bounded in
// connections, request size and time.
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
  std::vector<std::pair<std::string, std::string>> headers;  // beside those that all have
};

// Of a GET, HEAD or POST; what it points to lives as long as the call that it is given to.
struct Request {
  std::string_view path;   // begins with '/', without the query
  std::string_view query;  // behind '?'
  // Headers; empty: it has none.
  std::string_view host, origin, cookie, accept_encoding;
  bool head = false;  // the method is HEAD: the response is sent without its body
};

// Answers a path by calling `done` once, from any thread, at once or later. False: there is no such
// path, and `done` will not be called. Called on the server's thread; must not block.
using Done = std::function<void(Response)>;
using Handler = std::function<bool(const Request& request, Done done)>;

// Takes a request's body as it comes: on the server's thread, one call after another, until it goes. It goes when all is
// answered, or when the request was broken off. Must not block.
class BodyReceiver {
 public:
  virtual ~BodyReceiver() = default;
  // The next piece; another comes once `then` has been called, from any thread: with an answer, no other comes and that is
  // answered. Who does not call it within answer_limit_ns goes, as if the request was broken off.
  virtual void Take(std::string piece, std::function<void(std::optional<Response>)> then) = 0;
  // All of it has come. Answers by calling `done` once, from any thread, and as soon.
  virtual void Whole(Done done) = 0;
};

// What becomes of a POST.
struct Reception {
  std::unique_ptr<BodyReceiver> receiver;  // none: the answer is `refusal`
  uint64_t max_bytes = 0;                  // 413 beyond
  Response refusal;
};

// Whether bodies are taken at the request's path; nothing: they are not, and POST is answered with 405. Called on the server's
// thread. Empty: there are none.
using Receive = std::function<std::optional<Reception>(const Request& request)>;

// Serves a request for a WebSocket, or says why not: NotFound, ResourceExhausted (503), else 403. Called on the
// server's thread. Empty: there are none.
using ServeWebSocket =
    std::function<std::unique_ptr<WebSocketService>(std::shared_ptr<WebSocketPeer>)>;
using Upgrade = std::function<absl::StatusOr<ServeWebSocket>(const Request& request)>;

struct ServerOptions {
  Address listen;
  // Number of places. Requests, connections that are kept open after one, and WebSockets take a place each. If none is free, the
  // connection that has been idle longest is closed, of the address that has most idle ones; if all are at work, the request is
  // answered with 503. One address has at most seven eighths of the places; unix sockets, which have no address, may have all.
  uint32_t max_connections = 64;
  // These paths have kReservedPlaces of their own, so that health can always be read.
  std::vector<std::string> reserved_paths;
  uint32_t max_header_bytes = 8192;  // 431 beyond
  // For a request to come in, and for an answer to be read.
  sync::TimeNs idle_limit_ns = 10 * sync::kSecond;
  sync::TimeNs answer_limit_ns = 5 * sync::kSecond;    // for handler and receiver; then 503
  sync::TimeNs message_limit_ns = 30 * sync::kSecond;  // for a WebSocket's message to be read
  // Of a body that is taken something has to come within idle_limit_ns, and so much on the whole, counted from there.
  uint64_t body_bytes_per_s = 32 << 10;
  // No connection can be accepted, out of descriptors say: it is tried again until one is, and told once until then. On the
  // server's thread. May be empty.
  std::function<void(const std::string& why)> accept_failed;
};

// Times are the system's: sockets know no other.
class Server {
 public:
  static constexpr size_t kReservedPlaces = 8;
  // A connection takes no place before its first request. If so many wait, the one that has waited longest is closed for the next
  // one, but not before it has had kFirstRequest.
  static constexpr size_t kMostWaiting = 1024;
  static constexpr sync::TimeNs kFirstRequest = 200 * sync::kMillisecond;

  // AlreadyExists if somebody listens there.
  static absl::StatusOr<std::unique_ptr<Server>> Start(ServerOptions options, Handler handler,
                                                       Upgrade upgrade = nullptr,
                                                       Receive receive = nullptr);
  // Closes every connection and joins the thread; `done` functions may be called later still.
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  const Address& address() const;  // with the port that was chosen

 private:
  class Impl;
  explicit Server(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld::daemon::http
