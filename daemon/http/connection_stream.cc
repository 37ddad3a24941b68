#include "daemon/http/connection_stream.h"

#include <array>
#include <boost/asio/buffer.hpp>
#include <boost/asio/write.hpp>
#include <utility>

namespace voxeld::daemon::http {

void WriteAll(ConnectionStream& stream, std::string_view head, std::string_view body,
              std::function<void(boost::system::error_code)> done) {
  const std::array<boost::asio::const_buffer, 2> bytes = {boost::asio::buffer(head),
                                                          boost::asio::buffer(body)};
  boost::asio::async_write(
      stream, bytes,
      [done = std::move(done)](boost::system::error_code error, size_t) { done(error); });
}

}  // namespace voxeld::daemon::http
