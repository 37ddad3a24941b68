#include "daemon/scene/scene_store.h"

#include <algorithm>
#include <set>
#include <utility>

#include "daemon/scene/view_check.h"

namespace voxeld::daemon {
namespace {

SnapshotPtr FirstSnapshot() {
  Snapshot empty;
  empty.number = 1;
  return std::make_shared<const Snapshot>(std::move(empty));
}

// Returns: the cost of an operation, in operations on one primitive.
uint64_t WorkOf(const Operation& operation) {
  size_t parts = 0;
  if (const auto* upsert = std::get_if<Upsert>(&operation.op)) {
    const auto* group = std::get_if<GroupPtr>(&upsert->entity.content);
    if (group != nullptr) parts = (*group)->parts.size();
  } else if (const auto* define = std::get_if<DefineObject>(&operation.op)) {
    parts = define->data->parts.size();
  }
  return std::max<uint64_t>(1, parts);
}

}  // namespace

SceneStore::PendingCommit::PendingCommit(SceneStore& store, Author author,
                                         std::vector<Operation> operations, sync::TimeNs now,
                                         bool strict, uint64_t refused_before)
    : store_(store),
      author_(std::move(author)),
      operations_(std::move(operations)),
      strict_(strict),
      refused_before_(refused_before),
      draft_(store.snapshot_, store.next_number_),
      applier_(draft_, store.limits_, store.views_, store.room_, author_, now) {
  store_.pending_.insert(this);
}

SceneStore::PendingCommit::~PendingCommit() { store_.pending_.erase(this); }

SceneStore::SceneStore(const Limits& limits) : limits_(limits), snapshot_(FirstSnapshot()) {}

void SceneStore::Publish(Draft draft) {
  snapshot_ = std::move(draft).Finish(snapshot_->number + 1);
}

CommitResult SceneStore::Apply(const Author& author, std::vector<Operation> operations,
                               sync::TimeNs now, bool strict, uint64_t refused_before) {
  std::unique_ptr<PendingCommit> pending =
      Begin(author, std::move(operations), now, strict, refused_before);
  while (!Continue(*pending, UINT64_MAX)) {
  }
  return Finish(std::move(pending));
}

std::unique_ptr<SceneStore::PendingCommit> SceneStore::Begin(Author author,
                                                             std::vector<Operation> operations,
                                                             sync::TimeNs now, bool strict,
                                                             uint64_t refused_before) {
  return std::make_unique<PendingCommit>(*this, std::move(author), std::move(operations), now,
                                         strict, refused_before);
}

void SceneStore::Rebase(PendingCommit& pending) {
  if (pending.draft_.base().number == snapshot_->number) return;
  pending.draft_.Rebase(snapshot_, pending.author_.owner, pending.applier_.touched());
}

OwnerTally SceneStore::PromisedBeside(const PendingCommit& pending) const {
  OwnerTally promised;
  for (const PendingCommit* other : pending_) {
    if (other == &pending) continue;
    const OwnerTally growth = other->draft_.Growth();
    promised.drawables += growth.drawables;
    promised.layers += growth.layers;
    promised.bytes += growth.bytes;
    promised.derived += growth.derived;
  }
  return promised;
}

bool SceneStore::Continue(PendingCommit& pending, uint64_t operations) {
  CommitApplier& applier = pending.applier_;
  Rebase(pending);
  room_.promised = PromisedBeside(pending);
  uint64_t work = 0;
  while (work < operations) {
    if (abandoned_) return true;
    if (applier.replaying()) {
      const Operation* operation = applier.next_replayed();
      work += operation == nullptr ? 1 : WorkOf(*operation);
      applier.Replay();
    } else if (pending.next_ < pending.operations_.size()) {
      Operation& operation = pending.operations_[pending.next_++];
      work += WorkOf(operation);
      applier.Apply(operation);
    } else {
      return true;
    }
  }
  return false;
}

void SceneStore::SetQuotas(PendingCommit& pending, bool suppressed, uint64_t max_bytes,
                           uint64_t max_entities) {
  pending.author_.suppressed = suppressed;
  pending.author_.max_bytes = max_bytes;
  pending.author_.max_entities = max_entities;
}

absl::Status SceneStore::CheckNewView(const DisplayView& view) {
  uint64_t none = 0;
  absl::Status status = CheckView(Draft(snapshot_, none), view, limits_);
  for (PendingCommit* pending : pending_) {
    Rebase(*pending);
    status.Update(CheckView(pending->draft_, view, limits_));
  }
  return status;
}

CommitResult SceneStore::Finish(std::unique_ptr<PendingCommit> pending) {
  Draft& draft = pending->draft_;
  CommitApplier& applier = pending->applier_;
  Rebase(*pending);
  draft.Suppress(pending->author_.owner, pending->author_.suppressed);
  applier.End();

  CommitResult result;
  result.spent = std::move(pending->operations_);
  result.issues = applier.refusals().issues;
  result.first_refusal = applier.refusals().first;
  result.more_issues = applier.refusals().more + applier.refusals().more_applied;
  result.refused_operations = applier.refused() + pending->refused_before_;
  result.abandoned = abandoned_;
  if (result.abandoned || (pending->strict_ && result.refused_operations > 0)) return result;
  result.applied = true;
  result.applied_operations = applier.applied();
  result.hidden = applier.hidden();
  Publish(std::move(draft));
  return result;
}

sync::TimeNs SceneStore::next_expiry() const {
  sync::TimeNs next = sync::kNever;
  snapshot_->expiries.ForEachFrom({INT64_MIN, 0}, [&](const ExpiryKey& key, const EntityPlace&) {
    next = key.time_ns;
    return false;
  });
  return next;
}

bool SceneStore::Expire(sync::TimeNs now) {
  bool any = false;
  for (sync::TimeNs next = next_expiry(); next <= now && next != sync::kNever;
       next = next_expiry()) {
    std::vector<EntityPlace> ended;
    snapshot_->expiries.ForEachFrom({next, 0}, [&](const ExpiryKey& key, const EntityPlace& place) {
      if (key.time_ns != next) return false;
      ended.push_back(place);
      return true;
    });
    Draft draft(snapshot_, next_number_);
    for (const EntityPlace& place : ended) draft.RemoveEntity(place.layer, place.id);
    Publish(std::move(draft));
    any = true;
  }
  return any;
}

SceneStore::Removed SceneStore::RemoveLayers(
    const std::function<bool(const OwnedName&, const Layer&)>& matches, bool keep_state) {
  Removed removed;
  std::vector<OwnedName> keys;
  std::set<uint64_t> owners;
  snapshot_->layers.ForEach([&](const OwnedName& key, const LayerPtr& layer) {
    if (!matches(key, *layer) || (keep_state && layer->entities.empty())) return;
    keys.push_back(key);
    owners.insert(key.owner);
    removed.entities += layer->entities.size();
    ++removed.layers;
  });
  if (keys.empty()) return removed;
  Draft draft(snapshot_, next_number_);
  for (const OwnedName& key : keys) {
    if (keep_state) {
      draft.ClearLayer(key);
    } else {
      draft.RemoveLayer(key);
    }
  }
  Publish(std::move(draft));
  removed.owners.assign(owners.begin(), owners.end());
  return removed;
}

void SceneStore::Suppress(uint64_t owner, bool suppressed) {
  std::vector<std::pair<OwnedName, WriterPtr>> layers;
  snapshot_->layers.ForEachFrom({owner, ""}, [&](const OwnedName& key, const LayerPtr& layer) {
    if (key.owner != owner) return false;
    if (layer->suppressed != suppressed) layers.emplace_back(key, layer->writer);
    return true;
  });
  if (layers.empty()) return;
  Draft draft(snapshot_, next_number_);
  for (const auto& [key, writer] : layers) draft.EditLayer(key, writer).suppressed = suppressed;
  Publish(std::move(draft));
}

void SceneStore::HandOver(uint64_t session, const WriterPtr& writer) {
  std::vector<OwnedName> keys;
  snapshot_->layers.ForEach([&](const OwnedName& key, const LayerPtr& layer) {
    const Writer& now = *layer->writer;
    if (now.session == session && now != *writer) keys.push_back(key);
  });
  if (keys.empty()) return;
  Draft draft(snapshot_, next_number_);
  for (const OwnedName& key : keys) draft.EditLayer(key, writer);
  Publish(std::move(draft));
}

void SceneStore::ForgetOwner(uint64_t owner) {
  const OwnerTally* tally = snapshot_->owners.Find(owner);
  if (tally == nullptr || tally->layers > 0) return;
  std::vector<OwnedName> keys;
  snapshot_->objects.ForEachFrom({owner, ""}, [&](const OwnedName& key, const ObjectPtr&) {
    if (key.owner != owner) return false;
    keys.push_back(key);
    return true;
  });
  if (keys.empty()) return;
  Draft draft(snapshot_, next_number_);
  for (const OwnedName& key : keys) draft.RemoveObject(key);
  Publish(std::move(draft));
}

}  // namespace voxeld::daemon
