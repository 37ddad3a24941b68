// Serializes HTTP responses, for the files that send them.
#pragma once

#include <string>
#include <utility>

#include "daemon/http/http_server.h"

namespace voxeld::daemon::http {

inline Response PlainResponse(unsigned status, std::string text) {
  return {status, "text/plain; charset=utf-8", std::move(text) + "\n", {}};
}

// The bytes of a response: the status line with the header fields, and the body.
struct ResponseMessage {
  std::string head;
  std::string body;
};

// Returns: the bytes of `answer` in HTTP/1.1. `close`: the connection closes after it. `head`: the
// response to HEAD, which has the header fields of a GET response and no body.
ResponseMessage ToMessage(Response answer, bool close, bool head);

}  // namespace voxeld::daemon::http
