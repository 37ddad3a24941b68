// Handles a request with a body from the end of its header on. Each piece of the body is read when
// the receiver has taken the previous one, so that only one piece is held in memory. Then the
// response is sent and the connection closed.
#pragma once

#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http/buffer_body.hpp>
#include <boost/beast/http/parser.hpp>
#include <functional>
#include <memory>

#include "daemon/http/connection_stream.h"
#include "daemon/http/http_server.h"

namespace voxeld::daemon::http {

using BodyParser = boost::beast::http::request_parser<boost::beast::http::buffer_body>;

class BodySession {
 public:
  virtual ~BodySession() = default;
  virtual void Close() = 0;  // immediately
};

// Call on the server's thread. `parser` has read the header, and `buffer` holds data that arrived
// with it. If `reception` has a refusal, that response is sent before anything is read; further
// data is then read and discarded for a while, so that the response is not lost. `closed` is called
// once. `options` must outlive the session, which keeps itself alive while it is open.
std::shared_ptr<BodySession> StartBody(std::shared_ptr<boost::asio::io_context> io,
                                       ConnectionStream stream, boost::beast::flat_buffer buffer,
                                       std::unique_ptr<BodyParser> parser, Reception reception,
                                       const ServerOptions& options,
                                       std::function<void(BodySession*)> closed);

}  // namespace voxeld::daemon::http
