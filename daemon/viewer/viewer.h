// The viewer: a web page that shows what the displays show, and the WebSocket behind it
// (docs/protocols/viewer.md).
//
// Anybody who can connect may view, if the request names this machine as its host. A page of
// another origin cannot do that, neither with its own name nor with a name that it made resolve to
// this machine. Control is granted to the browser that opens the address with the key. The key is
// created when the daemon starts and works once; the browser gets a cookie that scripts cannot
// read.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "daemon/access/audit.h"
#include "daemon/address/address.h"
#include "daemon/core/core.h"
#include "daemon/http/http_server.h"
#include "daemon/viewer/viewer_play.h"
#include "display/sync/clock.h"

namespace voxeld::daemon::viewer {

struct ViewerOptions {
  std::string version;
  std::vector<std::string> hosts;  // further names that requests may give as the host
  bool control = true;             // provide an address with a key
  access::Audit* audit = nullptr;  // for control actions; null: no audit. Outlives the viewer
  ViewerPlayOptions play;          // for files that pages with control upload
};

// All functions run on the HTTP server's thread.
class Viewer {
 public:
  // Errors: Unavailable if the system has no random bytes. `core` and `clock` must outlive the
  // viewer.
  static absl::StatusOr<std::unique_ptr<Viewer>> Make(Core& core, sync::Clock& clock,
                                                      ViewerOptions options);
  ~Viewer();
  Viewer(const Viewer&) = delete;
  Viewer& operator=(const Viewer&) = delete;

  // Returns: whether the build includes the page. A build without npm does not, and serves a notice
  // instead.
  static bool HasPage();

  // The functions for starting the HTTP server. Paths that are not the viewer's go to `others`.
  // They must not be called after the viewer has been destroyed.
  http::Handler Handler(http::Handler others);
  http::Upgrade Upgrade();
  http::Receive Receive();

  // Returns: an address such as "http://127.0.0.1:8088/"; empty for a unix socket.
  static std::string PageAddress(const Address& http);
  // Returns: the same address with the key; empty: no control. Show it only to people at a
  // terminal, never in a log.
  std::string ControlAddress(const Address& http) const;

 private:
  class Impl;
  explicit Viewer(std::shared_ptr<Impl> impl);
  const std::shared_ptr<Impl> impl_;
};

}  // namespace voxeld::daemon::viewer
