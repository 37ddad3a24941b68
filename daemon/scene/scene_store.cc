#include "daemon/scene/scene_store.h"

#include <set>
#include <utility>

namespace voxeld::daemon {
namespace {

SnapshotPtr FirstSnapshot() {
  Snapshot empty;
  empty.number = 1;
  return std::make_shared<const Snapshot>(std::move(empty));
}

}  // namespace

SceneStore::SceneStore(const Limits& limits) : limits_(limits), snapshot_(FirstSnapshot()) {}

void SceneStore::Publish(Draft draft) {
  snapshot_ = std::move(draft).Finish(snapshot_->number + 1);
}

CommitResult SceneStore::Apply(const Author& author, std::vector<Operation> operations,
                               sync::TimeNs now, bool strict, uint64_t refused_before) {
  Draft draft(snapshot_, next_number_);
  CommitApplier applier(draft, limits_, views_, room_, author, now);
  CommitResult result;
  for (Operation& operation : operations) {
    if (abandoned_) break;
    applier.Apply(operation);
  }
  applier.End();

  result.issues = applier.refusals().issues;
  result.first_refusal = applier.refusals().first;
  result.more_issues = applier.refusals().more + applier.refusals().more_applied;
  result.refused_operations = applier.refused() + refused_before;
  result.abandoned = abandoned_;
  if (result.abandoned || (strict && result.refused_operations > 0)) return result;
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
