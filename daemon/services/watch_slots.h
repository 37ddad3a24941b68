// A limited number of slots for watches, which may last for any time.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::services {

// Thread-safe. Must outlive its slots.
class WatchSlots {
 public:
  // One slot, held until it is released or destroyed. Not thread-safe.
  class Slot {
   public:
    Slot() = default;
    Slot(Slot&& other) noexcept { *this = std::move(other); }
    Slot& operator=(Slot&& other) noexcept {
      Release();
      slots_ = std::exchange(other.slots_, nullptr);
      who_ = std::move(other.who_);
      return *this;
    }
    ~Slot() { Release(); }

    void Release() {
      if (slots_ != nullptr) std::exchange(slots_, nullptr)->GiveBack(who_);
    }

   private:
    friend class WatchSlots;
    Slot(WatchSlots* slots, std::string who) : slots_(slots), who_(std::move(who)) {}

    WatchSlots* slots_ = nullptr;
    std::string who_;
  };

  // `what` describes what is watched. The setting `limit` allows `most` watches at once.
  WatchSlots(std::string_view what, std::string_view limit, uint32_t most)
      : what_(what), limit_(limit), most_(most) {}
  WatchSlots(const WatchSlots&) = delete;
  WatchSlots& operator=(const WatchSlots&) = delete;

  // Errors: ResourceExhausted if all slots are taken, or if `who` (Caller::who) holds three
  // quarters of them, rounded up.
  absl::StatusOr<Slot> Take(const std::string& who) {
    sync::MutexLock lock(mutex_);
    const uint32_t share = (most_ * 3 + 3) / 4;
    const auto has = taken_by_.find(who);
    if (taken_ >= most_) {
      return absl::ResourceExhaustedError(absl::StrCat(most_, " watches of ", what_,
                                                       " are open, which is ", limit_,
                                                       "; try again when one has ended"));
    }
    if (has != taken_by_.end() && has->second >= share) {
      return absl::ResourceExhaustedError(absl::StrCat(who, " has ", share, " watches of ", what_,
                                                       " open, which is three quarters of ", limit_,
                                                       "; end one of them first"));
    }
    ++taken_;
    ++taken_by_[who];
    return Slot(this, who);
  }

 private:
  void GiveBack(const std::string& who) {
    sync::MutexLock lock(mutex_);
    --taken_;
    const auto has = taken_by_.find(who);
    if (--has->second == 0) taken_by_.erase(has);
  }

  const std::string what_, limit_;
  const uint32_t most_;
  sync::Mutex mutex_;
  uint32_t taken_ VOXELD_GUARDED_BY(mutex_) = 0;
  std::map<std::string, uint32_t> taken_by_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace voxeld::daemon::services
