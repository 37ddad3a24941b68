// Runs one scenario, from the first Open until nothing is held any longer, and checks all
// invariants as it goes: core_judge.h checks the messages to clients, outcome_judge.h the outcomes
// of their commits, eye.h what is seen.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "tests/daemon/core/model/core_judge.h"
#include "tests/simulation/outcome_judge.h"
#include "tests/simulation/scenario.h"
#include "tests/simulation/world.h"

namespace voxeld::simulation {

struct Tally {
  uint64_t turns = 0, commits = 0, outcomes = 0, volumes = 0, pictures_compared = 0;
  uint64_t captures = 0, watched = 0, faults = 0;
  sync::TimeNs time_ns = 0;  // simulated time that passed
  std::map<CommitOutcome::Kind, uint64_t> kinds;
};

class SimulationRun final : public daemon::model::CoreJudge {
 public:
  // With `trace`, every event is written to it.
  explicit SimulationRun(const Scenario& scenario, std::ostream* trace = nullptr);
  ~SimulationRun() override;

  // Returns the first error; empty: none.
  std::string Run();

  Tally tally() const;

 private:
  using Action = daemon::model::Action;
  using Chance = daemon::model::Chance;

  // ---- CoreJudge
  daemon::Core& core() override { return world_->core(); }
  sync::FakeClock& clock() override { return world_->clock(); }
  void RunToRest() override;
  daemon::model::RandomMessage Compose(Chance& chance, uint64_t last_sequence,
                                       uint64_t* next_frame_id) override;
  void OnApplied(const Applied& commit) override;
  void OnPictured(uint64_t snapshot) override;
  std::string OnTold(uint64_t session, const daemon::Receipt& receipt,
                     const CommitOutcome& outcome) override;
  void OnTakenBack(uint64_t session, const daemon::Receipt& receipt) override {
    judge_.TakeBack(session, receipt);
  }
  uint64_t Missing(uint64_t session, uint64_t incarnation, std::string* which) const override {
    return judge_.Missing(session, incarnation, which);
  }
  bool IsOnDisk(uint64_t snapshot) const override { return world_->disk().written() >= snapshot; }
  bool Idle(size_t display) override;

  // ---- simulation_run.cc: events
  sync::TimeNs now() { return world_->clock().Now(); }
  void BeforePipeline(size_t d);
  void AfterPipeline(size_t d);
  void AfterDevice(size_t d);
  void OnSubmit(size_t d, uint64_t volume);
  void OnFrame(size_t d, uint64_t volume, const daemon::testing::SceneModel& scene,
               std::span<const std::byte> bytes);
  void OnEngineFailed(size_t d, uint64_t volume, const absl::Status& status);
  // A disturbance of the display continues, or has just ended.
  void NoteDisturbances(size_t d);
  // Disturbs the display and those that are in genlock with it.
  void Disturb(size_t d, sync::TimeNs until);

  // ---- simulation_actions.cc: actions on displays and on time
  void RunScenario();
  void Do(const Action& action);
  void DoToDisplay(const Action& action, Chance& chance, size_t d);
  void Advance(sync::TimeNs delta);
  void Jump(sync::TimeNs delta);
  void AwaitCertainty();
  void FillMemory(bool full);
  void Cable(size_t d, bool plugged);
  void Lie(size_t d, bool lies, uint32_t seed);
  void Update(size_t d, const daemon::DisplayUpdate& update);
  void Capture(size_t d, Chance& chance);
  void Watch(size_t d);

  // ---- simulation_checks.cc: checks
  // Returns true once a display is showing, and nothing has disturbed it or changed the scene for
  // long enough.
  bool Quiet(size_t d);
  void CheckQuiet();
  void CheckPicture(size_t d);
  void CheckGenlock();
  void CheckUndisturbed();
  void CheckCaptures();
  void OnCaptured(size_t d, size_t capture, const absl::StatusOr<display::DecodedVolume>& volume);
  void OnWatched(size_t d, const absl::StatusOr<display::DecodedVolume>& volume);
  std::string WrongWith(size_t d, const display::DecodedVolume& volume) const;
  void Settle();
  void Leave();

  struct DisplayNow {
    bool plugged = true, blanked = false, lies = false;
    double brightness = 1;
    bool faults_pending = false;
    uint64_t transport_hits = 0;
    display::voxlink::VolumePtr shown;
    daemon::WatchId watch = 0;
    sync::TimeNs watched_since = 0;
    std::optional<Look> watched;
    uint64_t watched_volume = 0;
    sync::TimeNs apart_since =
        0;  // since when a member of a genlock shows something else than the first; 0: it does not
  };
  struct Pending {
    size_t display = 0;
    uint64_t at_least = 0;
    sync::TimeNs asked_ns = 0, deadline = 0;
    bool answered = false;
  };
  struct Pictured {
    uint64_t seen = 0, whole = 0;
  };

  const Scenario scenario_;
  OutcomeJudge judge_;
  std::vector<DisplayNow> now_;
  std::vector<Pending> captures_;
  std::map<uint64_t, Pictured> pictured_;  // by snapshot
  sync::TimeNs changed_ns_ = 0;            // when the newest snapshot was applied
  sync::TimeNs slow_engines_until_ = 0;
  sync::TimeNs started_ns_ = 0;
  Tally tally_;
  std::optional<World> world_;  // declared last, so that it is destroyed first
};

}  // namespace voxeld::simulation
