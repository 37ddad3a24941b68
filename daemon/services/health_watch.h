// Determines the health status: whether every display is connected and drawn. Also logs changes.
#pragma once

#include <functional>
#include <set>
#include <string>

#include "daemon/log/logger.h"
#include "daemon/pipeline/engine_event.h"
#include "display/api/outcome.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::services {

// Thread-safe.
class HealthWatch {
 public:
  explicit HealthWatch(Logger& log) : log_(log) {}

  // Calls `tell` at once and on every change: with false while a display is lost, or while its last
  // volume is held because nothing is drawn. It must not call back. Null removes it; this returns
  // when no call is in progress.
  void Tell(std::function<void(bool serving)> tell);

  void OnEngine(const EngineEvent& event);
  void OnDisplay(const std::string& display, display::DisplayState state,
                 const std::string& reason);
  // Transfers to the display's device failed. Only logged, because the display is still connected.
  void OnTransfers(const std::string& display, uint64_t failed);

 private:
  void Changed() VOXELD_REQUIRES(mutex_);

  Logger& log_;
  sync::Mutex mutex_;
  std::set<std::string> lost_ VOXELD_GUARDED_BY(mutex_), held_ VOXELD_GUARDED_BY(mutex_);
  std::function<void(bool)> tell_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace voxeld::daemon::services
