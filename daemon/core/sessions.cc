// Core's sessions: operations in, commits, receipts out.
#include <algorithm>
#include <utility>

#include "absl/strings/str_format.h"
#include "daemon/core/core_impl.h"

namespace voxeld::daemon {
namespace {

// What an operation holds while it waits for its commit.
uint64_t StagedBytes(const Operation& operation) {
  uint64_t bytes = sizeof(Operation);
  if (const auto* upsert = std::get_if<Upsert>(&operation.op)) {
    bytes += upsert->layer.size() + upsert->id.size() + upsert->entity.label.size() +
             BytesOf(upsert->entity.content);
  } else if (const auto* define = std::get_if<DefineObject>(&operation.op)) {
    bytes += Draft::ObjectBytes(define->object, *define->data);
  }
  return bytes;
}

std::pair<std::string, std::string> NamesIn(const Operation& operation) {
  if (const auto* o = std::get_if<Upsert>(&operation.op)) return {o->layer, o->id};
  if (const auto* o = std::get_if<SetTransform>(&operation.op)) return {o->layer, o->id};
  if (const auto* o = std::get_if<Delete>(&operation.op)) return {o->layer, o->id_or_prefix};
  if (const auto* o = std::get_if<LayerState>(&operation.op)) return {o->layer, ""};
  if (const auto* o = std::get_if<FrameBegin>(&operation.op)) return {o->layer, ""};
  if (const auto* o = std::get_if<FrameEnd>(&operation.op)) return {o->layer, ""};
  if (const auto* o = std::get_if<DefineObject>(&operation.op)) return {"", o->object};
  if (const auto* o = std::get_if<DeleteObject>(&operation.op)) return {"", o->object};
  return {};
}

struct FieldName {
  const char* operator()(const Upsert&) const { return "upsert"; }
  const char* operator()(const Delete&) const { return "delete"; }
  const char* operator()(const SetTransform&) const { return "set_transform"; }
  const char* operator()(const LayerState&) const { return "layer_state"; }
  const char* operator()(const FrameBegin&) const { return "frame_begin"; }
  const char* operator()(const FrameEnd&) const { return "frame_end"; }
  const char* operator()(const DefineObject&) const { return "define_object"; }
  const char* operator()(const DeleteObject&) const { return "delete_object"; }
  const char* operator()(const Commit&) const { return "commit"; }
};

}  // namespace

void Core::Impl::OpenSession(OpenOptions options, std::shared_ptr<SessionSink> sink,
                             const Reply<SessionInfo>& reply) {
  if (sessions_.size() >= options_.limits.max_sessions) {
    return reply(absl::ResourceExhaustedError(
        absl::StrFormat("%d sessions are open, which is max_sessions; close one first",
                        options_.limits.max_sessions)));
  }
  Session session;
  session.id = next_session_++;
  session.owner = next_owner_++;
  session.writer = std::make_shared<const Writer>(Writer{session.id, options.client_name});
  session.options = std::move(options);
  session.sink = std::move(sink);
  SessionInfo info;
  info.session = session.id;
  info.owner = session.owner;
  for (const auto& slot : displays_) info.displays.push_back(slot->info.name);
  sessions_.emplace(session.id, std::move(session));
  reply(std::move(info));
}

void Core::Impl::Refuse(Session& session, const Issue& issue) {
  ++session.refused;
  if (session.first_refusal.empty()) {
    session.first_refusal = absl::StrFormat("%s: %s", issue.field, issue.message);
  }
}

void Core::Impl::Tell(Session& session, const Issue& issue) {
  if (session.issues_told >= options_.limits.max_issues_per_commit) {
    ++session.issues_left_out;
    return;
  }
  ++session.issues_told;
  session.sink->OnIssue(issue);
}

void Core::Impl::TellOfThoseLeftOut(Session& session, uint64_t sequence) {
  session.issues_told = 0;
  const uint64_t left_out = std::exchange(session.issues_left_out, 0);
  if (left_out == 0) return;
  session.sink->OnIssue({sequence,
                         {},
                         {},
                         "commit",
                         Reason::kQuotaExceeded,
                         absl::StrFormat("%d more issues are left out, beyond the %d of "
                                         "max_issues_per_commit; the receipt counts them; commit "
                                         "fewer operations at a time to be told of each",
                                         left_out, options_.limits.max_issues_per_commit)});
}

void Core::Impl::Handle(SessionId id, std::vector<Operation> operations, const Refusals& refused,
                        uint64_t bytes) {
  bytes_in_ += bytes;
  const auto it = sessions_.find(id);
  if (it == sessions_.end()) return;
  Session& session = it->second;
  for (const Issue& issue : refused.issues) Tell(session, issue);
  session.issues_left_out += refused.more;
  session.refused += refused.more;

  // What decoding refused counts for the commit that it came before.
  std::vector<const Issue*> uncounted;
  uncounted.reserve(refused.issues.size());
  for (const Issue& issue : refused.issues) uncounted.push_back(&issue);
  const auto count_up_to = [&](uint64_t sequence) {
    std::erase_if(uncounted, [&](const Issue* issue) {
      if (issue->sequence > sequence) return false;
      Refuse(session, *issue);
      return true;
    });
  };
  for (Operation& operation : operations) {
    if (std::holds_alternative<Commit>(operation.op)) {
      count_up_to(operation.sequence);
      EndCommit(session, operation);
    } else {
      Stage(session, std::move(operation));
    }
  }
  count_up_to(UINT64_MAX);
}

void Core::Impl::Stage(Session& session, Operation operation) {
  const Limits& limits = options_.limits;
  std::optional<Issue> issue;
  const uint64_t bytes = StagedBytes(operation);
  const auto over = [&](std::string message) {
    auto [layer, id] = NamesIn(operation);
    issue = Issue{operation.sequence,     std::move(layer),
                  std::move(id),          std::visit(FieldName(), operation.op),
                  Reason::kQuotaExceeded, std::move(message)};
  };
  if (session.staged.size() >= limits.max_operations_per_commit) {
    over(
        absl::StrFormat("%d operations wait for a commit, which is max_operations_per_commit; "
                        "commit first",
                        session.staged.size()));
  } else if (session.staged_bytes + bytes > limits.max_uncommitted_bytes) {
    over(absl::StrFormat(
        "%d bytes would wait for a commit; max_uncommitted_bytes is %d; commit first",
        session.staged_bytes + bytes, limits.max_uncommitted_bytes));
  } else if (staged_bytes_ + bytes > limits.max_uncommitted_bytes_total) {
    over(absl::StrFormat(
        "%d bytes of all sessions would wait for their commits; max_uncommitted_bytes_total is %d; "
        "commit first, or try again when others have committed",
        staged_bytes_ + bytes, limits.max_uncommitted_bytes_total));
  } else {
    issue = CheckAlone(operation, limits);
  }
  if (issue.has_value()) {
    Refuse(session, *issue);
    return Tell(session, *issue);
  }
  staged_bytes_ += bytes;
  session.staged_bytes += bytes;
  session.staged.push_back(std::move(operation));
}

void Core::Impl::EndCommit(Session& session, const Operation& operation) {
  const Commit& commit = std::get<Commit>(operation.op);
  client_drops_ += commit.client_drops;
  const sync::TimeNs now = clock_.Now();
  store_.Expire(now);
  CommitResult result =
      store_.Apply({session.owner, session.writer}, std::exchange(session.staged, {}), now,
                   session.options.strict, std::exchange(session.refused, 0));
  staged_bytes_ -= std::exchange(session.staged_bytes, 0);
  std::string first_refusal = std::exchange(session.first_refusal, "");
  if (first_refusal.empty() && !result.issues.empty()) {
    const Issue& first = result.issues.front();
    first_refusal = absl::StrFormat("%s: %s", first.field, first.message);
  }
  for (const Issue& issue : result.issues) Tell(session, issue);
  session.issues_left_out += result.more_issues;
  TellOfThoseLeftOut(session, operation.sequence);
  operations_refused_ += result.refused_operations;

  Receipt receipt;
  receipt.frame_id = commit.frame_id;
  receipt.sequence = operation.sequence;
  if (!result.applied) {
    ++commits_refused_;
    Refused refused;
    refused.refused_operations = result.refused_operations;
    if (result.abandoned) {
      refused.message =
          "the daemon is being stopped, so nothing of the commit was applied; send it again to one "
          "that runs";
    } else {
      refused.message = absl::StrFormat(
          "the session is strict and %d operations were refused, so nothing of the commit was "
          "applied; "
          "the first: %s",
          result.refused_operations, first_refusal);
    }
    receipt.what = std::move(refused);
    session.sink->OnReceipt(receipt);
    return Publish();  // what had expired
  }

  ++commits_accepted_;
  operations_applied_ += result.applied_operations;
  Accepted accepted;
  accepted.snapshot = store_.snapshot()->number;
  accepted.refused_operations = result.refused_operations;
  accepted.applied_time_ns = now;
  if (!session.options.no_outcomes) {
    for (const auto& slot : displays_) accepted.displays.push_back(slot->info.name);
  }
  receipt.what = std::move(accepted);
  scene_watch_.Publish(store_.snapshot());  // who has the receipt sees the commit
  session.sink->OnReceipt(receipt);

  published_ = store_.snapshot();
  const Rider rider{session.id, commit.frame_id, operation.sequence, now,
                    !session.options.no_outcomes};
  for (const auto& slot : displays_) {
    const bool posted = slot->host->work->Post(
        [pipeline = slot->host->pipeline.get(), snapshot = published_, rider,
         hidden = result.hidden] { pipeline->Show(snapshot, rider, hidden); });
    if (!posted) {  // the daemon is being stopped, and the display already is
      CommitOutcome outcome;
      outcome.display = slot->info.name;
      outcome.kind = CommitOutcome::Kind::kNotShown;
      outcome.why = CommitOutcome::NotShown::kRemoved;
      DeliverOutcome(rider, outcome);
    }
  }
}

void Core::Impl::DeliverOutcome(const Rider& rider, const CommitOutcome& outcome) {
  if (!rider.asked) return;
  const auto it = sessions_.find(rider.session);
  if (it == sessions_.end()) {
    ++outcomes_undelivered_;
    return;
  }
  Receipt receipt;
  receipt.frame_id = rider.frame_id;
  receipt.sequence = rider.sequence;
  receipt.what = outcome;
  it->second.sink->OnReceipt(receipt);
}

bool Core::Impl::OwnerIsOpen(uint64_t owner) const {
  return std::any_of(sessions_.begin(), sessions_.end(),
                     [owner](const auto& entry) { return entry.second.owner == owner; });
}

void Core::Impl::RemoveLayersOf(SessionId session, uint64_t owner) {
  store_.RemoveLayers(
      [session](const OwnedName&, const Layer& layer) { return layer.writer->session == session; },
      false);
  if (!OwnerIsOpen(owner)) store_.ForgetOwner(owner);
}

void Core::Impl::CloseSession(SessionId id) {
  const auto it = sessions_.find(id);
  if (it == sessions_.end()) return;
  const Session session = std::move(it->second);
  sessions_.erase(it);
  staged_bytes_ -= session.staged_bytes;
  if (session.options.on_disconnect != DisconnectPolicy::kClear) store_.OrphanLayers(id);
  switch (session.options.on_disconnect) {
    case DisconnectPolicy::kClear:
      RemoveLayersOf(id, session.owner);
      break;
    case DisconnectPolicy::kLinger:
      if (const OwnerTally* tally = store_.snapshot()->owners.Find(session.owner);
          tally != nullptr && tally->layers > 0) {
        const sync::TimeNs now = clock_.Now();
        const int64_t linger = std::max<int64_t>(0, session.options.linger_ns);
        lingering_.emplace(linger < sync::kNever - now ? now + linger : sync::kNever,
                           Lingering{id, session.owner});
        break;
      }
      [[fallthrough]];
    case DisconnectPolicy::kKeep:
      if (!OwnerIsOpen(session.owner)) store_.ForgetOwner(session.owner);
      break;
  }
  Publish();
}

void Core::Impl::ClearLayer(uint64_t owner, const std::string& layer, bool keep_state,
                            const Reply<Cleared>& reply) {
  const SceneStore::Removed removed = store_.RemoveLayers(
      [&](const OwnedName& key, const Layer&) {
        return (owner == 0 || key.owner == owner) && (layer.empty() || key.name == layer);
      },
      keep_state);
  for (const uint64_t affected : removed.owners) {
    if (!OwnerIsOpen(affected)) store_.ForgetOwner(affected);
  }
  Publish();
  reply(Cleared{removed.entities, removed.layers});
}

sync::TimeNs Core::Impl::RunDue() {
  const sync::TimeNs now = clock_.Now();
  store_.Expire(now);
  while (!lingering_.empty() && lingering_.begin()->first <= now) {
    const Lingering over = lingering_.begin()->second;
    lingering_.erase(lingering_.begin());
    RemoveLayersOf(over.session, over.owner);
  }
  Publish();
  return std::min(store_.next_expiry(),
                  lingering_.empty() ? sync::kNever : lingering_.begin()->first);
}

void Core::Impl::Publish() {
  if (published_ == store_.snapshot()) return;
  published_ = store_.snapshot();
  scene_watch_.Publish(published_);
  for (const auto& slot : displays_) {
    slot->host->work->Post([pipeline = slot->host->pipeline.get(), snapshot = published_] {
      pipeline->Show(snapshot);
    });
  }
}

}  // namespace voxeld::daemon
