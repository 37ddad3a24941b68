// Parses and checks the messages of a page's WebSocket (docs/protocols/viewer.md §1).
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "absl/status/statusor.h"
#include "daemon/core/core.h"
#include "voxeld/v1/display.pb.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::daemon::viewer::page {

inline constexpr char kOnlyLook[] =
    "this page may only look: control is for the address that voxeld printed at its start";

struct Hello {};
struct Watch {
  uint16_t id = 0;
  std::string display;
};
struct Shown {
  uint16_t id = 0;
};
struct Unwatch {
  uint16_t id = 0;
};
struct Dark {
  uint16_t id = 0;
};
struct Compare {
  uint16_t id = 0;
  std::vector<OwnedName> without;  // at most kMostHidden
};
struct Stats {};
struct Layers {};
struct Update {
  v1::UpdateDisplayRequest request;
  DisplayUpdate update;  // of the display
};
struct Clear {
  v1::ClearLayerRequest request;
};
struct Stop {};

using Message =
    std::variant<Hello, Watch, Shown, Unwatch, Dark, Compare, Stats, Layers, Update, Clear, Stop>;

inline constexpr size_t kMostHidden = 256;  // layers

// Errors: InvalidArgument with a message for the page if it is malformed; PermissionDenied, without
// parsing further, if it would change something and the page lacks `control`. If a message contains
// several kinds, the first in the order above counts.
absl::StatusOr<Message> Read(const std::string& text, bool control);

}  // namespace voxeld::daemon::viewer::page
