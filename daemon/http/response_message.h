// A response as it goes over the wire, for the files that write one.
#pragma once

#include <string>
#include <utility>

#include "daemon/http/http_server.h"

namespace voxeld::daemon::http {

inline Response PlainResponse(unsigned status, std::string text) {
  return {status, "text/plain; charset=utf-8", std::move(text) + "\n", {}};
}

// The bytes of a response: its status line and header fields, and its body.
struct ResponseMessage {
  std::string head;
  std::string body;
};

// Returns the bytes of `answer` in HTTP/1.1. `close`: the connection ends with it. `head`: the response to HEAD, which has the
// header fields of a GET's and no body.
ResponseMessage ToMessage(Response answer, bool close, bool head);

}  // namespace voxeld::daemon::http
