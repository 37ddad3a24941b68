#include "tools/bench/voxel_bench/pace.h"

namespace voxeld::bench {

uint64_t Pace::Take(sync::TimeNs now) {
  const uint64_t before = count_;
  if (now < due()) return 0;
  // The division gives an approximate count; due() then makes it exact.
  const double elapsed = static_cast<double>(now - start_);
  count_ += static_cast<uint64_t>(elapsed / sync::kSecond * rate_) - count_;
  if (count_ < before) count_ = before;
  while (count_ > before && DueOf(count_ - 1) > now) --count_;
  while (due() <= now) ++count_;
  return count_ - before;
}

}  // namespace voxeld::bench
