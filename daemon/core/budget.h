// What is held for clients, in bytes: one limit for everything that a client can make the daemon keep.
//
// Thread-safe, without locks: what is charged past the limit is not charged at all, and the caller refuses or waits.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace voxeld::daemon {

class Budget {
 public:
  enum class Use : uint8_t {
    kScene,     // retained
    kStaged,    // of commits that have not come yet
    kWaiting,   // of commits that wait for their turn or their time
    kAnswers,   // receipts and issues that have not been read
    kOwed,      // outcomes that are to come, or kept for a resume
    kEngines,   // device memory included
    kLocal,     // sealed memory that local sockets hold
    kArriving,  // messages that are being read
  };
  static constexpr size_t kUses = 8;

  explicit Budget(uint64_t limit_bytes) : limit_(limit_bytes) {}
  Budget(const Budget&) = delete;
  Budget& operator=(const Budget&) = delete;

  uint64_t limit_bytes() const { return limit_; }
  uint64_t used_bytes() const { return total_.load(std::memory_order_relaxed); }
  uint64_t used_bytes(Use use) const { return Of(use).load(std::memory_order_relaxed); }
  // The greatest used_bytes() since the last call, however short it lasted. For one thread.
  uint64_t TakePeakBytes() { return peak_.exchange(used_bytes(), std::memory_order_relaxed); }

  // False, and nothing is charged, if it would go past the limit.
  bool Charge(Use use, uint64_t bytes);
  // What is held whatever the limit says: it is there already.
  void ChargeAnyway(Use use, uint64_t bytes);
  void Release(Use use, uint64_t bytes);
  void Move(Use from, Use to, uint64_t bytes);
  // For uses that are measured, not charged. One thread a use.
  void Set(Use use, uint64_t bytes);

  // An engine has drawn a scene that was expected to take at most `bytes` (OwnerTally::derived), and measured it (kEngines).
  // `before`: its last value, which this replaces.
  void ReplaceDerived(uint64_t before, uint64_t bytes) {
    derived_.fetch_add(bytes - before, std::memory_order_relaxed);  // modulo 2⁶⁴, so less too
  }
  uint64_t derived_bytes() const { return derived_.load(std::memory_order_relaxed); }

 private:
  std::atomic<uint64_t>& Of(Use use) { return uses_[static_cast<size_t>(use)]; }
  const std::atomic<uint64_t>& Of(Use use) const { return uses_[static_cast<size_t>(use)]; }

  void RaisePeak(uint64_t total);

  const uint64_t limit_;
  std::atomic<uint64_t> total_ = 0, peak_ = 0, derived_ = 0;
  std::array<std::atomic<uint64_t>, kUses> uses_ = {};
};

}  // namespace voxeld::daemon
