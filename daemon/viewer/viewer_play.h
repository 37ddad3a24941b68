// Receives files that pages with control upload, plays them and reports the state
// (docs/protocols/viewer.md, 6).
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "daemon/access/audit.h"
#include "daemon/http/http_server.h"
#include "daemon/http/web_socket.h"
#include "daemon/play/play_file.h"
#include "daemon/play/player.h"
#include "daemon/play/worker.h"

namespace voxeld::daemon::viewer {

struct ViewerPlayOptions {
  play::Player* player = nullptr;  // null: nothing can be played; outlives everything else
  std::string why_not;             // the reason if `player` is null
  uint64_t max_bytes = uint64_t{256} << 20;
  play::PlayFile::Write write;  // for files; tests replace it
};

// Used on the HTTP server's thread. Callbacks on other threads (the worker, the player) hold no
// reference, so that the destructor, which waits for the worker, never runs there.
class ViewerPlay {
 public:
  static std::shared_ptr<ViewerPlay> Make(ViewerPlayOptions options, access::Audit* audit);
  ~ViewerPlay();
  ViewerPlay(const ViewerPlay&) = delete;
  ViewerPlay& operator=(const ViewerPlay&) = delete;

  // Receives a file from a page with control. `query`: "name=…", percent-encoded.
  http::Reception Receive(std::string_view query);
  // Sends the state to the page now and on every change.
  void Join(const std::shared_ptr<http::WebSocketPeer>& page);
  void Stop();

 private:
  class Pages;
  class Upload;
  ViewerPlay(ViewerPlayOptions options, access::Audit* audit);
  // Thread-safe.
  void Record(const char* method, const std::string& what,
              const absl::Status& result = absl::OkStatus()) const;

  const ViewerPlayOptions options_;
  access::Audit* const audit_;
  const std::shared_ptr<Pages> pages_;  // shared with the player
  std::weak_ptr<ViewerPlay> self_;
  bool taking_ = false;  // one file at a time
  play::Worker worker_;  // writes files; destroyed first
};

}  // namespace voxeld::daemon::viewer
