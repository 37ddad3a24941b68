// Limits the time that this process takes to exit.
#pragma once

#include "display/sync/clock.h"

namespace voxeld::daemon {

// While an object exists, the process exits with status 1 and a line on standard error after
// `limit`, whatever it is waiting for. Needed because libraries wait forever for threads that the
// system could not create. Requires: `limit` above 0; one object at a time. Uses SIGALRM and its
// timer.
class EndLimit {
 public:
  explicit EndLimit(sync::TimeNs limit);
  ~EndLimit();
  EndLimit(const EndLimit&) = delete;
  EndLimit& operator=(const EndLimit&) = delete;
};

}  // namespace voxeld::daemon
