// Removes privileges that reading a file does not need from a process, so that a file that takes
// over the reader gains nothing.
#pragma once

#include <linux/filter.h>

#include <string>
#include <vector>

#include "absl/status/status.h"

namespace voxeld::voxelctl {

// Thread-safe.
class Sandbox {
 public:
  // Made once, by the first call; making it takes longer than entering it.
  static const Sandbox& Get();

  // Errors: Unavailable with the reason if this system cannot keep a process from opening files:
  // the kernel has no Landlock (Linux 5.13 and later have it), it is switched off, or a service
  // manager's filter forbids it.
  absl::Status CheckLandlock() const;

  // Confines this process permanently, including its threads and children. It can still use its
  // memory and open descriptors, and open files for reading below `readable` (a folder; "/": all
  // files; empty: none) and those of `more` (files, or folders with everything below them) that can
  // be opened. It cannot write or create files, use the network, start programs, or signal and
  // trace other processes. Requires: called in a process with one thread. Errors: Unavailable if
  // either files (CheckLandlock) or calls (seccomp) could not be confined; the other is.
  absl::Status Enter(const std::string& readable, const std::vector<std::string>& more = {}) const;

 private:
  Sandbox();

  std::vector<sock_filter> filter_;  // empty if it could not be made
};

}  // namespace voxeld::voxelctl
