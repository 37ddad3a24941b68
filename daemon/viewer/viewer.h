// The viewer: a page that shows what the displays show, in a browser, and the WebSocket behind it
// (docs/protocols/viewer.md).
//
// Who may: anybody who can connect may look, if the request names this machine as its host (a page of another
// origin cannot: neither by its own name nor by one that it made resolve to here). Control is for the browser that
// opened the address with the key, which is made when the daemon starts and serves once; it gets a cookie that no
// script can read.
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
  bool control = true;             // there is an address with a key
  access::Audit* audit = nullptr;  // of what is controlled; none: nobody asks. Outlives the viewer
  ViewerPlayOptions play;          // of files that pages with control send
};

// Its functions run on the http server's thread.
class Viewer {
 public:
  // Unavailable if the system has no random bytes to give. Core and clock outlive the viewer.
  static absl::StatusOr<std::unique_ptr<Viewer>> Make(Core& core, sync::Clock& clock,
                                                      ViewerOptions options);
  ~Viewer();
  Viewer(const Viewer&) = delete;
  Viewer& operator=(const Viewer&) = delete;

  // Whether the page is there: a build without npm has none, and says so in its place.
  static bool HasPage();

  // Those that the server is started with; paths that are not the viewer's go to `others`. Not to be called once the
  // viewer is gone.
  http::Handler Handler(http::Handler others);
  http::Upgrade Upgrade();
  http::Receive Receive();

  // "http://127.0.0.1:8088/"; empty for a unix socket.
  static std::string PageAddress(const Address& http);
  // The same with the key; empty: there is no control. To be told to people at a terminal alone, never to a log.
  std::string ControlAddress(const Address& http) const;

 private:
  class Impl;
  explicit Viewer(std::shared_ptr<Impl> impl);
  const std::shared_ptr<Impl> impl_;
};

}  // namespace voxeld::daemon::viewer
