// A core and the plain model, side by side: the actions of clients and operators are applied to
// both, and what the core reports and publishes is followed as it happens and must be what the
// model says. The core may choose the order between sessions, within the rules; everything else is
// determined. The derived class says which displays there are and what the outcomes of commits on
// them are.
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
#include "display/sync/fake_clock.h"
#include "tests/daemon/core/model/actions.h"
#include "tests/daemon/core/model/outcome_ledger.h"
#include "tests/daemon/core/model/plain_core.h"

namespace voxeld::daemon::model {

class CoreJudge {
 public:
  virtual ~CoreJudge() = default;

  const PlainCore::Figures& figures() const { return plain_.figures; }
  // A hash of every event: the same seed gives the same hash.
  uint64_t trace_hash() const { return trace_hash_; }

 protected:
  struct Stream;
  struct Sink final : SessionSink {
    Sink(CoreJudge* run, Stream* stream) : run(run), stream(stream) {}
    void OnIssue(const Issue& issue) override { run->OnIssue(*stream, issue); }
    void OnReceipt(const Receipt& receipt) override { run->OnReceipt(*stream, receipt); }
    void OnCredit(uint64_t total) override { run->OnCredit(*stream, total); }
    void OnRoom() override { ++stream->rooms; }
    void OnEnded(const absl::Status&) override { run->OnEnded(*stream); }
    bool Crowded() const override { return crowded; }

    CoreJudge* const run;
    Stream* const stream;
    bool crowded = false;
  };
  // One Open and its results.
  struct Stream {
    std::shared_ptr<Sink> sink;
    OpenOptions options;
    SessionInfo info;
    bool opening = false;
    bool open = false;
    bool gone = false;     // its client receives nothing any longer
    bool may_end = false;  // an action may end it
    bool ended = false;
    uint64_t last_sequence = 0, next_frame_id = 0;
    uint64_t told_credit = 0;
    bool waits_for_room = false;
    int rooms = 0;
    std::vector<Issue> issues;      // not accounted for yet
    std::vector<Receipt> outcomes;  // reported outcomes
  };

  // With `trace`, every action and its effects are written to it.
  CoreJudge(const Limits& limits, std::vector<std::string> displays, std::ostream* trace);

  // ---- defined by the derived class
  virtual Core& core() = 0;
  virtual sync::FakeClock& clock() = 0;
  // Does everything that is due at this time.
  virtual void RunToRest() = 0;
  virtual RandomMessage Compose(Chance& chance, uint64_t last_sequence,
                                uint64_t* next_frame_id) = 0;
  virtual void OnApplied(const OutcomeLedger::Commit& commit) = 0;
  // The scene of that snapshot is now plain_.scene.
  virtual void OnPictured(uint64_t snapshot) = 0;
  // Returns what is wrong with an outcome that was reported to a session; empty: nothing.
  virtual std::string OnTold(uint64_t session, const Receipt& receipt,
                             const CommitOutcome& outcome) = 0;
  virtual void OnTakenBack(uint64_t session, const Receipt& receipt) = 0;
  // Returns the number of outcomes of this incarnation of the session that were not reported;
  // describes the first in `which`.
  virtual uint64_t Missing(uint64_t session, uint64_t incarnation, std::string* which) const = 0;
  // Returns whether the persistent part of that snapshot, or of a newer one, has been written.
  virtual bool IsOnDisk(uint64_t /*snapshot*/) const { return false; }
  // Returns whether a display is showing and has nothing to do: then no outcome on it is
  // outstanding.
  virtual bool Idle(size_t display) = 0;

  // ---- core_judge.cc: the core's actions
  void OnIssue(Stream& stream, const Issue& issue);
  void OnReceipt(Stream& stream, const Receipt& receipt);
  void OnOutcome(Stream& stream, const Receipt& receipt, const CommitOutcome& outcome);
  void OnDurable(Stream& stream, const Receipt& receipt, const Durable& durable);
  void OnCredit(Stream& stream, uint64_t total);
  void OnEnded(Stream& stream);
  void OnPublished();

  void Begin();  // the core has been started
  // Must be called first in a derived destructor: from then on, nothing is judged.
  void Over();
  void Fail(std::string what);
  void Trace(const std::string& line);
  PlainSession* SessionOf(const Stream& stream);
  bool IsLive(const Stream* stream);
  // Returns false if not all outcomes of the session are seen: it asks for none, or some came while
  // it was dormant.
  static bool Certain(const PlainSession& session);
  void CheckTurn(PlainSession& session, uint64_t sequence);
  void CheckIssues(Stream& stream, const PlainTurn& turn);
  void CheckAccepted(const PlainSession& session, const PlainTurn& turn, const Accepted& accepted);
  void Note(const PlainSession& session, const PlainTurn& turn, uint64_t snapshot);
  void ExpectIssues(Stream& stream, const std::vector<Refusal>& expected);

  // An effect of the core without a receipt, in the core's order. Its function returns true if it
  // makes a new snapshot.
  struct Effect {
    uint64_t id = 0;
    std::function<bool(uint64_t snapshot)> run;
  };
  uint64_t AddEffect(std::function<bool(uint64_t snapshot)> run);
  std::function<bool(uint64_t)> Changing(std::function<void()> change);
  bool RunEffect();
  void RunEffects(uint64_t id);   // up to that one
  void Explain(uint64_t before);  // snapshots before that number
  void AddTurns(uint64_t session);
  void AddFinish(uint64_t session, bool turns);

  // ---- judge_checks.cc: the checks when the core is at rest
  void Step();
  void CheckAtRest();
  void CheckScene();
  void CheckStreams();
  void CheckOwners();
  void CheckStats();
  Stats AskStats();

  // ---- judge_actions.cc, judge_ends.cc: the actions on the core
  // Returns true if the action was one of clients or operators.
  bool Act(const Action& action, Chance& chance);
  void Open(uint32_t place, OpenOptions options);
  void Resume(uint32_t place, Chance& chance);
  void Send(uint32_t place, Chance& chance, bool step);
  void Close(uint32_t place, bool gone, uint32_t given_back);
  void Crowd(Stream& stream, bool crowded);
  void PassTime();  // the clock has moved
  void ClearLayer(uint64_t owner, const std::string& layer, bool keep_state);
  void Control(OwnerControl control);

  void EverybodyReads();
  void EverybodyLeaves();  // all sessions end
  void EvictEverybody();   // and their persistent layers are removed
  // Checks that nothing is charged for clients any longer, and that every outcome is accounted for.
  void CheckNothingIsHeld(uint64_t owed, uint64_t told);
  // Checks that everything is shown: no client waits, and no outcome is outstanding.
  void CheckNobodyWaits();
  // Stops the core while sessions are open.
  void StopInTheMiddle();

  const Limits limits_;
  const std::vector<std::string> displays_;
  std::ostream* const trace_;
  uint64_t trace_hash_ = 0xCBF29CE484222325;
  std::string wrong_;
  PlainCore plain_;
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
  uint64_t owed_unit_ = 0;  // bytes that a pending outcome takes
  std::set<std::tuple<uint64_t, uint64_t, uint64_t, std::string>> given_back_;
  // Session, incarnation and sequence of commits that must be reported DURABLE: their snapshots.
  std::map<std::tuple<uint64_t, uint64_t, uint64_t>, uint64_t> undurable_;
  uint64_t durables_owed_ = 0, durables_told_ = 0;
};

}  // namespace voxeld::daemon::model
