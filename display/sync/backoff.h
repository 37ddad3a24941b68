// The pause before a retry: doubled after each failure, up to a limit.
#pragma once

#include <algorithm>

#include "display/sync/clock.h"

namespace voxeld::sync {

class Backoff {
 public:
  constexpr Backoff(TimeNs first, TimeNs longest) : first_(first), longest_(longest) {}

  // Returns the pause after one more failure.
  TimeNs Next() {
    pause_ = pause_ == 0 ? first_ : std::min(2 * pause_, longest_);
    return pause_;
  }
  void Reset() { pause_ = 0; }
  TimeNs first() const { return first_; }

 private:
  TimeNs first_, longest_;
  TimeNs pause_ = 0;
};

}  // namespace voxeld::sync
