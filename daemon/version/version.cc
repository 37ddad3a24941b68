#include "daemon/version/version.h"

namespace voxeld::daemon {

const char* Version() { return VOXELD_VERSION; }

}  // namespace voxeld::daemon
