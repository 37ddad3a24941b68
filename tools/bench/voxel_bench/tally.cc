#include "tools/bench/voxel_bench/tally.h"

namespace voxeld::bench {

void Tally::Told(const v1::Receipt& receipt) {
  switch (receipt.what_case()) {
    case v1::Receipt::kAccepted:
      ++accepted;
      owed += static_cast<uint64_t>(receipt.accepted().displays_size());
      refused_operations += receipt.accepted().refused_operations();
      dropped_frames += receipt.accepted().dropped_frames();
      break;
    case v1::Receipt::kRefused:
      ++refused;
      break;
    case v1::Receipt::kOutcome:
      switch (receipt.outcome().what_case()) {
        case v1::Outcome::kPresented:
          ++presented;
          break;
        case v1::Outcome::kUnchanged:
          ++unchanged;
          break;
        case v1::Outcome::kSuperseded:
          ++superseded;
          break;
        case v1::Outcome::kLost:
          ++lost;
          break;
        case v1::Outcome::kNotShown:
          ++not_shown;
          break;
        case v1::Outcome::WHAT_NOT_SET:
          break;
      }
      break;
    case v1::Receipt::kScheduled:
    case v1::Receipt::kDurable:
    case v1::Receipt::WHAT_NOT_SET:
      break;
  }
}

Tally& Tally::operator+=(const Tally& other) {
  sent += other.sent;
  accepted += other.accepted;
  refused += other.refused;
  refused_operations += other.refused_operations;
  issues += other.issues;
  dropped_frames += other.dropped_frames;
  owed += other.owed;
  presented += other.presented;
  unchanged += other.unchanged;
  superseded += other.superseded;
  lost += other.lost;
  not_shown += other.not_shown;
  return *this;
}

}  // namespace voxeld::bench
