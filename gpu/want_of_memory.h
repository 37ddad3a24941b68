// Who copes with want of memory. Most code cannot: what it was in the middle of would be left half done, and libraries
// that call it back swallow what it throws. Where somebody can, it is said by one of these.
#pragma once

#include <utility>

namespace voxeld::gpu {

// While there is one in a thread, memory that is not to be had is a std::bad_alloc there, which its maker, or who called it,
// catches. Elsewhere in the daemon it is its end (daemon/process/memory_reserve.h).
class WantOfMemory {
 public:
  // Within: while there is one of these, it is the end nevertheless.
  class IsTheEnd {
   public:
    IsTheEnd() : before_(std::exchange(caught_, 0)) {}
    ~IsTheEnd() { caught_ = before_; }
    IsTheEnd(const IsTheEnd&) = delete;
    IsTheEnd& operator=(const IsTheEnd&) = delete;

   private:
    const int before_;
  };

  WantOfMemory() { ++caught_; }
  ~WantOfMemory() { --caught_; }
  WantOfMemory(const WantOfMemory&) = delete;
  WantOfMemory& operator=(const WantOfMemory&) = delete;

  static bool IsCaught() { return caught_ > 0; }

 private:
  static inline constinit thread_local int caught_ = 0;
};

}  // namespace voxeld::gpu
