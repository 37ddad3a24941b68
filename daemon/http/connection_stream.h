// Types that the files of the HTTP port share for a connection over TCP or a unix socket.
#pragma once

#include <boost/asio/generic/stream_protocol.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/beast/core/basic_stream.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/string_body.hpp>
#include <functional>
#include <string_view>

namespace voxeld::daemon::http {

using Protocol = boost::asio::generic::stream_protocol;
using ConnectionStream =
    boost::beast::basic_stream<Protocol, boost::asio::io_context::executor_type>;
using RequestMessage = boost::beast::http::request<boost::beast::http::string_body>;

// Writes `head`, then `body`, and calls `done` with the result. Both must stay valid until then.
// Every write of a connection uses this function, because each further combination of asio
// completion handlers adds seconds of compile time.
void WriteAll(ConnectionStream& stream, std::string_view head, std::string_view body,
              std::function<void(boost::system::error_code)> done);

}  // namespace voxeld::daemon::http
