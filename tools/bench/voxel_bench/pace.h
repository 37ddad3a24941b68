// Says when the next event of a steady series is due.
#pragma once

#include <cstdint>

#include "display/sync/clock.h"

namespace voxeld::bench {

// Event n is due at start + n/rate, independent of the events before it: a late event does not
// delay the others.
class Pace {
 public:
  // `rate` is per second and positive.
  Pace(sync::TimeNs start, double rate) : start_(start), rate_(rate) {}

  // Returns when the next event is due.
  sync::TimeNs due() const { return DueOf(count_); }
  // Returns how many events became due by `now` that were not counted before, and counts them.
  uint64_t Take(sync::TimeNs now);

  uint64_t count() const { return count_; }

 private:
  sync::TimeNs DueOf(uint64_t index) const {
    return start_ + static_cast<sync::TimeNs>(static_cast<double>(index) * sync::kSecond / rate_);
  }

  const sync::TimeNs start_;
  const double rate_;
  uint64_t count_ = 0;
};

}  // namespace voxeld::bench
