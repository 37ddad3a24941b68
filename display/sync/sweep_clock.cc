#include "display/sync/sweep_clock.h"

#include <algorithm>
#include <cmath>

namespace voxeld::sync {
namespace {

// Shares of an error that correct the phase, and the period per sweep since the previous report.
constexpr double kPhaseGain = 1.0 / 4;
constexpr double kPeriodGain = 1.0 / 32;
// In periods: reports this near are good, and that many in a row are a lock; one this far off is a
// jump.
constexpr double kNear = 1.0 / 16;
constexpr int kToLock = 8;
constexpr double kJump = 1.0 / 4;
constexpr double kJitterShare = 1.0 / 16;
constexpr int kSilentSweeps = 8;
// A device may report anything: values beyond these limits are rejected.
constexpr double kPeriodRange = 4;  // times the nominal period, and its inverse
constexpr uint64_t kMostSweeps = uint64_t{1} << 48;
constexpr TimeNs kSilence = 250 * kMillisecond;  // minimum

}  // namespace

const char* SweepLockName(SweepLock::State state) {
  switch (state) {
    case SweepLock::State::kUnknown:
      return "unknown";
    case SweepLock::State::kLocking:
      return "locking";
    case SweepLock::State::kLocked:
      return "locked";
  }
  return "?";
}

void SweepClock::Restart() {
  const uint64_t losses = lock_.losses;
  lock_ = {};
  lock_.losses = losses;
}

void SweepClock::Lose() {
  const bool locked = lock_.state == SweepLock::State::kLocked;
  Restart();
  if (locked) ++lock_.losses;
}

void SweepClock::Begin(uint64_t number, TimeNs start, TimeNs period) {
  lock_.state = SweepLock::State::kLocking;
  lock_.period_ns = static_cast<double>(period);
  lock_.drift_ppm = (nominal_ns_ / lock_.period_ns - 1) * 1e6;
  base_ = start;
  phase_ = 0;
  number_ = number;
  good_ = 0;
}

void SweepClock::Note(uint64_t number, TimeNs start, TimeNs period) {
  const auto range = [this](double ns) {
    return std::clamp(ns, nominal_ns_ / kPeriodRange, nominal_ns_ * kPeriodRange);
  };
  const auto said = static_cast<double>(period);
  if (said != range(said) || number == 0 || number > kMostSweeps) return;
  if (!known()) return Begin(number, start, period);
  if (number <= number_) return;
  const auto sweeps = static_cast<double>(number - number_);
  const double error = static_cast<double>(start - base_) - Phase(number);
  if (std::abs(error) > kJump * lock_.period_ns) {
    Lose();
    return Begin(number, start, period);
  }
  phase_ = Phase(number) + kPhaseGain * error;
  number_ = number;
  lock_.period_ns = range(lock_.period_ns + kPeriodGain * error / sweeps);
  lock_.drift_ppm = (nominal_ns_ / lock_.period_ns - 1) * 1e6;
  lock_.jitter_ns += kJitterShare * (std::abs(error) - lock_.jitter_ns);
  good_ = std::abs(error) < kNear * lock_.period_ns ? good_ + 1 : 0;
  if (good_ >= kToLock) lock_.state = SweepLock::State::kLocked;
}

void SweepClock::Advance(TimeNs now) {
  if (!known()) return;
  const double silent = static_cast<double>(now - base_) - phase_;
  if (silent > std::max(kSilentSweeps * lock_.period_ns, static_cast<double>(kSilence))) Lose();
}

double SweepClock::Phase(uint64_t number) const {
  const double sweeps = number >= number_ ? static_cast<double>(number - number_)
                                          : -static_cast<double>(number_ - number);
  return phase_ + sweeps * lock_.period_ns;
}

TimeNs SweepClock::StartOf(uint64_t number) const { return base_ + std::llround(Phase(number)); }

uint64_t SweepClock::Nearest(TimeNs at) const {
  const double ahead = (static_cast<double>(at - base_) - phase_) / lock_.period_ns;
  const double number = static_cast<double>(number_) + std::round(ahead);
  return number < 1 ? 1 : static_cast<uint64_t>(number);
}

std::vector<TimeNs> SweepClock::Coming(TimeNs now, int count) const {
  std::vector<TimeNs> starts;
  if (!known() || count <= 0) return starts;
  uint64_t number = Nearest(now);
  while (StartOf(number) <= now) ++number;
  for (int i = 0; i < count; ++i) starts.push_back(StartOf(number + static_cast<uint64_t>(i)));
  return starts;
}

}  // namespace voxeld::sync
