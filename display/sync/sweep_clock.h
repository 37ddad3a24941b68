// When a device's sweeps begin: a phase-locked loop on what the device says of them.
//
// A screen or motor has a speed of its own, the device's clock another drift than ours, and its word arrives late by a little
// each time. So what it says is not taken as it is but pulls at an estimate of phase and period (a loop of second order, damped
// by 0.7), which goes on between reports and through lost ones. A phase that jumps, or silence, is a lock lost: that is
// counted, and the estimate starts anew.
//
// Single-threaded; times are the owner's clock.
#pragma once

#include <cstdint>
#include <vector>

#include "display/sync/clock.h"

namespace voxeld::sync {

// As reported by a display with a sweep.
struct SweepLock {
  enum class State : uint8_t {
    kUnknown,  // nothing has been said of sweeps, or not for a while
    kLocking,  // predicted from a few reports
    kLocked,
  };
  State state = State::kUnknown;
  double period_ns = 0;  // 0: unknown
  double drift_ppm = 0;  // of the rate, against the nominal one: above 0 it is fast
  double jitter_ns = 0;  // mean distance of late between reports and the estimate
  uint64_t losses = 0;   // of lock, since the beginning
};

const char* SweepLockName(SweepLock::State state);

class SweepClock {
 public:
  // `nominal_ns`: the period that the device should have, above 0.
  explicit SweepClock(double nominal_ns) : nominal_ns_(nominal_ns) {}

  // A new session of the device: nothing is known. Not a loss; what was counted stays.
  void Restart();
  // Sweep `number` began at `start`, says the device, and has that period. Numbers ascend, with gaps.
  void Note(uint64_t number, TimeNs start, TimeNs period);
  // Time has passed: a device that has said nothing for long is not known any more.
  void Advance(TimeNs now);

  const SweepLock& lock() const { return lock_; }
  bool known() const { return lock_.state != SweepLock::State::kUnknown; }

  // All only while known.
  TimeNs StartOf(uint64_t number) const;
  // The sweep that begins nearest to `at`, at least 1.
  uint64_t Nearest(TimeNs at) const;
  // The starts of the next `count` sweeps after `now`.
  std::vector<TimeNs> Coming(TimeNs now, int count) const;

 private:
  void Begin(uint64_t number, TimeNs start, TimeNs period);
  void Lose();
  double Phase(uint64_t number) const;

  const double nominal_ns_;
  SweepLock lock_;
  TimeNs base_ = 0;   // phases count from here
  double phase_ = 0;  // of number_
  uint64_t number_ = 0;
  int good_ = 0;  // reports in a row that were near
};

}  // namespace voxeld::sync
