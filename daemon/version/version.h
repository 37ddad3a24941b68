// The version of this build.
#pragma once

namespace voxeld::daemon {

const char* Version();  // "0.1.0"

}  // namespace voxeld::daemon
