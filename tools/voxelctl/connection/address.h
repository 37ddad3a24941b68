// Which server is meant.
#pragma once

#include <functional>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace voxeld::voxelctl {

// The value of an environment variable, empty if it is not set.
using Environment = std::function<std::string(const char* name)>;

inline constexpr absl::string_view kDefaultTcpAddress = "127.0.0.1:50551";

// `option` if it is not empty, else VOXELD_SERVER, else the unix socket in the run-time directory
// ($XDG_RUNTIME_DIR/voxeld.sock, /run/voxeld/voxeld.sock, /tmp/voxeld-UID/voxeld.sock) if there is
// one that this user or root owns, else kDefaultTcpAddress.
std::string ChooseServer(const std::string& option, const Environment& environment);

// HOST:PORT or unix:PATH as gRPC writes it; InvalidArgument with the text and what would be right.
absl::StatusOr<std::string> ServerTarget(absl::string_view address);

}  // namespace voxeld::voxelctl
