// Process-wide settings of a gRPC server. Apply them once, before a second thread exists.
#pragma once

#include <cstdint>
#include <exception>
#include <string>

namespace voxeld::daemon {

// Lets the allocator keep memory for the next message, up to a limit, instead of returning it to
// the system and faulting it in again. Limits the arenas to the number of cores (at least four).
// Disables Abseil's deadlock detection, which distributions enable and gRPC would run for every
// message.
void TuneProcess();

// Returns free memory of the allocator to the system, including memory between used blocks. Without
// this, each arena would keep its peak forever, and higher peaks accumulate while the daemon runs.
// It takes longer the more free blocks there are, blocks other threads that allocate from the same
// arena, and memory that is needed again is faulted in again.
void GiveBackFreeMemory();

// Returns: the allocated bytes according to the allocator, including its per-thread caches; 0 if it
// does not count them.
uint64_t HeapBytes();

// Raises the descriptor limit to the maximum that the process may have. Every client uses two
// descriptors: one for serving and one for the guard.
void RaiseDescriptorLimit();

// Explains an exception that ends a starting daemon: what the system refuses, and which limit to
// check.
std::string WhyItEnds(const std::exception& error);

}  // namespace voxeld::daemon
