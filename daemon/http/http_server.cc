#include "daemon/http/http_server.h"

#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <boost/asio/basic_socket_acceptor.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/local/stream_protocol.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <exception>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "daemon/http/body_session.h"
#include "daemon/http/connection_stream.h"
#include "daemon/http/response_message.h"
#include "daemon/http/web_socket_session.h"
#include "daemon/listen/peer.h"

namespace voxeld::daemon::http {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace wire = boost::beast::http;
using Acceptor = asio::basic_socket_acceptor<Protocol, asio::io_context::executor_type>;
using Stream = ConnectionStream;
using Parser = wire::request_parser<wire::string_body>;
using boost::system::error_code;

constexpr auto kAcceptRetry = std::chrono::milliseconds(100);
constexpr auto kAcceptSoon = std::chrono::milliseconds(20);
constexpr uint64_t kGreatestBody = 4096;  // read and discarded
constexpr mode_t kSocketMode = 0660;

Response Plain(unsigned status, std::string text) { return PlainResponse(status, std::move(text)); }

std::string_view View(boost::beast::string_view text) { return {text.data(), text.size()}; }

// Returns: the address of the client without the port; empty for a unix socket, and if the client has gone.
std::string AddressOf(const Stream::socket_type& socket) {
  error_code error;
  const auto endpoint = socket.remote_endpoint(error);
  sockaddr_storage address = {};
  if (error || endpoint.size() > sizeof(address)) return "";
  std::memcpy(&address, endpoint.data(), endpoint.size());
  if (address.ss_family == AF_UNIX) return "";
  return listen::PeerOf(address, static_cast<socklen_t>(endpoint.size())).address;
}

// The handlers, and the owners of connections that Connection itself does not serve.
class Connection;

struct Served {
  const Handler handler;
  const Upgrade upgrade;
  const Receive receive;
  // Assigns a place to a connection whose request has this path; if none is free, an idle connection is closed. Returns: the reason
  // if there is no place; nothing if the connection has one.
  std::function<std::optional<std::string>(Connection&, std::string_view path)> refused;
  std::function<void(Stream, const RequestMessage&, const ServeWebSocket&)> upgraded;
  std::function<void(Stream, beast::flat_buffer, std::unique_ptr<BodyParser>, Reception)> received;
};

class Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(std::shared_ptr<asio::io_context> io, Stream::socket_type socket,
             const ServerOptions& options, const Served& served,
             std::function<void(Connection*)> closed)
      : io_(std::move(io)),
        address_(AddressOf(socket)),
        stream_(std::move(socket)),
        timer_(io_->get_executor()),
        options_(options),
        served_(served),
        closed_(std::move(closed)) {}

  void Read() {
    waits_ = true;
    since_ = std::chrono::steady_clock::now();
    parser_ = std::make_unique<Parser>();
    parser_->header_limit(options_.max_header_bytes);
    parser_->body_limit(std::numeric_limits<uint64_t>::max());  // until the receiver is known
    stream_.expires_after(std::chrono::nanoseconds(options_.idle_limit_ns));
    wire::async_read_header(
        stream_, buffer_, *parser_,
        [self = shared_from_this()](error_code error, size_t) { self->OnHeader(error); });
  }

  // Whether the connection waits for a request; since() is when it began to.
  bool waits() const { return waits_; }
  std::chrono::steady_clock::time_point since() const { return since_; }
  // The address of its client without the port (listen::Peer::address); empty for a unix socket.
  const std::string& address() const { return address_; }
  // Whether the connection has a place.
  bool placed() const { return placed_; }
  void Place() { placed_ = true; }

  void Close() {
    error_code ignored;
    timer_.cancel();
    stream_.socket().shutdown(Stream::socket_type::shutdown_both, ignored);
    stream_.close();
    if (auto closed = std::exchange(closed_, nullptr)) closed(this);
  }

 private:
  // Takes a place for the request that has arrived. Returns: false if there was none, and the
  // request has been answered with 503.
  bool Admitted() {
    waits_ = false;
    std::optional<std::string> why = served_.refused(*this, Asked().path);
    if (!why.has_value()) return true;
    Write(Plain(503, *std::move(why)), true);
    return false;
  }

  void OnHeader(const error_code& error) {
    if (!closed_) return;
    if (error) return OnRead(error);
    head_ = parser_->get().method() == wire::verb::head;
    if (parser_->get().count(wire::field::host) > 1) {
      return Write(Plain(400, "bad request: there is more than one Host header"), true);
    }
    if (parser_->get().method() == wire::verb::post && served_.receive) {
      std::optional<Reception> reception = served_.receive(Asked());
      if (reception.has_value()) {
        if (Admitted()) GiveBodyAway(*std::move(reception));
        return;
      }
    }
    const auto length = parser_->content_length();
    if (length.has_value() && *length > kGreatestBody) return OnRead(wire::error::body_limit);
    parser_->body_limit(kGreatestBody);
    wire::async_read(
        stream_, buffer_, *parser_,
        [self = shared_from_this()](error_code failed, size_t) { self->OnRead(failed); });
  }

  void OnRead(const error_code& error) {
    if (!closed_) return;
    if (!error) {
      if (Admitted()) Answer();
      return;
    }
    waits_ = false;
    // Input that is not HTTP gets an error response; an incomplete request does not.
    if (error == wire::error::header_limit)
      return Write(Plain(431, "the header is too large"), true);
    if (error == wire::error::body_limit) return Write(Plain(413, "the body is too large"), true);
    const bool gone = error == wire::error::end_of_stream ||
                      error == wire::error::partial_message ||
                      error.category() != make_error_code(wire::error::bad_method).category();
    if (gone) return Close();
    Write(Plain(400, absl::StrCat("bad request: ", error.message())), true);
  }

  Request Asked() const {
    const auto& request = parser_->get();
    const std::string_view target = View(request.target());
    const size_t query = target.find('?');
    return {
        .path = target.substr(0, query),
        .query = query == std::string_view::npos ? std::string_view() : target.substr(query + 1),
        .host = View(request[wire::field::host]),
        .origin = View(request[wire::field::origin]),
        .cookie = View(request[wire::field::cookie]),
        .accept_encoding = View(request[wire::field::accept_encoding]),
        .head = head_};
  }

  void Answer() {
    const auto& request = parser_->get();
    const bool close = !request.keep_alive();
    if (request.method() != wire::verb::get && !head_) {
      return Write(Plain(405, "only GET and HEAD are answered"), close);
    }
    const Request asked = Asked();
    if (served_.upgrade && beast::websocket::is_upgrade(request)) {
      const absl::StatusOr<ServeWebSocket> serve = served_.upgrade(asked);
      if (serve.ok()) return GiveAway(*serve);
      const unsigned code = absl::IsNotFound(serve.status())            ? 404
                            : absl::IsResourceExhausted(serve.status()) ? 503
                                                                        : 403;
      return Write(Plain(code, std::string(serve.status().message())), true);
    }
    const uint64_t number = ++number_;
    // The answer may arrive after the connection or the server has been destroyed.
    const bool known =
        served_.handler(asked, [weak = weak_from_this(), number, close](Response answer) {
          const std::shared_ptr<Connection> open = weak.lock();
          if (open == nullptr) return;
          asio::post(*open->io_, [weak, number, close, answer = std::move(answer)]() mutable {
            if (const auto self = weak.lock()) self->OnAnswer(number, std::move(answer), close);
          });
        });
    if (!known) return Write(Plain(404, "there is nothing here; try /healthz or /metrics"), close);
    stream_.expires_never();
    timer_.expires_after(std::chrono::nanoseconds(options_.answer_limit_ns));
    timer_.async_wait([self = shared_from_this(), number, close](error_code error) {
      if (!error) self->OnAnswer(number, Plain(503, "the daemon did not answer in time"), close);
    });
  }

  void GiveAway(const ServeWebSocket& serve) {
    const RequestMessage request = parser_->release();
    stream_.expires_never();
    served_.upgraded(std::move(stream_), request, serve);
    if (auto closed = std::exchange(closed_, nullptr)) closed(this);
  }

  void GiveBodyAway(Reception reception) {
    stream_.expires_never();
    served_.received(std::move(stream_), std::move(buffer_),
                     std::make_unique<BodyParser>(std::move(*parser_)), std::move(reception));
    if (auto closed = std::exchange(closed_, nullptr)) closed(this);
  }

  // Only the first answer to request `number` counts.
  void OnAnswer(uint64_t number, Response answer, bool close) {
    if (number != number_ || !closed_) return;
    ++number_;
    timer_.cancel();
    Write(std::move(answer), close);
  }

  void Write(Response answer, bool close) {
    response_.emplace(ToMessage(std::move(answer), close, head_));
    stream_.expires_after(std::chrono::nanoseconds(options_.idle_limit_ns));
    WriteAll(stream_, response_->head, response_->body,
             [self = shared_from_this(), close](error_code error) {
               if (error || close) return self->Close();
               self->Read();
             });
  }

  const std::shared_ptr<asio::io_context> io_;
  const std::string address_;
  Stream stream_;
  asio::steady_timer timer_;
  const ServerOptions& options_;
  const Served& served_;
  std::function<void(Connection*)> closed_;  // empty once closed
  beast::flat_buffer buffer_;
  std::unique_ptr<Parser> parser_;
  std::optional<ResponseMessage> response_;
  bool head_ = false, waits_ = false, placed_ = false;
  std::chrono::steady_clock::time_point since_;
  uint64_t number_ = 0;  // of the request that waits for its answer
};

absl::StatusOr<Protocol::endpoint> Endpoint(const Address& address, asio::io_context& io) {
  if (address.unix_socket) {
    return Protocol::endpoint(asio::local::stream_protocol::endpoint(address.path));
  }
  error_code error;
  asio::ip::tcp::resolver resolver(io);
  const auto found = resolver.resolve(address.host, std::to_string(address.port),
                                      asio::ip::tcp::resolver::passive, error);
  if (error || found.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("the host of ", address.ToString(), " is not known: ", error.message()));
  }
  return Protocol::endpoint(found.begin()->endpoint());
}

}  // namespace

// Everything except Start and the destructor runs on the server's thread.
class Server::Impl {
 public:
  Impl(ServerOptions options, Handler handler, Upgrade upgrade, Receive receive)
      : options_(std::move(options)),
        served_{std::move(handler),
                Bounded(std::move(upgrade)),
                std::move(receive),
                [this](Connection& asking, std::string_view path) { return Refused(asking, path); },
                [this](Stream stream, const RequestMessage& request, const ServeWebSocket& serve) {
                  OnUpgraded(std::move(stream), request, serve);
                },
                [this](Stream stream, beast::flat_buffer buffer, std::unique_ptr<BodyParser> parser,
                       Reception reception) {
                  OnReceived(std::move(stream), std::move(buffer), std::move(parser),
                             std::move(reception));
                }},
        io_(std::make_shared<asio::io_context>(1)),
        acceptor_(io_->get_executor()),
        retry_(io_->get_executor()) {}

  ~Impl() {
    if (!thread_.joinable()) return;
    asio::post(*io_, [this] {
      stopping_ = true;
      error_code ignored;
      acceptor_.close(ignored);
      if (options_.listen.unix_socket) unlink(options_.listen.path.c_str());
      retry_.cancel();
      const std::set<std::shared_ptr<Connection>> connections = connections_;
      for (const auto& connection : connections) connection->Close();
      const auto sockets = sockets_;
      for (const auto& [socket, address] : sockets) socket->Close();
      const auto bodies = bodies_;
      for (const auto& [body, address] : bodies) body->Close();
    });
    thread_.join();
  }

  absl::Status Start() {
    if (absl::Status ready = PrepareToListen(options_.listen); !ready.ok()) return ready;
    absl::StatusOr<Protocol::endpoint> endpoint = Endpoint(options_.listen, *io_);
    if (!endpoint.ok()) return endpoint.status();
    error_code error;
    acceptor_.open(endpoint->protocol(), error);
    if (!error && !options_.listen.unix_socket) {
      acceptor_.set_option(asio::socket_base::reuse_address(true), error);
    }
    if (!error) acceptor_.bind(*endpoint, error);
    if (!error) acceptor_.listen(asio::socket_base::max_listen_connections, error);
    if (error == asio::error::address_in_use) {
      return absl::AlreadyExistsError(
          absl::StrCat("somebody listens on ", options_.listen.ToString(),
                       " already; end that, or give another address with --http, or off"));
    }
    if (error) {
      return absl::ErrnoToStatus(
          error.value(), absl::StrCat(options_.listen.ToString(), " cannot be listened on"));
    }
    if (options_.listen.unix_socket) {
      if (chmod(options_.listen.path.c_str(), kSocketMode) != 0) {
        return absl::ErrnoToStatus(
            errno, absl::StrCat(options_.listen.ToString(), " cannot be made its group's"));
      }
    } else {
      const Protocol::endpoint local = acceptor_.local_endpoint(error);
      asio::ip::tcp::endpoint tcp;
      std::memcpy(tcp.data(), local.data(), local.size());
      options_.listen.port = tcp.port();
    }
    Accept();
    thread_ = std::thread([this] { io_->run(); });
    return absl::OkStatus();
  }

  const Address& address() const { return options_.listen; }

 private:
  void Accept() {
    if (accepting_ || stopping_) return;
    accepting_ = true;
    const auto waiting = static_cast<size_t>(
        std::count_if(connections_.begin(), connections_.end(),
                      [](const auto& connection) { return !connection->placed(); }));
    if (waiting >= kMostWaiting && !CloseLongestIdle(false)) {
      accepting_ = false;
      return AcceptAfter(kAcceptSoon);
    }
    acceptor_.async_accept([this](error_code error, Stream::socket_type socket) {
      accepting_ = false;
      if (stopping_) return;
      if (error) return AcceptLater(error);
      accept_failed_ = false;
      const auto connection =
          std::make_shared<Connection>(io_, std::move(socket), options_, served_,
                                       [this](Connection* closed) { OnClosed(closed); });
      connections_.insert(connection);
      connection->Read();
      Accept();
    });
  }

  size_t Placed() const {
    return sockets_.size() + bodies_.size() +
           static_cast<size_t>(
               std::count_if(connections_.begin(), connections_.end(),
                             [](const auto& connection) { return connection->placed(); }));
  }

  // Returns: the number of places that the clients at `address` have, without `asking`.
  size_t PlacedFor(const std::string& address, const Connection& asking) const {
    const auto is_there = [&](const auto& session) { return session.second == address; };
    return static_cast<size_t>(
        std::count_if(sockets_.begin(), sockets_.end(), is_there) +
        std::count_if(bodies_.begin(), bodies_.end(), is_there) +
        std::count_if(connections_.begin(), connections_.end(), [&](const auto& connection) {
          return connection.get() != &asking && connection->placed() &&
                 connection->address() == address;
        }));
  }

  // Returns: the maximum number of WebSockets. The other places are left for short requests.
  size_t MostSockets() const { return (size_t{options_.max_connections} * 3 + 3) / 4; }

  // Returns: the maximum number of places for the clients at one address. Half of the places that
  // WebSockets leave are reserved for other addresses.
  size_t Share() const {
    return MostSockets() + (options_.max_connections - MostSockets() + 1) / 2;
  }

  std::optional<std::string> Refused(Connection& asking, std::string_view path) {
    const auto& reserved = options_.reserved_paths;
    const bool is_reserved = std::find(reserved.begin(), reserved.end(), path) != reserved.end();
    const size_t mine = asking.placed() ? 1 : 0;
    const std::string& address = asking.address();
    if (!is_reserved && !address.empty() && Share() < options_.max_connections) {
      while (PlacedFor(address, asking) >= Share() && CloseLongestIdle(true, &address)) {
      }
      if (PlacedFor(address, asking) >= Share()) {
        return absl::StrCat(Share(), " requests and WebSockets from ", address,
                            " are being served, which is the most of max_http_connections that "
                            "one address may have; try again later");
      }
    }
    const size_t places = options_.max_connections + (is_reserved ? kReservedPlaces : 0);
    while (Placed() - mine >= options_.max_connections && CloseLongestIdle(true)) {
    }
    if (Placed() - mine >= places) {
      return absl::StrCat(options_.max_connections,
                          " requests and WebSockets are being served, which is "
                          "max_http_connections; try again later");
    }
    asking.Place();
    return std::nullopt;
  }

  // Closes the connection that has waited longest for a request, at the address with most waiting
  // connections. `placed`: considers connections with a place, else those without one after
  // kFirstRequest. `address`: considers this address only; null: all. Returns: whether a connection
  // was closed.
  bool CloseLongestIdle(bool placed, const std::string* address = nullptr) {
    const auto before =
        std::chrono::steady_clock::now() - std::chrono::nanoseconds(placed ? 0 : kFirstRequest);
    std::map<std::string, std::pair<size_t, std::shared_ptr<Connection>>> idle;  // by address
    for (const auto& connection : connections_) {
      if (!connection->waits() || connection->placed() != placed) continue;
      if (connection->since() > before) continue;
      if (address != nullptr && connection->address() != *address) continue;
      auto& [count, longest] = idle[connection->address()];
      ++count;
      if (longest == nullptr || connection->since() < longest->since()) longest = connection;
    }
    const auto most = std::max_element(idle.begin(), idle.end(), [](const auto& a, const auto& b) {
      return std::pair(a.second.first, b.second.second->since()) <
             std::pair(b.second.first, a.second.second->since());
    });
    if (most == idle.end()) return false;
    const std::shared_ptr<Connection> longest = most->second.second;
    longest->Close();
    return true;
  }

  Upgrade Bounded(Upgrade upgrade) {
    if (!upgrade) return nullptr;
    return [this, upgrade = std::move(upgrade)](
               const Request& request) -> absl::StatusOr<ServeWebSocket> {
      if (sockets_.size() < MostSockets()) return upgrade(request);
      return absl::ResourceExhaustedError(absl::StrCat(
          MostSockets(), " WebSockets are open, which is three quarters of max_http_connections"));
    };
  }

  // Retries later, because closing connections may free what is missing (descriptors, for example).
  void AcceptLater(const error_code& why) {
    if (!std::exchange(accept_failed_, true) && options_.accept_failed) {
      options_.accept_failed(why.message());
    }
    AcceptAfter(kAcceptRetry);
  }

  void AcceptAfter(std::chrono::milliseconds pause) {
    retry_.expires_after(pause);
    retry_.async_wait([this](error_code error) {
      if (!error) Accept();
    });
  }

  void OnClosed(Connection* closed) {
    connections_.erase(closed->shared_from_this());
    Accept();
  }

  void OnUpgraded(Stream stream, const RequestMessage& request, const ServeWebSocket& serve) {
    std::string address = AddressOf(stream.socket());
    sockets_.emplace(StartWebSocket(io_, std::move(stream), request,
                                    std::chrono::nanoseconds(options_.message_limit_ns), serve,
                                    [this](WebSocketSession* closed) {
                                      std::erase_if(sockets_, [closed](const auto& socket) {
                                        return socket.first.get() == closed;
                                      });
                                      Accept();
                                    }),
                     std::move(address));
  }

  void OnReceived(Stream stream, beast::flat_buffer buffer, std::unique_ptr<BodyParser> parser,
                  Reception reception) {
    std::string address = AddressOf(stream.socket());
    bodies_.emplace(StartBody(io_, std::move(stream), std::move(buffer), std::move(parser),
                              std::move(reception), options_,
                              [this](BodySession* closed) {
                                std::erase_if(bodies_, [closed](const auto& body) {
                                  return body.first.get() == closed;
                                });
                                Accept();
                              }),
                    std::move(address));
  }

  ServerOptions options_;
  const Served served_;
  const std::shared_ptr<asio::io_context> io_;
  Acceptor acceptor_;
  asio::steady_timer retry_;
  std::set<std::shared_ptr<Connection>> connections_;
  // The sessions, with the addresses of their clients.
  std::map<std::shared_ptr<WebSocketSession>, std::string> sockets_;
  std::map<std::shared_ptr<BodySession>, std::string> bodies_;
  bool accepting_ = false, accept_failed_ = false, stopping_ = false;
  std::thread thread_;
};

Server::Server(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Server::~Server() = default;

absl::StatusOr<std::unique_ptr<Server>> Server::Start(ServerOptions options, Handler handler,
                                                      Upgrade upgrade, Receive receive) {
  try {
    auto impl = std::make_unique<Impl>(std::move(options), std::move(handler), std::move(upgrade),
                                       std::move(receive));
    if (absl::Status status = impl->Start(); !status.ok()) return status;
    return std::unique_ptr<Server>(new Server(std::move(impl)));
  } catch (const std::exception& error) {
    return absl::ResourceExhaustedError(
        absl::StrCat("no descriptor or thread for http: ", error.what()));
  }
}

const Address& Server::address() const { return impl_->address(); }

}  // namespace voxeld::daemon::http
