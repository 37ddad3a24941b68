// Core's commits: whose turn it is, what waits for its time, what is applied, and what it is told.
#include <algorithm>
#include <utility>

#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "daemon/core/core_impl.h"

namespace voxeld::daemon {
namespace {

// A slice of a commit ends after so many operations, or after so much time; until then other owners wait.
constexpr uint64_t kSliceOperations = 1000;
constexpr sync::TimeNs kSliceTime = 2 * sync::kMillisecond;
constexpr uint64_t kBetweenLooks = 10;  // operations between two looks at the clock

// Two clocks may drift apart by so much of the time that passes.
constexpr int64_t kDriftDivisor = 20'000;

// The offset of a clock that is never behind the other's messages: the least that was seen, let go at the rate
// of drift.
std::optional<int64_t> LeastOffset(std::optional<int64_t> before, sync::TimeNs elapsed,
                                   sync::TimeNs received, int64_t sent) {
  int64_t offset = 0;
  if (__builtin_sub_overflow(received, sent, &offset)) return before;
  int64_t least = 0;
  if (!before.has_value() || __builtin_add_overflow(*before, elapsed / kDriftDivisor, &least)) {
    return offset;
  }
  return std::min(offset, least);
}

}  // namespace

void Core::Impl::PostTurn(SessionId id) {
  const auto it = sessions_.find(id);
  if (it == sessions_.end() || std::exchange(it->second.turn_posted, true)) return;
  const uint64_t owner = it->second.owner;
  std::deque<SessionId>& ready = owners_.at(owner).ready;
  ready.push_back(id);
  if (ready.size() == 1) loop_->Post([this, owner] { OwnerTurn(owner); });
}

void Core::Impl::OwnerTurn(uint64_t owner) {
  const auto it = owners_.find(owner);
  if (it == owners_.end()) return;
  std::deque<SessionId>& ready = it->second.ready;
  const SessionId id = ready.front();
  // Until it has gone, a session that becomes ready posts no turn of its own.
  if (const auto session = sessions_.find(id); session != sessions_.end()) {
    session->second.turn_posted = false;
    Turn(id);
  }
  const auto after = owners_.find(owner);  // it may have been forgotten
  if (after == owners_.end()) return;
  after->second.ready.pop_front();
  if (!after->second.ready.empty()) loop_->Post([this, owner] { OwnerTurn(owner); });
}

void Core::Impl::FinishTurns(SessionId id) {
  while (sessions_.contains(id)) {
    const auto under_way = under_way_.find(sessions_.at(id).owner);
    Turn(under_way == under_way_.end() ? id : under_way->second.session);
  }
}

bool Core::Impl::MustWait(const Session& session) const {
  if (session.closing) return false;
  if (session.hold.has_value()) return true;
  const uint64_t most = options_.limits.max_riding_commits * displays_.size();
  if (!displays_.empty() && session.owed_outcomes >= most) return true;
  return session.sink != nullptr && session.sink->Crowded();
}

void Core::Impl::Turn(SessionId id) {
  const auto it = sessions_.find(id);
  if (it == sessions_.end()) return;
  Session& session = it->second;
  if (const auto under_way = under_way_.find(session.owner); under_way != under_way_.end()) {
    if (under_way->second.session == id) {
      ApplySlice(session, under_way->second);
      PostTurn(id);
    } else {
      under_way->second.waiting.insert(id);
    }
    return;
  }
  if (MustWait(session)) return;
  bool more = false;
  if (!session.due.empty()) {
    WaitingCommit commit = std::move(session.due.front());
    session.due.pop_front();
    more = true;
    Apply(session, std::move(commit));
  } else if (std::optional<WaitingCommit> commit = session.intake->Pop(&more)) {
    client_drops_ += commit->commit.client_drops;
    frames_dropped_ += commit->dropped_frames;
    if (!PutAside(session, *commit)) Apply(session, *std::move(commit));
  } else if (session.closing) {
    return FinishClose(id);
  }
  if (more || session.closing) PostTurn(id);
}

sync::TimeNs Core::Impl::DueTime(sync::TimeNs present_at) const {
  // On one display it is due when its sweep has begun that comes before the one in which it is to be seen. With
  // several the last decides: no display may show it too early.
  sync::TimeNs due = displays_.empty() ? present_at : 0;
  for (const auto& slot : displays_) {
    due = std::max(due, slot->host->pipeline->sweeps()->DueTime(present_at));
  }
  return due;
}

bool Core::Impl::PutAside(Session& session, WaitingCommit& commit) {
  const sync::TimeNs at = commit.commit.present_at_ns;
  if (at == 0) return false;
  const Limits& limits = options_.limits;
  const sync::TimeNs now = clock_.Now();
  commit.late = at < now;
  const bool beyond = at > now && at - now > limits.max_present_at_horizon_ns;
  const sync::TimeNs due = beyond ? at : DueTime(at);
  if (due <= now) return false;

  Issue issue;
  issue.sequence = commit.sequence;
  issue.field = "commit.present_at_ns";
  if (beyond) {
    issue.reason = Reason::kOutOfRange;
    issue.message = absl::StrFormat(
        "present_at_ns is %d, which is %d ns ahead by the server's clock; "
        "max_present_at_horizon_ns "
        "is %d",
        at, at - now, limits.max_present_at_horizon_ns);
  } else if (session.timed >= limits.max_timed_commits) {
    issue.reason = Reason::kQuotaExceeded;
    issue.message = absl::StrFormat(
        "%d commits of the session wait for their present_at, which is max_timed_commits; send "
        "later "
        "ones later",
        session.timed);
  }
  if (!issue.message.empty()) {
    commit.refusals.Tell(issue, session.sink.get(), limits.max_issues_per_commit);
    commit.refusals.TellOfThoseLeftOut(commit.sequence, session.sink.get(),
                                       limits.max_issues_per_commit);
    RefuseCommit(session, commit, commit.refusals.refused() + commit.operations.size(),
                 absl::StrFormat("nothing of the commit was applied: %s", issue.message));
    session.intake->Done(std::move(commit));
    return true;
  }
  session.intake->Detach(commit);
  ++session.timed;
  if (session.sink != nullptr) {
    Receipt receipt{commit.commit.frame_id, commit.sequence, Scheduled{at}};
    session.sink->OnReceipt(receipt);
  }
  timed_.emplace(due, Timed{session.id, std::move(commit)});
  return true;
}

sync::TimeNs Core::Impl::RunTimed(sync::TimeNs now) {
  while (!timed_.empty() && timed_.begin()->first <= now) {
    auto node = timed_.extract(timed_.begin());
    // The sweeps may have shifted since.
    const sync::TimeNs due = DueTime(node.mapped().commit.commit.present_at_ns);
    if (due > now) {
      node.key() = due;
      timed_.insert(std::move(node));
      continue;
    }
    Session& session = sessions_.at(node.mapped().session);
    --session.timed;
    WaitingCommit commit = std::move(node.mapped().commit);
    commit.late = commit.late || MustWait(session);
    session.due.push_back(std::move(commit));
    PostTurn(session.id);
  }
  sync::TimeNs next = timed_.empty() ? sync::kNever : timed_.begin()->first;
  std::vector<SessionId> over;
  for (const SessionId id : holding_) {
    const sync::TimeNs deadline = sessions_.at(id).hold->deadline;
    if (deadline <= now) {
      over.push_back(id);
    } else {
      next = std::min(next, deadline);
    }
  }
  for (const SessionId id : over) {
    Session& session = sessions_.at(id);
    ++must_show_timeouts_;
    if (session.sink != nullptr) {
      session.sink->OnIssue(
          {session.hold->sequence,
           {},
           {},
           "commit.must_show",
           Reason::kTimedOut,
           absl::StrFormat("no outcome in %d ms from %s; later commits go on",
                           options_.limits.must_show_timeout_ns / sync::kMillisecond,
                           absl::StrJoin(session.hold->displays, ", "))});
    }
    ReleaseHold(session);
  }
  return next;
}

void Core::Impl::ReleaseHold(Session& session) {
  if (!session.hold.has_value()) return;
  session.hold.reset();
  holding_.erase(session.id);
  PostTurn(session.id);
}

void Core::Impl::DropTimed(Session& session) {
  for (auto it = timed_.begin(); it != timed_.end();) {
    if (it->second.session != session.id) {
      ++it;
      continue;
    }
    session.intake->Done(std::move(it->second.commit));
    ++timed_dropped_;
    it = timed_.erase(it);
  }
}

Stages Core::Impl::StagesOf(Session& session, const WaitingCommit& commit) {
  Stages stages;
  stages.received_ns = commit.received_ns;
  stages.decoded_ns = commit.decoded_ns;
  if (commit.commit.send_time_ns == 0 || commit.received_ns == 0) return stages;
  session.clock_offset_ns =
      LeastOffset(session.clock_offset_ns, commit.received_ns - session.clock_offset_at,
                  commit.received_ns, commit.commit.send_time_ns);
  session.clock_offset_at = commit.received_ns;
  sync::TimeNs sent = 0;
  if (session.clock_offset_ns.has_value() &&
      !__builtin_add_overflow(commit.commit.send_time_ns, *session.clock_offset_ns, &sent) &&
      sent <= commit.received_ns && sent > 0) {
    stages.sent_ns = sent;
  }
  return stages;
}

void Core::Impl::RefuseCommit(Session& session, const WaitingCommit& commit, uint64_t refused,
                              std::string message) {
  ++commits_refused_;
  operations_refused_ += refused;
  if (session.sink == nullptr) return;
  session.sink->OnReceipt(
      {commit.commit.frame_id, commit.sequence, Refused{refused, std::move(message)}});
}

MemoryRoom Core::Impl::RoomFor(const WaitingCommit& commit) const {
  const uint64_t engines = displays_.size();
  // Engines have not measured yet what they have yet to draw, so the expected size counts for it.
  const uint64_t expected = store_.snapshot()->total.derived * engines;
  const uint64_t drawn = budget_->derived_bytes();
  // Messages that are being read have a limit of their own, and are charged when they are staged.
  // These are read one after another, while other threads charge.
  const auto less = [](uint64_t from, uint64_t by) { return from > by ? from - by : 0; };
  const uint64_t used = less(budget_->used_bytes(), budget_->used_bytes(Budget::Use::kArriving)) +
                        less(expected, drawn);
  // The commit's own bytes become the scene's.
  const uint64_t limit = budget_->limit_bytes() + commit.bytes;
  return {.bytes = less(limit, used), .engines = engines};
}

void Core::Impl::Apply(Session& session, WaitingCommit commit) {
  const sync::TimeNs now = clock_.Now();
  store_.Expire(now);
  const Owner& owner = owners_.at(session.owner);
  UnderWay under_way;
  under_way.session = session.id;
  under_way.stages = StagesOf(session, commit);
  under_way.pending = store_.Begin(
      Author{session.owner, session.writer, owner.hidden, session.options.may_erase,
             owner.max_bytes, owner.max_entities},
      std::move(commit.operations), now, session.options.strict, commit.refusals.refused());
  under_way.commit = std::move(commit);
  ApplySlice(session, under_way_.emplace(session.owner, std::move(under_way)).first->second);
}

void Core::Impl::ApplySlice(Session& session, UnderWay& under_way) {
  const Owner& owner = owners_.at(session.owner);
  SceneStore::SetQuotas(*under_way.pending, owner.hidden, owner.max_bytes, owner.max_entities);
  store_.SetMemoryRoom(RoomFor(under_way.commit));
  const sync::TimeNs until = clock_.Now() + kSliceTime;
  for (uint64_t applied = 0; !store_.Continue(*under_way.pending, kBetweenLooks);) {
    applied += kBetweenLooks;
    if (applied >= kSliceOperations || clock_.Now() >= until) return PostTurn(session.id);
  }
  UnderWay done = std::move(under_way);
  under_way_.erase(session.owner);
  CommitResult result = store_.Finish(std::move(done.pending));
  if (result.spent.size() >= kSliceOperations) {
    Retire(std::make_shared<std::vector<Operation>>(std::move(result.spent)));
  }
  Conclude(session, std::move(done.commit), done.stages, std::move(result));
  for (const SessionId id : done.waiting) PostTurn(id);
}

void Core::Impl::Conclude(Session& session, WaitingCommit commit, Stages stages,
                          CommitResult result) {
  const Limits& limits = options_.limits;
  RefusalTally& refusals = commit.refusals;
  std::string first = refusals.first();
  if (first.empty() && result.first_refusal.has_value()) {
    first = RefusalTally::Describe(*result.first_refusal);
  }
  for (const Issue& issue : result.issues) {
    refusals.Tell(issue, session.sink.get(), limits.max_issues_per_commit);
  }
  refusals.LeaveOut(result.more_issues);
  refusals.TellOfThoseLeftOut(commit.sequence, session.sink.get(), limits.max_issues_per_commit);

  if (!result.applied) {
    RefuseCommit(
        session, commit, result.refused_operations,
        result.abandoned
            ? std::string("the daemon is being stopped, so nothing of the commit was "
                          "applied; send it again to one that runs")
            : absl::StrFormat("the session is strict and %d %s refused, so nothing of "
                              "the commit was applied; the first: %s",
                              result.refused_operations,
                              result.refused_operations == 1 ? "operation was" : "operations were",
                              first));
    session.intake->Done(std::move(commit));
    return Publish();  // what had expired
  }

  operations_refused_ += result.refused_operations;
  ++commits_accepted_;
  operations_applied_ += result.applied_operations;
  // Timed ones may come after later ones.
  if (!session.applied_any || commit.sequence > session.last_sequence) {
    session.last_frame_id = commit.commit.frame_id;
    session.last_sequence = commit.sequence;
  }
  session.applied_any = true;
  stages.applied_ns = clock_.Now();
  if (stages.received_ns != 0) {
    const sync::TimeNs now = stages.applied_ns;
    if (stages.sent_ns != 0) sending_.Add(now, stages.received_ns - stages.sent_ns);
    decoding_.Add(now, stages.decoded_ns - stages.received_ns);
    applying_.Add(now, stages.applied_ns - stages.decoded_ns);
  }
  Accepted accepted;
  accepted.snapshot = store_.snapshot()->number;
  accepted.refused_operations = result.refused_operations;
  accepted.applied_time_ns = stages.applied_ns;
  accepted.late = commit.late;
  accepted.dropped_frames = commit.dropped_frames;
  accepted.stages = stages;
  accepted.durable = commit.commit.durable && WillBeDurable(session, commit);
  if (!session.options.no_outcomes) {
    for (const auto& slot : displays_) accepted.displays.push_back(slot->info.name);
  }
  scene_watch_.Publish(store_.snapshot());  // who has the receipt sees the commit
  if (session.sink != nullptr) {
    session.sink->OnReceipt({commit.commit.frame_id, commit.sequence, std::move(accepted)});
  }
  Ride(session, commit, stages, result.hidden);
  session.intake->Done(std::move(commit));
}

void Core::Impl::Ride(Session& session, const WaitingCommit& commit, const Stages& stages,
                      bool hidden) {
  Retire(std::exchange(published_, store_.snapshot()));
  OfferState(undurable_.contains(published_->number));
  budget_->Set(Budget::Use::kScene, published_->total.bytes);
  if (commit.commit.must_show && !displays_.empty() && !session.closing) {
    session.hold = Hold();
    Hold& hold = *session.hold;
    hold.sequence = commit.sequence;
    hold.deadline = clock_.Now() + options_.limits.must_show_timeout_ns;
    for (const auto& slot : displays_) hold.displays.insert(slot->info.name);
    holding_.insert(session.id);
  }
  const Rider rider{.session = session.id,
                    .frame_id = commit.commit.frame_id,
                    .sequence = commit.sequence,
                    .incarnation = session.incarnation,
                    .asked = !session.options.no_outcomes,
                    .stages = stages,
                    .owner = session.owner};
  session.owed_outcomes += displays_.size();
  budget_->ChargeAnyway(Budget::Use::kOwed, displays_.size() * kOwedBytes);
  for (const auto& slot : displays_) {
    const bool posted =
        slot->host->work->Post([pipeline = slot->host->pipeline.get(), snapshot = published_, rider,
                                hidden, urgent = commit.commit.present_at_ns != 0] {
          pipeline->Show(snapshot, rider, hidden, urgent);
        });
    if (!posted) {  // the daemon is being stopped, and the display already is
      CommitOutcome outcome;
      outcome.display = slot->info.name;
      outcome.kind = CommitOutcome::Kind::kNotShown;
      outcome.why = CommitOutcome::NotShown::kRemoved;
      DeliverOutcome(rider, outcome);
    }
  }
}

}  // namespace voxeld::daemon
