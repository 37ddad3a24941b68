// Runs one script on the real core and on the plain one (core_judge.h), with scripted displays and
// recording engines.
#pragma once

#include <map>
#include <ostream>
#include <string>
#include <vector>

#include "tests/daemon/core/model/core_judge.h"
#include "tests/daemon/fakes/simulation.h"

namespace voxeld::daemon::model {

class ModelRun final : public CoreJudge {
 public:
  // With `trace`, every action and its effects are written to it.
  explicit ModelRun(const Script& script, std::ostream* trace = nullptr);
  ~ModelRun() override;

  // Returns the first error; empty: none.
  std::string Run();

  const OutcomeLedger& ledger() const { return ledger_; }

 private:
  struct Asked {
    PlainScene::Picture picture;
    bool pattern = false;
  };

  Core& core() override { return *sim_.core; }
  sync::FakeClock& clock() override { return sim_.clock; }
  void RunToRest() override { sim_.core->Step(); }
  RandomMessage Compose(Chance& chance, uint64_t last_sequence, uint64_t* next_frame_id) override;
  void OnApplied(const OutcomeLedger::Commit& commit) override { ledger_.Applied(commit); }
  void OnPictured(uint64_t snapshot) override;
  std::string OnTold(uint64_t session, const Receipt& receipt,
                     const CommitOutcome& outcome) override;
  void OnTakenBack(uint64_t session, const Receipt& receipt) override;
  uint64_t Missing(uint64_t session, uint64_t incarnation, std::string* which) const override {
    return ledger_.Missing(session, incarnation, which);
  }
  bool Idle(size_t display) override;

  void OnSubmit(size_t display, uint64_t volume);
  void OnFrame(size_t display, uint64_t volume, const testing::SceneModel& scene);
  static size_t HashOf(const std::string& text);

  // ---- model_actions.cc: the actions on displays
  void RunScript();
  void Do(const Action& action);
  void Advance(sync::TimeNs delta);
  void Show(size_t display);
  void Cable(size_t display);
  void Blank(size_t display, bool blank);
  void Pattern(size_t display, TestPattern pattern);
  void EngineFail(size_t display, bool lost);
  void SetState(size_t display);

  // ---- model_ends.cc
  void Settle();
  void Leave();

  const Script script_;
  OutcomeLedger ledger_;
  std::vector<std::map<uint64_t, Asked>> asked_;
  struct DisplayNow {
    bool attached = false, ever = false, blanked = false, pattern = false;
    std::string armed;  // the engine's next failure
  };
  std::vector<DisplayNow> now_;
  uint64_t happenings_ = 0;  // numbers reasons, so that each is unique
  testing::Simulation sim_;  // declared last, so that it is destroyed first
};

// Runs a script. If there is an error, shrinks the script to few actions that still have one, and
// returns that error with its trace.
std::string RunAndShrink(const Script& script);

}  // namespace voxeld::daemon::model
