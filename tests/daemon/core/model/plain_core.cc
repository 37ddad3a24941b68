#include "tests/daemon/core/model/plain_core.h"

#include <algorithm>
#include <numeric>

namespace voxeld::daemon::model {
namespace {

std::string LayerOf(const Operation& operation) {
  if (const auto* op = std::get_if<Upsert>(&operation.op)) return op->layer;
  if (const auto* op = std::get_if<SetTransform>(&operation.op)) return op->layer;
  if (const auto* op = std::get_if<Delete>(&operation.op)) return op->layer;
  if (const auto* op = std::get_if<FrameBegin>(&operation.op)) return op->layer;
  if (const auto* op = std::get_if<FrameEnd>(&operation.op)) return op->layer;
  return "";
}

uint64_t Sum(const std::vector<uint64_t>& values) {
  return std::accumulate(values.begin(), values.end(), uint64_t{0});
}

// Returns the bytes that an operation holds while it waits.
uint64_t WeightOf(const Operation& operation) {
  uint64_t bytes = sizeof(Operation) + sizeof(WaitingCommit::Cost);
  if (const auto* op = std::get_if<Upsert>(&operation.op)) {
    bytes += op->layer.size() + op->id.size() + op->entity.label.size() +
             PlainScene::ContentBytes(op->entity.content);
  } else if (const auto* op = std::get_if<DefineObject>(&operation.op)) {
    bytes += PlainScene::ObjectBytes(op->object, op->data->parts);
  } else if (const auto* op = std::get_if<Delete>(&operation.op)) {
    bytes += op->layer.size() + op->id_or_prefix.size();
  } else if (const auto* op = std::get_if<SetTransform>(&operation.op)) {
    bytes += op->layer.size() + op->id.size();
  } else if (const auto* op = std::get_if<LayerState>(&operation.op)) {
    bytes += op->layer.size() + (op->clip ? sizeof(Clip) : 0);
  } else if (const auto* op = std::get_if<FrameBegin>(&operation.op)) {
    bytes += op->layer.size();
  } else if (const auto* op = std::get_if<FrameEnd>(&operation.op)) {
    bytes += op->layer.size();
  } else if (const auto* op = std::get_if<DeleteObject>(&operation.op)) {
    bytes += op->object.size();
  }
  return bytes;
}

// A whole draw batch in a commit: its first operation and its last.
struct FrameSpan {
  std::string layer;
  size_t first = 0, last = 0;
};

std::vector<FrameSpan> FramesOf(const PlainCommit& commit) {
  std::vector<FrameSpan> frames;
  std::map<std::string, size_t> begun;
  for (size_t i = 0; i < commit.operations.size(); ++i) {
    const Operation& operation = commit.operations[i];
    const std::string layer = LayerOf(operation);
    if (std::holds_alternative<FrameBegin>(operation.op)) {
      begun.try_emplace(layer, i);
    } else if (std::holds_alternative<FrameEnd>(operation.op) && begun.contains(layer)) {
      frames.push_back({layer, begun.at(layer), i});
      begun.erase(layer);
    }
  }
  return frames;
}

}  // namespace

uint64_t PlainSession::staged_bytes() const { return Sum(staged.weights); }

uint64_t PlainSession::waiting_bytes() const {
  uint64_t bytes = detached_bytes();
  for (const PlainCommit& commit : queue) bytes += sizeof(WaitingCommit) + Sum(commit.weights);
  return bytes;
}

uint64_t PlainSession::detached_bytes() const {
  uint64_t bytes = 0;
  for (const PlainCommit& commit : due) bytes += sizeof(WaitingCommit) + Sum(commit.weights);
  for (const PlainCommit& commit : timed) bytes += sizeof(WaitingCommit) + Sum(commit.weights);
  return bytes;
}

uint64_t PlainSession::outstanding() const {
  uint64_t bytes = staged.credit;
  for (const PlainCommit& commit : queue) bytes += commit.credit;
  return bytes;
}

absl::StatusCode PlainCore::MayOpen(const OpenOptions& options) const {
  const bool full = sessions.size() >= limits_.max_sessions;
  if (options.resume_token.empty()) {
    if (full) return absl::StatusCode::kResourceExhausted;
    if (!options.owner_token.empty() && !owner_tokens.contains(options.owner_token)) {
      return absl::StatusCode::kNotFound;
    }
    return absl::StatusCode::kOk;
  }
  const uint64_t id = SessionOf(options.resume_token);
  if (id == 0) return absl::StatusCode::kNotFound;
  return full && !sessions.contains(id) ? absl::StatusCode::kResourceExhausted
                                        : absl::StatusCode::kOk;
}

uint64_t PlainCore::SessionOf(const std::string& resume_token) const {
  for (const auto& [id, session] : sessions) {
    if (session.token == resume_token) return id;
  }
  for (const auto& [id, kept] : dormant) {
    if (kept.token == resume_token) return id;
  }
  return 0;
}

PlainSession& PlainCore::Open(const OpenOptions& options, const SessionInfo& info,
                              uint64_t open_bytes, sync::TimeNs now) {
  PlainSession session;
  session.id = info.session;
  session.options = options;
  session.keeps = options.on_disconnect == DisconnectPolicy::kKeep;
  session.token = info.resume_token;
  session.received = open_bytes;
  figures.bytes_in += open_bytes;
  if (!options.resume_token.empty()) {
    const PlainDormant& kept = dormant.at(info.session);
    session.incarnation = kept.incarnation + 1;
    session.owner = kept.owner;
    session.last_frame_id = kept.last_frame_id;
    session.last_sequence = kept.last_sequence;
    session.owed_most = kept.owed_most;
    session.was_dormant_ns = now - kept.since;
    dormant.erase(info.session);
    std::erase_if(lingering_, [&](const auto& entry) { return entry.second == info.session; });
    scene.HandOver(info.session, options.client_name, false);
    ++figures.resumed;
  } else if (!options.owner_token.empty()) {
    session.owner = owner_tokens.at(options.owner_token);
  } else {
    session.owner = info.owner;
    owner_tokens[info.owner_token] = info.owner;
    scene.owners[info.owner];
  }
  return sessions[info.session] = std::move(session);
}

bool PlainCore::HasRoom(const PlainSession& session) const {
  return session.outstanding() < limits_.credit_bytes &&
         session.queue.size() < limits_.max_riding_commits;
}

std::vector<Refusal> PlainCore::Take(PlainSession& session,
                                     const std::vector<Operation>& operations,
                                     const std::vector<Issue>& malformed, uint64_t bytes) {
  std::vector<Refusal> told;
  const auto refuse = [&](uint64_t sequence, Reason reason) {
    ++session.staged.refused;
    if (session.staged.told < limits_.max_issues_per_commit) {
      ++session.staged.told;
      told.push_back({sequence, reason});
    } else {
      ++session.staged.left_out;
    }
  };
  session.received += bytes;
  figures.bytes_in += bytes;
  session.staged.credit += bytes;
  for (const Issue& issue : malformed) refuse(issue.sequence, issue.reason);
  uint64_t credit = bytes;
  for (const Operation& operation : operations) {
    if (std::holds_alternative<Commit>(operation.op)) {
      Seal(session, operation);
      continue;
    }
    std::optional<Reason> wrong = PlainScene::WrongAlone(operation, limits_);
    const uint64_t weight = WeightOf(operation);
    if (TooMuchStaged(session, weight)) wrong = Reason::kQuotaExceeded;
    if (memory_full && !wrong.has_value()) wrong = Reason::kQuotaExceeded;
    if (wrong.has_value()) {
      refuse(operation.sequence, *wrong);
    } else {
      session.staged.operations.push_back(operation);
      session.staged.credits.push_back(credit);
      session.staged.weights.push_back(weight);
    }
    credit = 0;
  }
  Idle(session);
  return told;
}

bool PlainCore::TooMuchStaged(const PlainSession& session, uint64_t weight) const {
  if (session.staged.operations.size() >= limits_.max_operations_per_commit) return true;
  const uint64_t mine = session.staged_bytes() + session.detached_bytes() + weight;
  if (mine > limits_.max_uncommitted_bytes) return true;
  uint64_t all = weight;
  for (const auto& [id, other] : sessions) all += other.staged_bytes();
  return all > limits_.max_uncommitted_bytes_total;
}

void PlainCore::Seal(PlainSession& session, const Operation& operation) {
  PlainCommit commit = std::exchange(session.staged, {});
  commit.sequence = operation.sequence;
  commit.commit = std::get<Commit>(operation.op);
  session.queue.push_back(std::move(commit));
  if (session.options.flow != FlowPolicy::kReliable) GiveUpFrames(session);
}

// Keeps only the newest waiting draw batch of each layer. Batches that must be shown, or that have
// a time, are not affected.
void PlainCore::GiveUpFrames(PlainSession& session) {
  const size_t kept =
      session.options.flow == FlowPolicy::kLatest ? 1 : session.options.drop_oldest_frames;
  std::map<std::string, size_t> newer;  // of each layer, seen so far
  for (auto commit = session.queue.rbegin(); commit != session.queue.rend(); ++commit) {
    if (commit->commit.must_show || commit->commit.present_at_ns != 0) continue;
    const std::vector<FrameSpan> frames = FramesOf(*commit);
    std::set<size_t> gone;
    for (auto frame = frames.rbegin(); frame != frames.rend(); ++frame) {
      if (newer[frame->layer]++ < kept) continue;
      ++commit->dropped_frames;
      for (size_t i = frame->first; i <= frame->last; ++i) {
        const Operation& inside = commit->operations[i];
        if (LayerOf(inside) == frame->layer) gone.insert(i);
      }
    }
    for (auto i = gone.rbegin(); i != gone.rend(); ++i) {
      commit->credit -= commit->credits[*i];
      commit->operations.erase(commit->operations.begin() + static_cast<std::ptrdiff_t>(*i));
      commit->credits.erase(commit->credits.begin() + static_cast<std::ptrdiff_t>(*i));
      commit->weights.erase(commit->weights.begin() + static_cast<std::ptrdiff_t>(*i));
    }
  }
}

void PlainCore::Idle(PlainSession& session) {
  if (!session.queue.empty()) return;
  session.staged.credit = 0;
  std::fill(session.staged.credits.begin(), session.staged.credits.end(), 0);
}

bool PlainCore::MayGo(const PlainSession& session, uint64_t owed) const {
  if (session.closing) return true;
  if (session.hold.has_value() || session.crowded) return false;
  return displays_.empty() || owed < uint64_t{limits_.max_riding_commits} * displays_.size();
}

void PlainCore::Tell(PlainTurn& turn, const Refusal& refusal) const {
  if (turn.commit.told < limits_.max_issues_per_commit) {
    ++turn.commit.told;
    turn.issues.push_back(refusal);
  } else {
    ++turn.commit.left_out;
  }
}

bool PlainCore::MayBeDue(const PlainSession& session, uint64_t sequence, sync::TimeNs now) const {
  return std::any_of(session.timed.begin(), session.timed.end(), [&](const PlainCommit& commit) {
    return commit.sequence == sequence && commit.commit.present_at_ns - early <= now;
  });
}

bool PlainCore::Uncertain(const PlainSession& session, sync::TimeNs now) const {
  const auto near = [&](const PlainCommit& commit) {
    const sync::TimeNs at = commit.commit.present_at_ns;
    return at != 0 && at - early <= now && now < at + slack;
  };
  return std::any_of(session.timed.begin(), session.timed.end(), near) ||
         std::any_of(session.queue.begin(), session.queue.end(), near);
}

PlainTurn PlainCore::TakeTurn(PlainSession& session, sync::TimeNs now, const Heard* heard) {
  PlainTurn turn;
  PlainCommit& commit = turn.commit;
  if (heard != nullptr && MayBeDue(session, heard->sequence, now)) {
    const auto it = std::find_if(
        session.timed.begin(), session.timed.end(),
        [&](const PlainCommit& waiting) { return waiting.sequence == heard->sequence; });
    session.due.push_front(std::move(*it));
    session.due.front().late_known = false;
    session.timed.erase(it);
  } else if (heard != nullptr && early > 0 && !session.due.empty()) {
    // Commits for the same sweep are applied in the order in which they arrived.
    const auto it = std::find_if(
        session.due.begin(), session.due.end(),
        [&](const PlainCommit& waiting) { return waiting.sequence == heard->sequence; });
    if (it != session.due.end() &&
        it->commit.present_at_ns <= session.due.front().commit.present_at_ns + early) {
      std::rotate(session.due.begin(), it, std::next(it));
    }
  }
  if (!session.due.empty()) {
    commit = std::move(session.due.front());
    session.due.pop_front();
  } else {
    commit = std::move(session.queue.front());
    session.queue.pop_front();
    Idle(session);
    figures.client_drops += commit.commit.client_drops;
    figures.frames_dropped += commit.dropped_frames;
    const sync::TimeNs at = commit.commit.present_at_ns;
    commit.late = at != 0 && at < now;
    const bool soon = heard != nullptr && !heard->scheduled && at - now <= early;
    // Its sweep may be reported to begin a little after its time.
    const bool put_off = heard != nullptr && heard->scheduled && at != 0 && at + slack > now;
    if ((at > now && !soon) || put_off) {
      const bool beyond = at - now > limits_.max_present_at_horizon_ns;
      if (!beyond && session.timed.size() < limits_.max_timed_commits) {
        turn.kind = PlainTurn::Kind::kScheduled;
        PlainCommit waits = commit;
        waits.credit = 0;
        session.timed.push_back(std::move(waits));
        return turn;
      }
      Tell(turn, {commit.sequence, beyond ? Reason::kOutOfRange : Reason::kQuotaExceeded});
      turn.kind = PlainTurn::Kind::kRefused;
      turn.refused_operations = commit.refused + commit.operations.size();
    }
  }
  if (turn.kind != PlainTurn::Kind::kRefused) {
    const PlainAuthor author{session.owner, session.id, session.options.client_name,
                             session.options.strict};
    turn.verdict = scene.Apply(author, commit.operations, now, commit.refused);
    turn.refused_operations = turn.verdict.refused_operations;
    for (const Refusal& refusal : turn.verdict.refusals) Tell(turn, refusal);
    if (!turn.verdict.applied) turn.kind = PlainTurn::Kind::kRefused;
  }
  turn.tells_rest = commit.left_out > 0;
  figures.operations_refused += turn.refused_operations;
  if (turn.kind == PlainTurn::Kind::kRefused) {
    ++figures.refused;
    return turn;
  }
  turn.durable = commit.commit.durable && keeps_state && session.keeps;
  if (commit.commit.durable && !turn.durable) {
    turn.not_durable = {commit.sequence,
                        keeps_state ? Reason::kInvalidValue : Reason::kUnimplemented};
  }
  ++figures.accepted;
  figures.operations_applied += turn.verdict.applied_operations;
  if (!session.applied_any || commit.sequence > *session.last_sequence) {
    session.last_frame_id = commit.commit.frame_id;
    session.last_sequence = commit.sequence;
  }
  session.applied_any = true;
  session.owed += displays_.size();
  session.owed_most += displays_.size();
  if (commit.commit.must_show && !displays_.empty() && !session.closing) {
    session.hold = {
        commit.sequence, {displays_.begin(), displays_.end()}, now + limits_.must_show_timeout_ns};
  }
  return turn;
}

void PlainCore::Told(PlainSession& session, const std::string& display, uint64_t sequence) {
  if (!session.hold.has_value() || session.hold->sequence != sequence) return;
  session.hold->displays.erase(display);
  if (session.hold->displays.empty()) session.hold.reset();
}

void PlainCore::Finish(uint64_t id, sync::TimeNs now) {
  const PlainSession session = std::move(sessions.at(id));
  sessions.erase(id);
  figures.timed_dropped += session.timed.size();
  PlainDormant kept;
  kept.incarnation = session.incarnation;
  kept.owner = session.owner;
  kept.token = session.token;
  kept.last_frame_id = session.last_frame_id;
  kept.last_sequence = session.last_sequence;
  kept.owed_most = session.owed_most;
  kept.since = now;
  kept.until = now + kOutcomesKept;
  const bool has_layers = scene.HasLayers(id);
  switch (session.options.on_disconnect) {
    case DisconnectPolicy::kClear:
      break;
    case DisconnectPolicy::kLinger: {
      if (!has_layers) break;
      const sync::TimeNs over = now + session.options.linger_ns;
      lingering_.emplace(over, id);
      kept.until = std::max(kept.until, over);
      if (over > now) scene.HandOver(id, session.options.client_name, true);
      break;
    }
    case DisconnectPolicy::kKeep:
      if (!has_layers) break;
      kept.until = sync::kNever;
      scene.HandOver(id, session.options.client_name, true);
      break;
  }
  if (dormant.size() >= limits_.max_sessions) {
    auto soonest = dormant.begin();
    for (auto it = dormant.begin(); it != dormant.end(); ++it) {
      if (it->second.until < soonest->second.until) soonest = it;
    }
    dormant.erase(soonest);
  }
  dormant[id] = kept;
  if (session.options.on_disconnect == DisconnectPolicy::kClear) scene.RemoveLayersOf(id);
  Tidy();
}

void PlainCore::PassTime(sync::TimeNs now) {
  scene.Expire(now);
  while (!lingering_.empty() && lingering_.begin()->first <= now) {
    scene.RemoveLayersOf(lingering_.begin()->second);
    lingering_.erase(lingering_.begin());
  }
  for (auto& [id, session] : sessions) {
    std::stable_sort(session.timed.begin(), session.timed.end(),
                     [](const PlainCommit& a, const PlainCommit& b) {
                       return a.commit.present_at_ns < b.commit.present_at_ns;
                     });
    while (!session.timed.empty() && session.timed.front().commit.present_at_ns + slack <= now) {
      PlainCommit commit = std::move(session.timed.front());
      session.timed.erase(session.timed.begin());
      commit.late_known = slack == 0;
      commit.late = commit.late || !MayGo(session, session.owed_most);
      session.due.push_back(std::move(commit));
    }
  }
  std::erase_if(dormant, [now](const auto& entry) { return entry.second.until <= now; });
  Tidy();
}

sync::TimeNs PlainCore::NextDue() const {
  sync::TimeNs next = lingering_.empty() ? sync::kNever : lingering_.begin()->first;
  for (const auto& [number, owner] : scene.owners) {
    for (const auto& [name, layer] : owner.layers) {
      for (const auto& [id, entity] : layer.entities) {
        if (entity.expires_ns != 0) next = std::min(next, entity.expires_ns);
      }
    }
  }
  for (const auto& [id, session] : sessions) {
    for (const PlainCommit& commit : session.timed) {
      next = std::min(next, commit.commit.present_at_ns + slack);
    }
  }
  for (const auto& [id, kept] : dormant) next = std::min(next, kept.until);
  return next;
}

}  // namespace voxeld::daemon::model
