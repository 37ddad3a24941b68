// What may be in flight at once: Linux's usbfs counts the bytes of all transfers of all programs
// and refuses what goes beyond usbcore.usbfs_memory_mb.
#pragma once

#include <cstddef>
#include <functional>
#include <string>

#include "display/sync/mutex.h"

namespace voxeld::display {

// The kernel's limit less what it counts besides our bytes (a sixteenth);
// 16 MiB as the kernel's default if it cannot be read.
size_t ReadUsbfsLimit();

// How to have more, for messages.
std::string UsbfsLimitHint();

// Thread-safe.
class UsbfsBudget {
 public:
  // `room` is called, from any thread, when there is room again after Take had refused.
  UsbfsBudget(size_t limit, std::function<void()> room);

  size_t limit() const { return limit_; }
  bool Take(size_t bytes);
  void Release(size_t bytes);
  // For memory that is kept: all of it together gets half of the limit, so that transfers always find
  // some. No room is told of. Given back by ReleaseLent.
  bool TakeLent(size_t bytes);
  void ReleaseLent(size_t bytes);

 private:
  const size_t limit_;
  const std::function<void()> room_;
  sync::Mutex mutex_;
  size_t taken_ VOXELD_GUARDED_BY(mutex_) = 0;
  size_t lent_ VOXELD_GUARDED_BY(mutex_) = 0;  // of taken_
  bool refused_ VOXELD_GUARDED_BY(mutex_) = false;
};

}  // namespace voxeld::display
