// One browser's WebSocket: what it watches, what it asks for, and what it may change (docs/protocols/viewer.md).
#pragma once

#include <map>
#include <memory>
#include <string>

#include "daemon/core/core.h"
#include "daemon/http/web_socket.h"
#include "daemon/viewer/comparer.h"
#include "daemon/viewer/pixel_places.h"
#include "daemon/viewer/viewer.h"
#include "daemon/viewer/viewer_play.h"
#include "display/sync/clock.h"

namespace voxeld::daemon::viewer {

// What the sockets of one viewer share; on the http server's thread.
struct ViewerShared {
  Core& core;
  sync::Clock& clock;
  const ViewerOptions options;
  const std::shared_ptr<ViewerPlay> play;
  // Of displays that somebody has watched: finding places takes a while.
  std::map<std::string, std::shared_ptr<PixelPlaces>> places;
  size_t watches = 0;  // of all sockets
  std::unique_ptr<Comparer> comparer = std::make_unique<Comparer>(clock, core.budget());
};

// `control`: it may change displays and layers.
std::unique_ptr<http::WebSocketService> NewViewerSocket(std::shared_ptr<ViewerShared> shared,
                                                        std::shared_ptr<http::WebSocketPeer> peer,
                                                        bool control);

}  // namespace voxeld::daemon::viewer
