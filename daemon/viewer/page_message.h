// What a page sends over its WebSocket (docs/protocols/viewer.md §1), read and checked.
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
  DisplayUpdate update;  // of it
};
struct Clear {
  v1::ClearLayerRequest request;
};
struct Stop {};

using Message =
    std::variant<Hello, Watch, Shown, Unwatch, Dark, Compare, Stats, Layers, Update, Clear, Stop>;

inline constexpr size_t kMostHidden = 256;  // layers

// InvalidArgument: it is none, with words for the page. PermissionDenied: it changes something, and the page has no `control`;
// what it says is not read then. Of several in one the first of the order above counts.
absl::StatusOr<Message> Read(const std::string& text, bool control);

}  // namespace voxeld::daemon::viewer::page
