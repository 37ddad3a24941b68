// Terminates the process when memory runs out. The service manager or the owner restarts it.
#pragma once

namespace voxeld {

// From now on, an allocation by operator new that fails writes one line to standard error and exits with status 1: code that is
// interrupted halfway cannot be trusted to go on. C libraries allocate by malloc and handle failures themselves; some abort.
// A program that calls this is protected before its global objects are constructed. Call it once, before other threads exist.
void ExitWhenOutOfMemory();

}  // namespace voxeld
