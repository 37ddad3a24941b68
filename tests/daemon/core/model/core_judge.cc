#include "tests/daemon/core/model/core_judge.h"

#include <algorithm>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon::model {
CoreJudge::CoreJudge(const Limits& limits, std::vector<std::string> displays, std::ostream* trace)
    : limits_(limits), displays_(std::move(displays)), trace_(trace), plain_(limits, displays_) {}

void CoreJudge::Begin() {
  seen_ = checked_ = core().scene_watch().newest()->number;
  core().scene_watch().Await(seen_, [this] { OnPublished(); });
  Step();
}

void CoreJudge::Over() {
  // The core's actions during its shutdown are not judged.
  stopping_ = true;
  if (wrong_.empty()) wrong_ = "over";
}

void CoreJudge::Fail(std::string what) {
  if (!wrong_.empty()) return;
  wrong_ = std::move(what);
  Trace(absl::StrCat("WRONG: ", wrong_));
}

void CoreJudge::Trace(const std::string& line) {
  for (const char c : line) trace_hash_ = (trace_hash_ ^ static_cast<uint8_t>(c)) * 0x100000001B3;
  if (trace_ != nullptr) *trace_ << line << "\n";
}

PlainSession* CoreJudge::SessionOf(const Stream& stream) {
  const auto it = plain_.sessions.find(stream.info.session);
  if (it == plain_.sessions.end() || it->second.incarnation != stream.info.incarnation) {
    return nullptr;
  }
  return &it->second;
}

bool CoreJudge::Certain(const PlainSession& session) {
  return !session.options.no_outcomes && session.owed == session.owed_most;
}

// ----------------------------------------------------------------- effects without a receipt

uint64_t CoreJudge::AddEffect(std::function<bool(uint64_t)> run) {
  effects_.push_back({next_effect_, std::move(run)});
  return next_effect_++;
}

std::function<bool(uint64_t)> CoreJudge::Changing(std::function<void()> change) {
  return [this, change = std::move(change)](uint64_t) {
    const std::string before = plain_.scene.Fingerprint();
    change();
    return plain_.scene.Fingerprint() != before;
  };
}

bool CoreJudge::RunEffect() {
  const Effect effect = std::move(effects_.front());
  effects_.pop_front();
  const uint64_t snapshot = published_.empty() ? 0 : published_.front();
  if (!effect.run(snapshot)) return false;
  if (published_.empty()) {
    Fail("the scene should have changed, and no snapshot was published");
    return true;
  }
  published_.pop_front();
  OnPictured(snapshot);
  return true;
}

void CoreJudge::RunEffects(uint64_t id) {
  while (wrong_.empty() && !effects_.empty() && effects_.front().id <= id) RunEffect();
}

void CoreJudge::Explain(uint64_t before) {
  while (wrong_.empty() && !published_.empty() && published_.front() < before) {
    // A change that is over at once is made by time in the same step.
    if (effects_.empty()) {
      AddEffect(Changing([this] { plain_.PassTime(clock().Now()); }));
      if (!RunEffect()) {
        Fail(absl::StrCat("snapshot ", published_.front(), " was published, and nothing changed"));
      }
      continue;
    }
    RunEffect();
  }
}

void CoreJudge::AddTurns(uint64_t id) {
  const PlainSession& session = plain_.sessions.at(id);
  for (size_t i = session.queue.size() + session.due.size(); i > 0; --i) {
    AddEffect([this, id](uint64_t snapshot) {
      PlainSession& session = plain_.sessions.at(id);
      const PlainTurn turn = plain_.TakeTurn(session, clock().Now(), nullptr);
      if (turn.kind != PlainTurn::Kind::kAccepted) return false;
      Note(session, turn, snapshot);
      return true;
    });
  }
}

void CoreJudge::AddFinish(uint64_t id, bool turns) {
  PlainSession& session = plain_.sessions.at(id);
  session.closing = true;
  session.hold.reset();
  session.staged = {};
  if (turns) AddTurns(id);
  AddEffect(Changing([this, id] { plain_.Finish(id, clock().Now()); }));
}

void CoreJudge::OnPublished() {
  const uint64_t number = core().scene_watch().newest()->number;
  core().scene_watch().Await(number, [this] { OnPublished(); });
  if (number <= seen_) return Fail("snapshots do not ascend");
  seen_ = number;
  published_.push_back(number);
}

// ------------------------------------------------------------------------- reports to clients

void CoreJudge::OnIssue(Stream& stream, const Issue& issue) {
  if (!wrong_.empty()) return;
  if (stream.gone) return Fail("an issue for a client that has gone");
  if (issue.reason != Reason::kTimedOut) return stream.issues.push_back(issue);
  PlainSession* session = SessionOf(stream);
  if (session == nullptr || !session->hold.has_value() ||
      session->hold->sequence != issue.sequence) {
    return Fail("must_show ran out of time where nothing is held");
  }
  if (session->hold->deadline > clock().Now()) return Fail("must_show gave up too early");
  session->hold.reset();
  ++plain_.figures.must_show_timeouts;
}

void CoreJudge::ExpectIssues(Stream& stream, const std::vector<Refusal>& expected) {
  const std::vector<Issue> told = std::exchange(stream.issues, {});
  const bool same =
      std::equal(told.begin(), told.end(), expected.begin(), expected.end(),
                 [](const Issue& issue, const Refusal& refusal) { return refusal.Matches(issue); });
  if (same) return;
  std::string text = "issues differ; told:";
  for (const Issue& issue : told) {
    absl::StrAppend(&text, " ", issue.sequence, "/", static_cast<int>(issue.reason), " (",
                    issue.field, ": ", issue.message, ")");
  }
  absl::StrAppend(&text, "; expected:");
  for (const Refusal& refusal : expected) {
    absl::StrAppend(&text, " ", refusal.sequence, "/", static_cast<int>(refusal.reason));
  }
  Fail(std::move(text));
}

void CoreJudge::CheckIssues(Stream& stream, const PlainTurn& turn) {
  std::vector<Refusal> expected = turn.issues;
  if (turn.tells_rest) expected.push_back({turn.commit.sequence, Reason::kQuotaExceeded});
  if (turn.not_durable.has_value()) expected.push_back(*turn.not_durable);
  ExpectIssues(stream, expected);
}

// The core may choose whose turn it is; but the session must be allowed to go, and none may be
// passed over.
void CoreJudge::CheckTurn(PlainSession& session, uint64_t sequence) {
  if (!session.waits() && !plain_.MayBeDue(session, sequence, clock().Now())) {
    return Fail("a receipt of no commit that waits");
  }
  if (session.options.no_outcomes) session.hold.reset();  // no receipt reports its end
  if (!plain_.MayGo(session, session.options.no_outcomes ? 0 : session.owed)) {
    return Fail(session.hold.has_value() ? "a commit passed one that must be shown first"
                                         : "a commit was taken up though its session has to wait");
  }
  session.passed_by.clear();
  for (auto& [id, other] : plain_.sessions) {
    if (id == session.id || !other.waits() || !Certain(other) || other.closing) continue;
    if (!plain_.MayGo(other, other.owed)) continue;
    if (++other.passed_by[session.id] > 2) {
      Fail(
          absl::StrCat("session ", session.id, " had turns again and again while ", id, " waited"));
    }
  }
}

void CoreJudge::Note(const PlainSession& session, const PlainTurn& turn, uint64_t snapshot) {
  if (turn.durable) {
    undurable_[{session.id, session.incarnation, turn.commit.sequence}] = snapshot;
    ++durables_owed_;
  }
  OnApplied({session.id, session.incarnation, turn.commit.sequence, turn.commit.commit.frame_id,
             snapshot, !session.options.no_outcomes, turn.verdict.hidden,
             turn.commit.commit.present_at_ns});
}

void CoreJudge::OnReceipt(Stream& stream, const Receipt& receipt) {
  if (!wrong_.empty()) return;
  if (stream.gone) return Fail("a receipt for a client that has gone");
  if (const auto* outcome = std::get_if<CommitOutcome>(&receipt.what)) {
    return OnOutcome(stream, receipt, *outcome);
  }
  if (const auto* durable = std::get_if<Durable>(&receipt.what)) {
    return OnDurable(stream, receipt, *durable);
  }
  const auto* accepted = std::get_if<Accepted>(&receipt.what);
  Explain(accepted != nullptr ? accepted->snapshot : UINT64_MAX);
  PlainSession* session = SessionOf(stream);
  if (session == nullptr) return Fail("a receipt for a session that there is not");
  CheckTurn(*session, receipt.sequence);
  if (!wrong_.empty()) return;
  const PlainCore::Heard heard{receipt.sequence, std::holds_alternative<Scheduled>(receipt.what)};
  const PlainTurn turn = plain_.TakeTurn(*session, clock().Now(), &heard);
  Trace(absl::StrCat("    session ", session->id, " commit ", receipt.frame_id, " sequence ",
                     receipt.sequence,
                     accepted != nullptr                             ? " ACCEPTED"
                     : std::holds_alternative<Refused>(receipt.what) ? " REFUSED"
                                                                     : " SCHEDULED"));
  CheckIssues(stream, turn);
  if (receipt.sequence != turn.commit.sequence || receipt.frame_id != turn.commit.commit.frame_id) {
    return Fail(absl::StrCat("a receipt of sequence ", receipt.sequence,
                             " where it is the turn of ", turn.commit.sequence));
  }
  if (const auto* scheduled = std::get_if<Scheduled>(&receipt.what)) {
    if (turn.kind != PlainTurn::Kind::kScheduled) return Fail("SCHEDULED, and should not be");
    if (scheduled->present_at_ns != turn.commit.commit.present_at_ns) Fail("SCHEDULED otherwise");
    return;
  }
  if (const auto* refused = std::get_if<Refused>(&receipt.what)) {
    if (turn.kind != PlainTurn::Kind::kRefused) return Fail("REFUSED, and should not be");
    if (refused->refused_operations != turn.refused_operations) {
      Fail(absl::StrCat("REFUSED with ", refused->refused_operations, " operations, not ",
                        turn.refused_operations));
    }
    return;
  }
  if (turn.kind != PlainTurn::Kind::kAccepted) return Fail("ACCEPTED, and should not be");
  if (published_.size() != 1 || published_.front() != accepted->snapshot) {
    return Fail("ACCEPTED before its snapshot was there");
  }
  published_.pop_front();
  OnPictured(accepted->snapshot);
  Note(*session, turn, accepted->snapshot);
  CheckAccepted(*session, turn, *accepted);
}

void CoreJudge::CheckAccepted(const PlainSession& session, const PlainTurn& turn,
                              const Accepted& accepted) {
  if (accepted.refused_operations != turn.refused_operations) {
    Fail(absl::StrCat("ACCEPTED with ", accepted.refused_operations, " refused operations, not ",
                      turn.refused_operations));
  }
  if (accepted.dropped_frames != turn.commit.dropped_frames) {
    Fail(absl::StrCat("ACCEPTED with ", accepted.dropped_frames, " dropped frames, not ",
                      turn.commit.dropped_frames));
  }
  if (Certain(session) && turn.commit.late_known && accepted.late != turn.commit.late)
    Fail("ACCEPTED late, or not, and it was not");
  if (accepted.applied_time_ns != clock().Now()) Fail("ACCEPTED at another time");
  if (accepted.durable != turn.durable) Fail("ACCEPTED, to be durable or not, and otherwise");
  const Stages& stages = accepted.stages;
  if (stages.applied_ns != clock().Now() || stages.received_ns > stages.applied_ns ||
      stages.sent_ns < 0 || stages.sent_ns > stages.received_ns) {
    Fail(absl::StrCat("ACCEPTED, sent at ", stages.sent_ns, ", received at ", stages.received_ns,
                      ", applied at ", stages.applied_ns));
  }
  const size_t displays = session.options.no_outcomes ? 0 : displays_.size();
  if (accepted.displays.size() != displays) Fail("ACCEPTED for other displays");
}

void CoreJudge::OnOutcome(Stream& stream, const Receipt& receipt, const CommitOutcome& outcome) {
  Explain(UINT64_MAX);
  Trace(absl::StrCat("    session ", stream.info.session, " sequence ", receipt.sequence, " of ",
                     receipt.incarnation, " on ", outcome.display, ": ",
                     static_cast<int>(outcome.kind), " volume ", outcome.volume, " by ",
                     outcome.by_sequence, " ", outcome.reason));
  PlainSession* session = SessionOf(stream);
  if (session == nullptr) return Fail("an outcome for a session that there is not");
  std::string wrong = OnTold(session->id, receipt, outcome);
  if (!wrong.empty()) {
    return Fail(absl::StrCat("session ", session->id, " sequence ", receipt.sequence, " on ",
                             outcome.display, ": ", wrong));
  }
  if (stream.opening && session->was_dormant_ns >= PlainCore::kOutcomesKept) {
    return Fail("an outcome was kept for longer than it should be");
  }
  stream.outcomes.push_back(receipt);
  if (given_back_.erase({session->id, receipt.incarnation, receipt.sequence, outcome.display}) >
      0) {
    return;
  }
  --session->owed_most;
  if (receipt.incarnation != session->incarnation) return;
  --session->owed;
  plain_.Told(*session, outcome.display, receipt.sequence);
}

void CoreJudge::OnDurable(Stream& stream, const Receipt& receipt, const Durable& durable) {
  const uint64_t session = stream.info.session;
  Trace(absl::StrCat("    session ", session, " sequence ", receipt.sequence, " of ",
                     receipt.incarnation, " DURABLE by snapshot ", durable.snapshot));
  const auto it = undurable_.find({session, receipt.incarnation, receipt.sequence});
  if (it == undurable_.end()) return Fail("DURABLE, and nobody waits for it");
  if (durable.snapshot < it->second) return Fail("DURABLE by an older snapshot");
  if (!IsOnDisk(it->second)) return Fail("DURABLE, and not on the disk");
  undurable_.erase(it);
  ++durables_told_;
}

void CoreJudge::OnCredit(Stream& stream, uint64_t total) {
  if (!wrong_.empty()) return;
  if (stream.gone) return Fail("credit for a client that has gone");
  if (total <= stream.told_credit) Fail("credit does not ascend");
  stream.told_credit = total;
}

void CoreJudge::OnEnded(Stream& stream) {
  if (!wrong_.empty()) return;
  if (!stream.may_end) return Fail("a stream was ended, and nobody asked for it");
  if (std::exchange(stream.ended, true)) return Fail("a stream was ended twice");
  stream.gone = !stopping_;
}

}  // namespace voxeld::daemon::model
