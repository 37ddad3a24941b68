// A display with its current options, which shows a test pattern.
#pragma once

#include <memory>
#include <optional>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "daemon/config/display_config.h"
#include "daemon/core/core.h"
#include "display/drivers/driver_context.h"
#include "display/sync/clock.h"

namespace voxeld::voxelctl {

class Trial {
 public:
  // Opens the display and shows the pattern. Errors: InvalidArgument if the options do not describe
  // a display; Unavailable with the reason if it does not show the pattern within `limit`.
  static absl::StatusOr<std::unique_ptr<Trial>> Start(const daemon::DisplayConfig& display,
                                                      const display::DriverContext& context,
                                                      daemon::TestPattern pattern,
                                                      sync::TimeNs limit);
  // Closes the display.
  ~Trial();
  Trial(const Trial&) = delete;
  Trial& operator=(const Trial&) = delete;

  const display::DisplayInfo& info() const { return info_; }
  absl::Status Show(daemon::TestPattern pattern);

 private:
  Trial(display::DisplayInfo info, sync::Clock& clock);

  const display::DisplayInfo info_;
  daemon::Core core_;
};

}  // namespace voxeld::voxelctl
