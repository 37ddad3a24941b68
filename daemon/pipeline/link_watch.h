// What went wrong between the daemon and a display's device of late: transfers that failed, and losses of the device,
// from which the display has mostly come back by the time that somebody asks. Single-threaded.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "display/sync/clock.h"

namespace voxeld::daemon {

class LinkWatch {
 public:
  // How long trouble() tells of it, and how seldom Failed has failures told again.
  static constexpr sync::TimeNs kTold = 60 * sync::kSecond;
  static constexpr sync::TimeNs kQuiet = 10 * sync::kSecond;

  // `failed`: transfers since the display was made. How many the log is to be told of now; 0: none, since there are no
  // new ones, or others were told within kQuiet. Those are in the next number, kQuiet after the last.
  uint64_t Failed(uint64_t failed, sync::TimeNs now);
  // The device is lost, or still is, which is told elsewhere; is there, perhaps again.
  void Lost(const std::string& why);
  void There(sync::TimeNs now);

  // For people; empty: all is well.
  std::string trouble(sync::TimeNs now) const;

 private:
  uint64_t failed_ = 0, told_ = 0;
  sync::TimeNs failed_at_ = 0, told_at_ = 0;  // where there is one
  uint64_t losses_ = 0;
  bool lost_ = false;
  std::optional<sync::TimeNs> back_at_;  // from the last loss
  std::string lost_why_;                 // as it was told first
};

}  // namespace voxeld::daemon
