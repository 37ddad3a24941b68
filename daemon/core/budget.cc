#include "daemon/core/budget.h"

namespace voxeld::daemon {

bool Budget::Charge(Use use, uint64_t bytes) {
  uint64_t total = total_.load(std::memory_order_relaxed);
  do {
    if (bytes > limit_ || total > limit_ - bytes) return false;
  } while (!total_.compare_exchange_weak(total, total + bytes, std::memory_order_relaxed));
  Of(use).fetch_add(bytes, std::memory_order_relaxed);
  RaisePeak(total + bytes);
  return true;
}

void Budget::ChargeAnyway(Use use, uint64_t bytes) {
  RaisePeak(total_.fetch_add(bytes, std::memory_order_relaxed) + bytes);
  Of(use).fetch_add(bytes, std::memory_order_relaxed);
}

void Budget::Release(Use use, uint64_t bytes) {
  total_.fetch_sub(bytes, std::memory_order_relaxed);
  Of(use).fetch_sub(bytes, std::memory_order_relaxed);
}

void Budget::Move(Use from, Use to, uint64_t bytes) {
  Of(from).fetch_sub(bytes, std::memory_order_relaxed);
  Of(to).fetch_add(bytes, std::memory_order_relaxed);
}

void Budget::Set(Use use, uint64_t bytes) {
  const uint64_t before = Of(use).exchange(bytes, std::memory_order_relaxed);
  // Modulo 2⁶⁴, so less too.
  RaisePeak(total_.fetch_add(bytes - before, std::memory_order_relaxed) + bytes - before);
}

void Budget::RaisePeak(uint64_t total) {
  uint64_t peak = peak_.load(std::memory_order_relaxed);
  while (peak < total && !peak_.compare_exchange_weak(peak, total, std::memory_order_relaxed)) {
  }
}

}  // namespace voxeld::daemon
