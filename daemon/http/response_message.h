// A response as it goes over the wire, for the files that write one.
#pragma once

#include <boost/beast/http/message.hpp>
#include <boost/beast/http/string_body.hpp>
#include <string>
#include <utility>

#include "daemon/http/http_server.h"

namespace voxeld::daemon::http {

using ResponseMessage = boost::beast::http::response<boost::beast::http::string_body>;

inline Response PlainResponse(unsigned status, std::string text) {
  return {status, "text/plain; charset=utf-8", std::move(text) + "\n", {}};
}

// `close`: the connection ends with it. `head`: what a GET would be answered, without its body.
inline ResponseMessage ToMessage(Response answer, bool close, bool head) {
  namespace wire = boost::beast::http;
  ResponseMessage message(static_cast<wire::status>(answer.status), 11);
  if (answer.status == 405) message.set(wire::field::allow, "GET, HEAD");
  message.set(wire::field::content_type, answer.content_type);
  message.set(wire::field::cache_control, "no-store");
  for (const auto& [name, value] : answer.headers) message.set(name, value);
  message.keep_alive(!close);
  message.content_length(answer.body.size());
  if (!head) message.body() = std::move(answer.body);
  return message;
}

}  // namespace voxeld::daemon::http
