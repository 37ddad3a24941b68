// Files that pages with control have played: taken as they are sent, and told of (docs/protocols/viewer.md, 6).
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
  play::Player* player = nullptr;  // none: nothing is played; outlives all else
  std::string why_not;             // where there is none
  uint64_t max_bytes = uint64_t{256} << 20;
  play::PlayFile::Write write;  // of files; tests' own
};

// On the http server's thread. Nothing that other threads call (the worker, the player) has a share in it, so that it goes on
// neither of these, whoever is the last to let it go: its end waits for the worker.
class ViewerPlay {
 public:
  static std::shared_ptr<ViewerPlay> Make(ViewerPlayOptions options, access::Audit* audit);
  ~ViewerPlay();
  ViewerPlay(const ViewerPlay&) = delete;
  ViewerPlay& operator=(const ViewerPlay&) = delete;

  // Of a page that may control. `query`: "name=…", percent-encoded.
  http::Reception Receive(std::string_view query);
  // From now on it is told what plays, at once for the first time.
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
  const std::shared_ptr<Pages> pages_;  // the player has it, too
  std::weak_ptr<ViewerPlay> self_;
  bool taking_ = false;  // one file at a time
  play::Worker worker_;  // writes; the first to go
};

}  // namespace voxeld::daemon::viewer
