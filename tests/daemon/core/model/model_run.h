// One script on the real core and on the plain one, side by side: what the core tells, publishes and
// has drawn is followed as it happens and must be what the model says. Order between sessions is
// the core's to choose, within the rules; everything else is not.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <ostream>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "daemon/core/scene_watch.h"
#include "tests/daemon/core/model/actions.h"
#include "tests/daemon/core/model/outcome_ledger.h"
#include "tests/daemon/core/model/plain_core.h"
#include "tests/daemon/fakes/simulation.h"

namespace voxeld::daemon::model {

class ModelRun {
 public:
  // With `trace` every action and what it brings about is written there.
  explicit ModelRun(const Script& script, std::ostream* trace = nullptr);
  ~ModelRun();

  // The first thing that was wrong; empty: nothing.
  std::string Run();

  const OutcomeLedger& ledger() const { return ledger_; }
  const PlainCore::Figures& figures() const { return plain_.figures; }

 private:
  struct Stream;
  struct Sink final : SessionSink {
    Sink(ModelRun* run, Stream* stream) : run(run), stream(stream) {}
    void OnIssue(const Issue& issue) override { run->OnIssue(*stream, issue); }
    void OnReceipt(const Receipt& receipt) override { run->OnReceipt(*stream, receipt); }
    void OnCredit(uint64_t total) override { run->OnCredit(*stream, total); }
    void OnRoom() override { ++stream->rooms; }
    void OnEnded(const absl::Status&) override { run->OnEnded(*stream); }
    bool Crowded() const override { return crowded; }

    ModelRun* const run;
    Stream* const stream;
    bool crowded = false;
  };
  // One Open and what came of it.
  struct Stream {
    std::shared_ptr<Sink> sink;
    OpenOptions options;
    SessionInfo info;
    bool opening = false;
    bool open = false;
    bool gone = false;     // its client hears nothing any more
    bool may_end = false;  // somebody ends it
    bool ended = false;
    uint64_t last_sequence = 0, next_frame_id = 0;
    uint64_t told_credit = 0;
    bool waits_for_room = false;
    int rooms = 0;
    std::vector<Issue> issues;      // not accounted for yet
    std::vector<Receipt> outcomes;  // told
  };
  // What the core does without a receipt, in its order: true if that makes a new snapshot.
  struct Effect {
    uint64_t id = 0;
    std::function<bool(uint64_t snapshot)> run;
  };
  struct Asked {
    PlainScene::Picture picture;
    bool pattern = false;
  };

  // ---- model_run.cc: what the core does
  void OnIssue(Stream& stream, const Issue& issue);
  void OnReceipt(Stream& stream, const Receipt& receipt);
  void OnOutcome(Stream& stream, const Receipt& receipt, const CommitOutcome& outcome);
  void OnCredit(Stream& stream, uint64_t total);
  void OnEnded(Stream& stream);
  void OnPublished();
  void OnSubmit(size_t display, uint64_t volume);
  void OnFrame(size_t display, uint64_t volume, const testing::SceneModel& scene);

  static size_t HashOf(const std::string& text);
  void Fail(std::string what);
  void Trace(const std::string& line);
  PlainSession* SessionOf(const Stream& stream);
  // Outcomes of a session that asks for none are not seen, nor those that came while it was dormant.
  static bool Certain(const PlainSession& session);
  void CheckTurn(PlainSession& session);
  void CheckIssues(Stream& stream, const PlainTurn& turn);
  void Note(const PlainSession& session, const PlainTurn& turn, uint64_t snapshot);
  void ExpectIssues(Stream& stream, const std::vector<Refusal>& expected);

  uint64_t AddEffect(std::function<bool(uint64_t snapshot)> run);
  std::function<bool(uint64_t)> Changing(std::function<void()> change);
  bool RunEffect();
  void RunEffects(uint64_t id);   // up to that one
  void Explain(uint64_t before);  // snapshots before that number
  void AddTurns(uint64_t session);
  void AddFinish(uint64_t session, bool turns);

  // ---- model_checks.cc: what must hold when the core has come to rest
  void Step();
  void CheckAtRest();
  void CheckScene();
  void CheckStreams();
  void CheckOwners();
  void CheckStats();

  // ---- model_actions.cc: what is done to the core
  void RunScript();
  void Do(const Action& action);
  void Open(uint32_t place, OpenOptions options);
  void Resume(uint32_t place, Chance& chance);
  void Send(uint32_t place, Chance& chance, bool step);
  void Close(uint32_t place, bool gone, uint32_t given_back);
  void Crowd(Stream& stream, bool crowded);
  void Advance(sync::TimeNs delta);
  void Show(size_t display);
  void Cable(size_t display);
  void Blank(size_t display, bool blank);
  void Pattern(size_t display, TestPattern pattern);
  void EngineFail(size_t display, bool lost);
  void ClearLayer(uint64_t owner, const std::string& layer, bool keep_state);
  void Control(OwnerControl control);
  void SetState(size_t display);

  // ---- model_ends.cc
  void Settle();
  void EverybodyLeaves();
  void StopInTheMiddle();

  const Script script_;
  std::ostream* const trace_;
  std::string wrong_;
  PlainCore plain_;
  OutcomeLedger ledger_;
  std::vector<std::unique_ptr<Stream>> streams_;
  Stream* places_[kPlaces] = {};
  std::vector<std::string> tokens_;  // given so far
  std::deque<Effect> effects_;
  uint64_t next_effect_ = 1;
  std::deque<uint64_t> published_;  // snapshots that nothing has explained yet
  uint64_t seen_ = 0;               // newest snapshot
  uint64_t checked_ = 0;            // whose scene was compared
  int replies_due_ = 0;
  bool stopping_ = false;
  std::set<std::tuple<uint64_t, uint64_t, uint64_t, std::string>> given_back_;
  std::vector<std::map<uint64_t, Asked>> asked_;
  struct DisplayNow {
    bool attached = false, ever = false, blanked = false, pattern = false;
    std::string armed;  // the engine's next failure
  };
  std::vector<DisplayNow> now_;
  uint64_t happenings_ = 0;  // numbers reasons, so that each is its own
  uint64_t owed_unit_ = 0;   // bytes that an outcome weighs
  testing::Simulation sim_;  // last: it goes first
};

// Runs a script; where something is wrong, cuts it down to few actions with which something still
// is, and answers that with its trace.
std::string RunAndShrink(const Script& script);

}  // namespace voxeld::daemon::model
