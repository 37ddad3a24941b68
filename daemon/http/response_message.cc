#include "daemon/http/response_message.h"

#include <boost/beast/http/message.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/http/write.hpp>
#include <sstream>

namespace voxeld::daemon::http {

ResponseMessage ToMessage(Response answer, bool close, bool head) {
  namespace wire = boost::beast::http;
  wire::response<wire::string_body> message(static_cast<wire::status>(answer.status), 11);
  if (answer.status == 405) message.set(wire::field::allow, "GET, HEAD");
  message.set(wire::field::content_type, answer.content_type);
  message.set(wire::field::cache_control, "no-store");
  for (const auto& [name, value] : answer.headers) message.set(name, value);
  message.keep_alive(!close);
  message.content_length(answer.body.size());
  std::ostringstream out;
  out << message.base();
  return {std::move(out).str(), head ? std::string() : std::move(answer.body)};
}

}  // namespace voxeld::daemon::http
