// What stands between a worker and its owners and passes on all that either says, but for frames' answers, of which
// each is told otherwise:
//
//   VOXELD_FAULT_LIE   call   is of a call that nobody made
//                      type   is another message
//                      short  ends in its midst
//                      frame  is of another frame
//                      sum    has another sum than its bytes
//                      done   is that all went well, and no frame
#pragma once

#include <string>

namespace voxeld::gpu {

// Takes the connections that come over `control`, and hands others on in their place over the socket that is returned, for
// ServeEngines. On threads of its own, as long as the process lives.
int ServeThroughALiar(int control, const std::string& lie);

}  // namespace voxeld::gpu
