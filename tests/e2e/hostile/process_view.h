// Information on a running process, as seen from outside.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>

namespace voxeld::e2e {

// Returns KiB; 0 if the process does not exist.
uint64_t ResidentKib(pid_t process);
// Returns the greatest value so far.
uint64_t MostResidentKib(pid_t process);
// Limits the process, from now on, to its open descriptors and `spare` more: the limit applies to
// the numbers of descriptors, and new ones get the lowest free number.
bool LeaveDescriptors(pid_t process, size_t spare);

}  // namespace voxeld::e2e
