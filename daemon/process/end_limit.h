// How long this process may take to end.
#pragma once

#include "display/sync/clock.h"

namespace voxeld::daemon {

// While one is there: after `limit`, above 0, the process ends with status 1 and a line on standard error, whatever it
// waits for. Libraries wait without end for threads that the system did not give them. Uses SIGALRM and its timer; one
// at a time.
class EndLimit {
 public:
  explicit EndLimit(sync::TimeNs limit);
  ~EndLimit();
  EndLimit(const EndLimit&) = delete;
  EndLimit& operator=(const EndLimit&) = delete;
};

}  // namespace voxeld::daemon
