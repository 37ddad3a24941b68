// Limits the bytes in flight: Linux's usbfs counts the bytes of all transfers of all programs, and
// refuses what exceeds usbcore.usbfs_memory_mb.
#pragma once

#include <cstddef>
#include <functional>
#include <string>

#include "display/sync/mutex.h"

namespace voxeld::display {

// Returns the kernel's limit minus a sixteenth for what it counts besides our bytes; 16 MiB,
// the kernel's default, if it cannot be read.
size_t ReadUsbfsLimit();

// Explains how to raise the limit, for messages.
std::string UsbfsLimitHint();

// Thread-safe.
class UsbfsBudget {
 public:
  // `room` is called, from any thread, when there is room again after Take had failed.
  UsbfsBudget(size_t limit, std::function<void()> room);

  size_t limit() const { return limit_; }
  bool Take(size_t bytes);
  void Release(size_t bytes);
  // For long-lived memory: all of it together may take half of the limit, so that transfers always
  // find room. `room` is not called for it. Return it with ReleaseLent.
  bool TakeLent(size_t bytes);
  void ReleaseLent(size_t bytes);

 private:
  const size_t limit_;
  const std::function<void()> room_;
  sync::Mutex mutex_;
  size_t taken_ VOXELD_GUARDED_BY(mutex_) = 0;
  size_t lent_ VOXELD_GUARDED_BY(mutex_) = 0;  // part of taken_
  bool refused_ VOXELD_GUARDED_BY(mutex_) = false;
};

}  // namespace voxeld::display
