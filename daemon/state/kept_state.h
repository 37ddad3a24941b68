// The persistent state as a whole: restored into the core before it starts, then written
// continuously.
//
//   auto state = KeptState::Open(dir, …);
//   Core core({.state = (*state)->sink(), …});
//   (*state)->Restore(core);  // after AddDisplay
//   core.Start(); … core.Stop();
//   (*state)->Stop();
#pragma once

#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "daemon/core/core.h"
#include "daemon/log/logger.h"
#include "daemon/state/keeper.h"
#include "daemon/state/state_file.h"
#include "display/sync/clock.h"

namespace voxeld::daemon::state {

class KeptState {
 public:
  // Opens the file state.db in `dir`, which is created (mode 0700) if it does not exist. `clock`
  // and `log` must outlive this object. Errors: as for StateFile::Open.
  static absl::StatusOr<std::unique_ptr<KeptState>> Open(const std::string& dir,
                                                         sync::TimeNs interval_ns,
                                                         sync::Clock& clock, Logger& log);

  StateSink* sink() { return &sink_; }
  // May be called from any thread after Restore.
  StateFigures figures() const { return keeper_ == nullptr ? StateFigures() : keeper_->figures(); }

  // Restores into a core that has its displays and has not started. The core must outlive Stop. A
  // damaged file is moved aside, and the core starts empty. Entities and objects that cannot be
  // restored are logged.
  absl::Status Restore(Core& core);

  // Call when the core offers no more snapshots. Writes the last offered one; logs errors.
  void Stop();

 private:
  // The sink that the core uses before the keeper exists.
  struct Sink final : StateSink {
    void Offer(SnapshotPtr snapshot, std::shared_ptr<const OwnerRecords> owners,
               bool at_once) override {
      if (to != nullptr) to->Offer(std::move(snapshot), std::move(owners), at_once);
    }
    StateSink* to = nullptr;
  };

  KeptState(sync::TimeNs interval_ns, sync::Clock& clock, Logger& log)
      : interval_ns_(interval_ns), clock_(clock), log_(log) {}

  const sync::TimeNs interval_ns_;
  sync::Clock& clock_;
  Logger& log_;
  std::unique_ptr<StateFile> file_;
  Sink sink_;
  std::unique_ptr<Keeper> keeper_;
};

}  // namespace voxeld::daemon::state
