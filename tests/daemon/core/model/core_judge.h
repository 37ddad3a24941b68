// A core and the plain one, side by side: what clients and operators do is done to both, and what the core tells and
// publishes is followed as it happens and must be what the model says. Order between sessions is the core's to
// choose, within the rules; everything else is not. Who derives says what displays there are and what becomes of
// commits on them.
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
  // Of all that happened: the same seed gives the same.
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

  // With `trace` every action and what it brings about is written there.
  CoreJudge(const Limits& limits, std::vector<std::string> displays, std::ostream* trace);

  // ---- what derives says
  virtual Core& core() = 0;
  virtual sync::FakeClock& clock() = 0;
  // Does all that is due at this time.
  virtual void RunToRest() = 0;
  virtual RandomMessage Compose(Chance& chance, uint64_t last_sequence,
                                uint64_t* next_frame_id) = 0;
  virtual void OnApplied(const OutcomeLedger::Commit& commit) = 0;
  // The scene of that snapshot is now plain_.scene.
  virtual void OnPictured(uint64_t snapshot) = 0;
  // What is wrong with an outcome that a session was told; empty: nothing.
  virtual std::string OnTold(uint64_t session, const Receipt& receipt,
                             const CommitOutcome& outcome) = 0;
  virtual void OnTakenBack(uint64_t session, const Receipt& receipt) = 0;
  // Outcomes of this incarnation of the session that were not told; the first is described.
  virtual uint64_t Missing(uint64_t session, uint64_t incarnation, std::string* which) const = 0;
  // Whether what is kept of that snapshot, or of a newer one, has been written.
  virtual bool IsOnDisk(uint64_t /*snapshot*/) const { return false; }
  // Whether a display shows and has nothing to do: then nobody is owed an outcome on it.
  virtual bool Idle(size_t display) = 0;

  // ---- core_judge.cc: what the core does
  void OnIssue(Stream& stream, const Issue& issue);
  void OnReceipt(Stream& stream, const Receipt& receipt);
  void OnOutcome(Stream& stream, const Receipt& receipt, const CommitOutcome& outcome);
  void OnDurable(Stream& stream, const Receipt& receipt, const Durable& durable);
  void OnCredit(Stream& stream, uint64_t total);
  void OnEnded(Stream& stream);
  void OnPublished();

  void Begin();  // the core has been started
  // From the end of a derived destructor on, nothing is judged any more.
  void Over();
  void Fail(std::string what);
  void Trace(const std::string& line);
  PlainSession* SessionOf(const Stream& stream);
  bool IsLive(const Stream* stream);
  // Outcomes of a session that asks for none are not seen, nor those that came while it was dormant.
  static bool Certain(const PlainSession& session);
  void CheckTurn(PlainSession& session, uint64_t sequence);
  void CheckIssues(Stream& stream, const PlainTurn& turn);
  void CheckAccepted(const PlainSession& session, const PlainTurn& turn, const Accepted& accepted);
  void Note(const PlainSession& session, const PlainTurn& turn, uint64_t snapshot);
  void ExpectIssues(Stream& stream, const std::vector<Refusal>& expected);

  // What the core does without a receipt, in its order: true if that makes a new snapshot.
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

  // ---- judge_checks.cc: what must hold when the core has come to rest
  void Step();
  void CheckAtRest();
  void CheckScene();
  void CheckStreams();
  void CheckOwners();
  void CheckStats();
  Stats AskStats();

  // ---- judge_actions.cc, judge_ends.cc: what is done to the core
  // True: the action was one of clients or operators.
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
  void EvictEverybody();   // and what they kept goes
  // Nothing is charged for clients any more, and every outcome is accounted for.
  void CheckNothingIsHeld(uint64_t owed, uint64_t told);
  // Everything is shown: nobody waits, and nobody is owed anything.
  void CheckNobodyWaits();
  // The core is stopped while sessions are open.
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
  uint64_t owed_unit_ = 0;  // bytes that an outcome weighs
  std::set<std::tuple<uint64_t, uint64_t, uint64_t, std::string>> given_back_;
  // Session, incarnation and sequence of commits that are to be told DURABLE: their snapshots.
  std::map<std::tuple<uint64_t, uint64_t, uint64_t>, uint64_t> undurable_;
  uint64_t durables_owed_ = 0, durables_told_ = 0;
};

}  // namespace voxeld::daemon::model
