// What a connection of the http port is made of, for the files that speak on it. TCP or a unix socket.
#pragma once

#include <boost/asio/generic/stream_protocol.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/beast/core/basic_stream.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/string_body.hpp>

namespace voxeld::daemon::http {

using Protocol = boost::asio::generic::stream_protocol;
using ConnectionStream =
    boost::beast::basic_stream<Protocol, boost::asio::io_context::executor_type>;
using RequestMessage = boost::beast::http::request<boost::beast::http::string_body>;

}  // namespace voxeld::daemon::http
