// Core's sessions: how they open, are taken up again, and end.
#include <algorithm>
#include <utility>

#include "absl/strings/str_format.h"
#include "daemon/core/core_impl.h"

namespace voxeld::daemon {
namespace {

// How long outcomes are kept for whoever takes the session up.
constexpr sync::TimeNs kOutcomesKept = 10 * sync::kSecond;

sync::TimeNs After(sync::TimeNs now, sync::TimeNs delay) {
  return delay < sync::kNever - now ? now + delay : sync::kNever;
}

}  // namespace

absl::Status Core::Impl::TooManySessions() const {
  return absl::ResourceExhaustedError(
      absl::StrFormat("%d sessions are open, which is max_sessions; close one first",
                      options_.limits.max_sessions));
}

absl::StatusOr<Core::Impl::Session> Core::Impl::NewSession(const OpenOptions& options) {
  if (sessions_.size() >= options_.limits.max_sessions) {
    return TooManySessions();
  }
  Session session;
  const auto known = options.principal.empty() ? owners_by_principal_.end()
                                               : owners_by_principal_.find(options.principal);
  if (options.owner_token.empty() && known != owners_by_principal_.end()) {
    session.owner = known->second;
  } else if (options.owner_token.empty()) {
    absl::StatusOr<std::string> token = NewToken();
    if (!token.ok()) return token.status();
    session.owner = next_owner_++;
    owner_tokens_.emplace(*token, session.owner);
    owners_[session.owner] = {.token = *std::move(token), .principal = options.principal};
    owner_records_ = nullptr;
    if (!options.principal.empty()) owners_by_principal_.emplace(options.principal, session.owner);
  } else {
    const auto owner = owner_tokens_.find(options.owner_token);
    // Somebody else's is as good as none.
    if (owner == owner_tokens_.end() || owners_.at(owner->second).principal != options.principal) {
      return absl::NotFoundError(
          "open.owner_token names no owner: it is wrong, or the owner has left and nothing of it "
          "is "
          "left in the scene; open without it to be a new one");
    }
    session.owner = owner->second;
  }
  session.id = next_session_++;
  session.writer = std::make_shared<const Writer>(
      Writer{.session = session.id,
             .client_name = options.client_name,
             .keep = options.on_disconnect == DisconnectPolicy::kKeep});
  return session;
}

std::string Core::Impl::PrincipalOf(SessionId id) const {
  const auto live = sessions_.find(id);
  const auto dormant = dormant_.find(id);
  if (live == sessions_.end() && dormant == dormant_.end()) return "";
  const uint64_t owner = live != sessions_.end() ? live->second.owner : dormant->second.owner;
  const auto found = owners_.find(owner);
  return found == owners_.end() ? "" : found->second.principal;
}

absl::StatusOr<Core::Impl::Session> Core::Impl::TakeUp(const OpenOptions& options,
                                                       std::deque<Receipt>* outcomes) {
  const auto token = resume_tokens_.find(options.resume_token);
  if (token == resume_tokens_.end() || PrincipalOf(token->second) != options.principal) {
    return absl::NotFoundError(
        "open.resume_token names no session: it has been used, or the session's time is over; open "
        "without it, and send again what should be in the scene");
  }
  const SessionId id = token->second;
  if (!sessions_.contains(id) && sessions_.size() >= options_.limits.max_sessions) {
    return TooManySessions();
  }
  if (const auto live = sessions_.find(id); live != sessions_.end()) {
    // Whatever its stream had sent counts first.
    Session& session = live->second;
    if (session.sink != nullptr) {
      session.sink->OnEnded(absl::AbortedError("the session was taken up by another stream"));
    }
    session.options.on_disconnect = DisconnectPolicy::kKeep;  // its layers are the new stream's
    CloseSession(id, session.incarnation, true, nullptr);
    FinishTurns(id);
  }
  const auto it = dormant_.find(id);
  if (it == dormant_.end()) {
    return absl::NotFoundError("open.resume_token names a session that could not be kept");
  }
  Dormant dormant = std::move(it->second);
  *outcomes = std::exchange(dormant.outcomes, {});
  dormant_.erase(it);
  resume_tokens_.erase(dormant.resume_token);
  std::erase_if(lingering_, [id](const auto& entry) { return entry.second.session == id; });
  Session session;
  session.id = id;
  session.incarnation = dormant.incarnation + 1;
  session.owner = dormant.owner;
  session.writer = std::make_shared<const Writer>(
      Writer{.session = id,
             .client_name = options.client_name,
             .keep = options.on_disconnect == DisconnectPolicy::kKeep});
  store_.HandOver(id, session.writer);
  Publish();
  session.owed_outcomes = dormant.owed_outcomes;
  session.last_frame_id = dormant.last_frame_id;
  session.last_sequence = dormant.last_sequence;
  ++sessions_resumed_;
  return session;
}

absl::StatusOr<SessionInfo> Core::Impl::OpenSession(OpenOptions options, uint64_t open_bytes,
                                                    std::shared_ptr<SessionSink> sink) {
  absl::StatusOr<std::string> token = NewToken();
  if (!token.ok()) return token.status();
  std::deque<Receipt> outcomes;
  absl::StatusOr<Session> made =
      options.resume_token.empty() ? NewSession(options) : TakeUp(options, &outcomes);
  if (!made.ok()) return made.status();
  Session& session = *made;
  session.options = std::move(options);
  session.options.resume_token.clear();
  session.options.owner_token.clear();
  session.sink = sink;
  session.resume_token = *std::move(token);
  resume_tokens_.emplace(session.resume_token, session.id);
  session.intake = std::make_shared<Intake>(
      options_.limits, budget_, bytes_in_, session.options, open_bytes, sink,
      [this, loop = loop_, id = session.id] { loop->Post([this, id] { PostTurn(id); }); });

  SessionInfo info;
  info.session = session.id;
  info.incarnation = session.incarnation;
  info.owner = session.owner;
  for (const auto& slot : displays_) info.displays.push_back(slot->info.name);
  info.intake = session.intake;
  info.resume_token = session.resume_token;
  info.owner_token = owners_.at(session.owner).token;
  info.credit_bytes = session.intake->first_credit();
  info.last_frame_id = session.last_frame_id;
  info.last_sequence = session.last_sequence;
  const SessionId id = session.id;
  sessions_.emplace(id, *std::move(made));
  if (!outcomes.empty()) {
    // After the answer.
    loop_->Post([this, id, outcomes = std::move(outcomes)] {
      for (const Receipt& receipt : outcomes) {
        budget_->Release(Budget::Use::kOwed, kOwedBytes);
        Deliver(id, receipt);
      }
    });
  }
  return info;
}

void Core::Impl::CloseSession(SessionId id, uint64_t incarnation, bool gone,
                              std::function<void()> done) {
  const auto it = sessions_.find(id);
  if (it == sessions_.end() || it->second.incarnation != incarnation) {
    if (done) done();
    return;
  }
  Session& session = it->second;
  if (done) session.when_closed.push_back(std::move(done));
  if (gone) session.sink = nullptr;
  if (std::exchange(session.closing, true)) return;
  session.intake->Close();
  ReleaseHold(session);
  PostTurn(id);  // what waits is applied first, each commit in its turn
}

void Core::Impl::FinishClose(SessionId id) {
  const auto it = sessions_.find(id);
  Session session = std::move(it->second);
  sessions_.erase(it);
  DropTimed(session);
  const sync::TimeNs now = clock_.Now();
  sync::TimeNs layers_until = now;
  switch (session.options.on_disconnect) {
    case DisconnectPolicy::kClear:
      break;
    case DisconnectPolicy::kLinger:
      if (HasLayers(id)) {
        PurgeLingering();
        layers_until = After(now, std::max<int64_t>(0, session.options.linger_ns));
        lingering_.emplace(layers_until, Lingering{id, session.owner});
      }
      break;
    case DisconnectPolicy::kKeep:
      if (HasLayers(id)) layers_until = sync::kNever;
      break;
  }
  if (layers_until > now) {
    store_.HandOver(
        id, std::make_shared<const Writer>(Writer{.session = id,
                                                  .client_name = session.writer->client_name,
                                                  .ended = true,
                                                  .keep = session.writer->keep}));
  }
  // Before its layers go: while it can be taken up its owner is remembered.
  if (session.options.resumable) {
    KeepDormant(session, layers_until);
  } else {
    resume_tokens_.erase(session.resume_token);
  }
  if (session.options.on_disconnect == DisconnectPolicy::kClear) {
    RemoveLayersOf(id, session.owner);
  } else {
    ForgetOwner(session.owner);
  }
  Publish();
  for (const std::function<void()>& done : session.when_closed) done();
}

void Core::Impl::KeepDormant(Session& session, sync::TimeNs layers_until) {
  const sync::TimeNs now = clock_.Now();
  Dormant dormant;
  dormant.incarnation = session.incarnation;
  dormant.owner = session.owner;
  dormant.resume_token = session.resume_token;
  dormant.last_frame_id = session.last_frame_id;
  dormant.last_sequence = session.last_sequence;
  dormant.owed_outcomes = session.owed_outcomes;
  dormant.outcomes = std::exchange(session.undelivered, {});
  dormant.outcomes_until = After(now, kOutcomesKept);
  dormant.until = std::max(dormant.outcomes_until, layers_until);
  // First, so that its owner stays though the one that makes room is of the same.
  dormant_.emplace(session.id, std::move(dormant));
  if (dormant_.size() <= options_.limits.max_sessions) return;
  auto soonest = dormant_.end();
  for (auto it = dormant_.begin(); it != dormant_.end(); ++it) {
    if (it->first == session.id) continue;
    if (soonest == dormant_.end() || it->second.until < soonest->second.until) soonest = it;
  }
  if (soonest != dormant_.end()) EndDormant(soonest->first);
}

void Core::Impl::EndDormant(SessionId id) {
  const auto it = dormant_.find(id);
  const Dormant dormant = std::move(it->second);
  dormant_.erase(it);
  outcomes_undelivered_ += dormant.outcomes.size();
  budget_->Release(Budget::Use::kOwed, dormant.outcomes.size() * kOwedBytes);
  resume_tokens_.erase(dormant.resume_token);
  ForgetOwner(dormant.owner);
}

// What lingered and has no layer left by other means. One walk, when there are twice as many as the last one left.
void Core::Impl::PurgeLingering() {
  if (lingering_.size() < purge_lingering_at_) return;
  std::set<SessionId> alive;
  store_.snapshot()->layers.ForEach(
      [&](const OwnedName&, const LayerPtr& layer) { alive.insert(layer->writer->session); });
  std::erase_if(lingering_,
                [&](const auto& entry) { return !alive.contains(entry.second.session); });
  purge_lingering_at_ = std::max(kLeastLingering, 2 * lingering_.size());
}

bool Core::Impl::HasLayers(SessionId session) const {
  bool any = false;
  store_.snapshot()->layers.ForEach([&](const OwnedName&, const LayerPtr& layer) {
    any = any || layer->writer->session == session;
  });
  return any;
}

bool Core::Impl::OwnerIsOpen(uint64_t owner) const {
  return std::any_of(sessions_.begin(), sessions_.end(),
                     [owner](const auto& entry) { return entry.second.owner == owner; });
}

void Core::Impl::RemoveLayersOf(SessionId session, uint64_t owner) {
  store_.RemoveLayers(
      [session](const OwnedName&, const Layer& layer) { return layer.writer->session == session; },
      false);
  ForgetOwner(owner);
}

void Core::Impl::ForgetOwner(uint64_t owner) {
  if (OwnerIsOpen(owner)) return;
  store_.ForgetOwner(owner);
  const OwnerTally* tally = store_.snapshot()->owners.Find(owner);
  if (tally != nullptr && *tally != OwnerTally()) return;
  for (const auto& [id, dormant] : dormant_) {
    if (dormant.owner == owner) return;
  }
  const auto it = owners_.find(owner);
  if (it == owners_.end()) return;
  owner_tokens_.erase(it->second.token);
  owners_by_principal_.erase(it->second.principal);
  owners_.erase(it);
  owner_records_ = nullptr;
}

sync::TimeNs Core::Impl::RunDue() {
  const sync::TimeNs now = clock_.Now();
  store_.Expire(now);
  while (!lingering_.empty() && lingering_.begin()->first <= now) {
    const Lingering over = lingering_.begin()->second;
    lingering_.erase(lingering_.begin());
    RemoveLayersOf(over.session, over.owner);
  }
  sync::TimeNs next = RunTimed(now);
  for (auto it = dormant_.begin(); it != dormant_.end();) {
    const SessionId id = it->first;
    Dormant& dormant = it->second;
    ++it;
    if (dormant.outcomes_until <= now) {
      outcomes_undelivered_ += dormant.outcomes.size();
      budget_->Release(Budget::Use::kOwed, dormant.outcomes.size() * kOwedBytes);
      dormant.outcomes.clear();
    } else if (!dormant.outcomes.empty()) {
      next = std::min(next, dormant.outcomes_until);
    }
    next = std::min(next, dormant.until <= now ? sync::kNever : dormant.until);
    if (dormant.until <= now) EndDormant(id);
  }
  Publish();
  next = std::min(next, store_.next_expiry());
  return lingering_.empty() ? next : std::min(next, lingering_.begin()->first);
}

void Core::Impl::Publish() {
  if (published_ == store_.snapshot()) return;
  Retire(std::exchange(published_, store_.snapshot()));
  OfferState(false);
  scene_watch_.Publish(published_);
  budget_->Set(Budget::Use::kScene, published_->total.bytes);
  for (const auto& slot : displays_) {
    slot->host->work->Post([pipeline = slot->host->pipeline.get(), snapshot = published_] {
      pipeline->Show(snapshot);
    });
  }
}

}  // namespace voxeld::daemon
