// What outlives the daemon: handed to whoever writes it down, and taken back.
#include <algorithm>
#include <iterator>
#include <utility>

#include "daemon/core/core_impl.h"

namespace voxeld::daemon {

void Core::Impl::OfferState(bool at_once) {
  if (options_.state == nullptr || published_ == nullptr) return;
  if (owner_records_ == nullptr) {
    OwnerRecords records;
    for (const auto& [number, owner] : owners_) {
      records[number] = {owner.token, owner.principal, owner.hidden, owner.max_bytes,
                         owner.max_entities};
    }
    owner_records_ = std::make_shared<const OwnerRecords>(std::move(records));
  }
  options_.state->Offer(published_, owner_records_, at_once);
}

bool Core::Impl::WillBeDurable(const Session& session, const WaitingCommit& commit) {
  Issue issue{.sequence = commit.sequence, .field = "commit.durable", .applied = true};
  if (options_.state == nullptr) {
    issue.reason = Reason::kUnimplemented;
    issue.message =
        "durable is true, and this server keeps nothing; have it started with --state-dir";
  } else if (!session.writer->keep) {
    issue.reason = Reason::kInvalidValue;
    issue.message =
        "durable is true, and the session's layers go when it ends; open it with on_disconnect "
        "KEEP";
  } else {
    undurable_.emplace(
        store_.snapshot()->number,
        Undurable{session.id, session.incarnation, commit.commit.frame_id, commit.sequence});
    return true;
  }
  if (session.sink != nullptr) session.sink->OnIssue(issue);
  return false;
}

void Core::Impl::OnDurable(uint64_t snapshot) {
  const auto end = undurable_.upper_bound(snapshot);
  for (auto it = undurable_.begin(); it != end; ++it) {
    const Undurable& commit = it->second;
    Deliver(commit.session,
            {commit.frame_id, commit.sequence, Durable{snapshot}, commit.incarnation});
  }
  undurable_.erase(undurable_.begin(), end);
}

std::vector<Issue> Core::Impl::Restore(RestoredScene scene) {
  std::vector<Issue> issues;
  for (const auto& [number, record] : scene.owners) {
    owners_[number] = {.token = record.token,
                       .principal = record.principal,
                       .hidden = record.hidden,
                       .max_bytes = record.max_bytes,
                       .max_entities = record.max_entities};
    owner_tokens_.emplace(record.token, number);
    if (!record.principal.empty()) owners_by_principal_.emplace(record.principal, number);
    next_owner_ = std::max(next_owner_, number + 1);
  }
  store_.SkipNumbers(scene.greatest_number);
  const sync::TimeNs now = clock_.Now();
  for (RestoredScene::Step& step : scene.steps) {
    const auto found = owners_.find(step.owner);
    if (found == owners_.end()) continue;
    const Owner& owner = found->second;
    const Author author{step.owner,
                        std::make_shared<const Writer>(
                            Writer{.client_name = step.client_name, .ended = true, .keep = true}),
                        owner.hidden,
                        true,
                        owner.max_bytes,
                        owner.max_entities};
    CommitResult result = store_.Apply(author, std::move(step.operations), now);
    std::move(result.issues.begin(), result.issues.end(), std::back_inserter(issues));
  }
  for (const auto& [number, record] : scene.owners) ForgetOwner(number);
  owner_records_ = nullptr;
  Publish();
  return issues;
}

}  // namespace voxeld::daemon
