// What a process that serves gRPC sets for itself as a whole, once, before it has a second thread.
#pragma once

#include <cstdint>
#include <exception>
#include <string>

namespace voxeld::daemon {

// Has the allocator keep what messages need from one to the next, up to a bound, in place of giving it back to the
// system and faulting it in again, in as many arenas as there are cores (four at least); and leaves out Abseil's search
// for deadlocks, with which distributions build it and which gRPC would make for every message.
void TuneProcess();

// Gives the system what the allocator keeps and nobody holds, from between what is held too. A moment's peaks would stay
// for ever else, each arena's, and higher ones come the longer the daemon runs. Takes longer the more
// places are free, and others who want memory of that arena wait for it; what is wanted again is faulted in again.
void GiveBackFreeMemory();

// Returns: allocated bytes, as the allocator counts them, with its caches of each thread; 0 if it does not count.
uint64_t HeapBytes();

// As many descriptors as the process may have: every client holds two, what serves it and what guards it.
void RaiseDescriptorLimit();

// What ends a daemon that is starting, for people: what the system refuses, and which limit to look at.
std::string WhyItEnds(const std::exception& error);

}  // namespace voxeld::daemon
