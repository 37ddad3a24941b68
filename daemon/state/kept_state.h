// What outlives the daemon, as a whole: read into the core before it starts, written from then on.
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
  // In the folder, which is made (mode 0700) if it is not there, in the file state.db. `clock` and `log`
  // outlive it. Errors as of StateFile::Open.
  static absl::StatusOr<std::unique_ptr<KeptState>> Open(const std::string& dir,
                                                         sync::TimeNs interval_ns,
                                                         sync::Clock& clock, Logger& log);

  StateSink* sink() { return &sink_; }
  // From any thread, after Restore.
  StateFigures figures() const { return keeper_ == nullptr ? StateFigures() : keeper_->figures(); }

  // Into a core that has its displays and has not started; it outlives Stop. A file that turns out to be
  // damaged is put aside, and the core begins with nothing. What cannot be had any more is logged.
  absl::Status Restore(Core& core);

  // When the core offers nothing any more: writes what it offered last. What fails is logged.
  void Stop();

 private:
  // What the core is given before there is a keeper.
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
