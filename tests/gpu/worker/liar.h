// Stands between a worker and its owners and forwards all messages, but changes each answer to a
// frame:
//
//   VOXELD_FAULT_LIE   call   names a call that was never made
//                      type   is another message
//                      short  is truncated
//                      frame  is of another frame
//                      sum    has another checksum than its bytes
//                      done   reports success, without a frame
#pragma once

#include <string>

namespace voxeld::gpu {

// Takes the connections that arrive over `control`, and passes replacements for them over the
// returned socket, for ServeEngines. Uses threads of its own, as long as the process lives.
int ServeThroughALiar(int control, const std::string& lie);

}  // namespace voxeld::gpu
