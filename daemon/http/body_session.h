// A connection whose request brings a body that somebody takes, from behind the header on: one piece after another, each
// when the last has been taken, so that no more than a piece is held; then the answer, and the end.
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
  virtual void Close() = 0;  // at once
};

// On the server's thread. `parser` has read the header, and `buffer` what came with it. What of `reception` refuses is answered
// before anything is read; whoever still sends then is listened to for a while, so that the answer is not lost. `closed`, once.
// `options` outlive the session, which keeps itself alive while it is open.
std::shared_ptr<BodySession> StartBody(std::shared_ptr<boost::asio::io_context> io,
                                       ConnectionStream stream, boost::beast::flat_buffer buffer,
                                       std::unique_ptr<BodyParser> parser, Reception reception,
                                       const ServerOptions& options,
                                       std::function<void(BodySession*)> closed);

}  // namespace voxeld::daemon::http
