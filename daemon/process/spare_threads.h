// Threads in hand for when the system gives none. gRPC 1.51 does not look whether a thread that it wants began: what it had put in
// that thread's queue is then never done, and the connections that it was for hang until their clients give them up.
#pragma once

#include <cstdint>

#include "absl/status/status.h"

namespace voxeld::daemon {

// A pthread_create anywhere in this process (libraries and std::thread too) that fails for want of memory or of numbers is made
// again at once; if it fails then too, and once there are some here, it takes a thread that waits here, with what its attributes
// say of being detached alone. In a program that a sanitizer has made its own of pthread_create: nothing of this.
class SpareThreads {
 public:
  static constexpr int kMost = 16;

  // Begins `count` of 1 to kMost; ResourceExhausted: the system does not give them. One object at a time.
  static absl::Status Begin(int count);
  // Begins what is missing, as far as it can be had. How many were taken since the last call, so that somebody says so. Any thread.
  static uint64_t Refill();
  // Ends those that wait, and waits for that; those that were taken are whoever's they are.
  static void End();

  static int waiting();
  static uint64_t taken();  // since the process began
};

}  // namespace voxeld::daemon
