// When the next of a steady series is due.
#pragma once

#include <cstdint>

#include "display/sync/clock.h"

namespace voxeld::bench {

// The n-th is due at start + n/rate, whatever became of those before: one that comes late moves
// none of the others.
class Pace {
 public:
  // `rate` a second, above 0.
  Pace(sync::TimeNs start, double rate) : start_(start), rate_(rate) {}

  // Of the one that comes next.
  sync::TimeNs due() const { return DueOf(count_); }
  // How many have come due by `now` that were not counted before; they are counted now.
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
