// Predicts when a device's sweeps begin: a phase-locked loop on the device's reports.
//
// A screen or motor has its own speed, the device's clock drifts differently from ours, and its
// reports arrive a little late each time. So a report is not used directly but corrects an estimate
// of phase and period (a second-order loop, damped by 0.7), which continues between reports and
// through lost ones. A phase jump, or silence, is a lost lock: it is counted, and the estimate
// restarts.
//
// Single-threaded; times are those of the owner's clock.
#pragma once

#include <cstdint>
#include <vector>

#include "display/sync/clock.h"

namespace voxeld::sync {

// The state reported by a display with a sweep.
struct SweepLock {
  enum class State : uint8_t {
    kUnknown,  // no sweep reports so far, or none lately
    kLocking,  // predicted from a few reports
    kLocked,
  };
  State state = State::kUnknown;
  double period_ns = 0;  // 0: unknown
  double drift_ppm = 0;  // deviation of the rate from the nominal one: above 0 it is fast
  double jitter_ns = 0;  // recent mean distance between reports and the estimate
  uint64_t losses = 0;   // times that the lock was lost
};

const char* SweepLockName(SweepLock::State state);

class SweepClock {
 public:
  // `nominal_ns`: the device's nominal period, above 0.
  explicit SweepClock(double nominal_ns) : nominal_ns_(nominal_ns) {}

  // Starts a new session of the device: nothing is known. It does not count as a loss; counts are
  // kept.
  void Restart();
  // The device reports that sweep `number` began at `start`, with that period. Numbers ascend, with
  // gaps.
  void Note(uint64_t number, TimeNs start, TimeNs period);
  // Time has passed: after a long silence the device's sweeps become unknown.
  void Advance(TimeNs now);

  const SweepLock& lock() const { return lock_; }
  bool known() const { return lock_.state != SweepLock::State::kUnknown; }

  // The following require that sweeps are known.
  TimeNs StartOf(uint64_t number) const;
  // Returns the sweep that begins nearest to `at`, at least 1.
  uint64_t Nearest(TimeNs at) const;
  // Returns the starts of the next `count` sweeps after `now`.
  std::vector<TimeNs> Coming(TimeNs now, int count) const;

 private:
  void Begin(uint64_t number, TimeNs start, TimeNs period);
  void Lose();
  double Phase(uint64_t number) const;

  const double nominal_ns_;
  SweepLock lock_;
  TimeNs base_ = 0;   // phases count from here
  double phase_ = 0;  // phase of number_
  uint64_t number_ = 0;
  int good_ = 0;  // consecutive near reports
};

}  // namespace voxeld::sync
