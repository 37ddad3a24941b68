// What an outsider sees of a running process.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>

namespace voxeld::e2e {

// In KiB; 0 if it is not there.
uint64_t ResidentKib(pid_t process);
// The most that it ever was.
uint64_t MostResidentKib(pid_t process);
// Limits the process, from now on, to what it has open and `spare` more: the limit is for the
// numbers of descriptors, and new ones get the least that is free.
bool LeaveDescriptors(pid_t process, size_t spare);

}  // namespace voxeld::e2e
