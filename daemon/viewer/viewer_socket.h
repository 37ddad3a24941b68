// One browser's WebSocket: its watches, its requests and its control actions
// (docs/protocols/viewer.md).
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

// State shared by the sockets of a viewer, used on the HTTP server's thread.
struct ViewerShared {
  Core& core;
  sync::Clock& clock;
  const ViewerOptions options;
  const std::shared_ptr<ViewerPlay> play;
  // Cached for each display that was watched, because computing places takes time.
  std::map<std::string, std::shared_ptr<PixelPlaces>> places;
  size_t watches = 0;  // of all sockets
  std::unique_ptr<Comparer> comparer = std::make_unique<Comparer>(clock, core.budget());
};

// `control`: the page may change displays and layers.
std::unique_ptr<http::WebSocketService> NewViewerSocket(std::shared_ptr<ViewerShared> shared,
                                                        std::shared_ptr<http::WebSocketPeer> peer,
                                                        bool control);

}  // namespace voxeld::daemon::viewer
