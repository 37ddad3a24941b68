#include "daemon/pipeline/link_watch.h"

#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon {

uint64_t LinkWatch::Failed(uint64_t failed, sync::TimeNs now) {
  if (failed != failed_) {
    failed_ = failed;
    failed_at_ = now;
  }
  if (failed_ == told_ || (told_ > 0 && now - told_at_ < kQuiet)) return 0;
  const uint64_t fresh = failed_ - told_;
  told_ = failed_;
  told_at_ = now;
  return fresh;
}

void LinkWatch::Lost(const std::string& why) {
  if (lost_) return;
  lost_ = true;
  ++losses_;
  back_at_.reset();
  lost_why_ = why;
}

void LinkWatch::There(sync::TimeNs now) {
  if (std::exchange(lost_, false)) back_at_ = now;
}

std::string LinkWatch::trouble(sync::TimeNs now) const {
  std::string text;
  if (back_at_.has_value() && now - *back_at_ < kTold) {
    text = absl::StrCat("the device was lost (", lost_why_, ") and came back ",
                        (now - *back_at_) / sync::kSecond,
                        " s ago; losses since the start: ", losses_);
  }
  if (failed_ > 0 && now - failed_at_ < kTold) {
    absl::StrAppend(&text, text.empty() ? "" : "; ", "transfers failed ",
                    (now - failed_at_) / sync::kSecond, " s ago (since the start: ", failed_, ")");
  }
  return text;
}

}  // namespace voxeld::daemon
