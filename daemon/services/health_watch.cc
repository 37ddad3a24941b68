#include "daemon/services/health_watch.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "display/sync/clock.h"

namespace voxeld::daemon::services {

void HealthWatch::Tell(std::function<void(bool serving)> tell) {
  const sync::MutexLock lock(mutex_);
  tell_ = std::move(tell);
  Changed();
}

void HealthWatch::OnEngine(const EngineEvent& event) {
  const char* what = EngineEventName(event.what);
  if (event.what == EngineEvent::What::kTookOver || event.what == EngineEvent::What::kReturned) {
    const double ms = static_cast<double>(event.took_ns) / sync::kMillisecond;
    log_.Info(what, {{"display", event.display},
                     {"took_ms", absl::StrFormat("%.1f", ms)},
                     {"was_lost", event.why}});
  } else {
    log_.Warn(what, {{"display", event.display}, {"why", event.why}});
  }
  const sync::MutexLock lock(mutex_);
  if (event.what == EngineEvent::What::kHolding) held_.insert(event.display);
  if (event.what == EngineEvent::What::kTookOver || event.what == EngineEvent::What::kNotHeld) {
    held_.erase(event.display);
  }
  Changed();
}

void HealthWatch::OnDisplay(const std::string& display, display::DisplayState state,
                            const std::string& reason) {
  const bool lost = state == display::DisplayState::kLost;
  log_.Log(lost ? Logger::Level::kWarn : Logger::Level::kInfo, display::DisplayStateName(state),
           {{"display", display}, {"why", reason}});
  const sync::MutexLock lock(mutex_);
  if (lost) {
    lost_.insert(display);
  } else if (state != display::DisplayState::kAttaching) {  // still searching: no change
    lost_.erase(display);
  }
  Changed();
}

void HealthWatch::OnTransfers(const std::string& display, uint64_t failed) {
  log_.Warn("transfers failed", {{"display", display},
                                 {"transfers", absl::StrCat(failed)},
                                 {"hint", "look at its cable and power"}});
}

void HealthWatch::Changed() {
  if (tell_ != nullptr) tell_(lost_.empty() && held_.empty());
}

}  // namespace voxeld::daemon::services
