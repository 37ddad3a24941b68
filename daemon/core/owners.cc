// Who has something in the scene, and what an operator may do about it.
#include <algorithm>
#include <map>
#include <utility>

#include "absl/strings/str_format.h"
#include "daemon/core/core_impl.h"

namespace voxeld::daemon {

void Core::Impl::ClearLayer(uint64_t owner, const std::string& layer, bool keep_state,
                            const std::optional<std::string>& principal,
                            const Reply<Cleared>& reply) {
  if (principal.has_value()) {
    const auto own = owners_by_principal_.find(*principal);
    const bool none = principal->empty() || own == owners_by_principal_.end();
    if (none && owner == 0 && !principal->empty()) return reply(Cleared{});
    if (none || (owner != 0 && owner != own->second)) {
      return reply(absl::PermissionDeniedError(
          absl::StrFormat("clearing others' layers takes the scope control; %s",
                          none ? "the caller has none of its own"
                               : absl::StrFormat("its own owner is %d", own->second))));
    }
    owner = own->second;
  }
  const SceneStore::Removed removed = store_.RemoveLayers(
      [&](const OwnedName& key, const Layer&) {
        return (owner == 0 || key.owner == owner) && (layer.empty() || key.name == layer);
      },
      keep_state);
  for (const uint64_t affected : removed.owners) ForgetOwner(affected);
  Publish();
  reply(Cleared{removed.entities, removed.layers});
}

std::vector<OwnerInfo> Core::Impl::ListOwners() const {
  std::map<uint64_t, OwnerInfo> infos;
  for (const auto& [number, owner] : owners_) {
    OwnerInfo& info = infos[number];
    info.owner = number;
    info.principal = owner.principal;
    info.hidden = owner.hidden;
    info.max_bytes = std::min(owner.max_bytes, options_.limits.max_bytes_per_owner);
    info.max_entities = std::min(owner.max_entities, options_.limits.max_entities_per_owner);
  }
  for (const auto& [id, session] : sessions_) {
    OwnerInfo& info = infos[session.owner];
    ++info.sessions;
    info.client_names.push_back(session.options.client_name);
  }
  const Snapshot& scene = *store_.snapshot();
  scene.layers.ForEach([&](const OwnedName& key, const LayerPtr& layer) {
    OwnerInfo& info = infos[key.owner];
    ++info.layers;
    info.entities += layer->entities.size();
    if (layer->writer->ended) ++info.orphaned_layers;
  });
  scene.objects.ForEach(
      [&](const OwnedName& key, const ObjectPtr&) { ++infos[key.owner].objects; });
  scene.owners.ForEach(
      [&](uint64_t owner, const OwnerTally& tally) { infos[owner].bytes = tally.bytes; });
  std::vector<OwnerInfo> all;
  all.reserve(infos.size());
  for (auto& [number, info] : infos) {
    info.owner = number;
    all.push_back(std::move(info));
  }
  return all;
}

absl::StatusOr<OwnerInfo> Core::Impl::ControlOwner(const OwnerControl& control) {
  const auto it = owners_.find(control.owner);
  if (it == owners_.end()) {
    return absl::NotFoundError(
        absl::StrFormat("no owner %d; ListOwners tells which there are", control.owner));
  }
  const Limits& limits = options_.limits;
  const auto above = [](const char* field, uint64_t value, uint64_t most) {
    return absl::InvalidArgumentError(
        absl::StrFormat("%s is %d; give at most the limit of each owner, %d, or 0 for just that",
                        field, value, most));
  };
  if (control.max_bytes.value_or(0) > limits.max_bytes_per_owner) {
    return above("max_bytes", *control.max_bytes, limits.max_bytes_per_owner);
  }
  if (control.max_entities.value_or(0) > limits.max_entities_per_owner) {
    return above("max_entities", *control.max_entities, limits.max_entities_per_owner);
  }
  Owner& owner = it->second;
  const auto set = [](const std::optional<uint64_t>& to, uint64_t& quota) {
    if (to.has_value()) quota = *to == 0 ? UINT64_MAX : *to;
  };
  set(control.max_bytes, owner.max_bytes);
  set(control.max_entities, owner.max_entities);
  owner_records_ = nullptr;
  if (control.hidden.has_value()) {
    owner.hidden = *control.hidden;
    store_.Suppress(control.owner, owner.hidden);
    Publish();
  }
  OfferState(false);
  OwnerInfo answer;
  for (OwnerInfo& info : ListOwners()) {
    if (info.owner == control.owner) answer = std::move(info);
  }
  if (control.evict) Evict(control.owner);
  return answer;
}

void Core::Impl::Evict(uint64_t owner) {
  std::vector<SessionId> sessions;
  for (auto& [id, session] : sessions_) {
    if (session.owner != owner) continue;
    sessions.push_back(id);
    if (session.sink != nullptr) {
      session.sink->OnEnded(
          absl::PermissionDeniedError("an operator has evicted the session's owner"));
    }
    session.closing = true;
    session.sink = nullptr;
    session.intake->Close();
    ReleaseHold(session);
  }
  for (const SessionId id : sessions) {
    FinishTurns(id);
  }
  std::erase_if(lingering_, [owner](const auto& entry) { return entry.second.owner == owner; });
  store_.RemoveLayers([owner](const OwnedName& key, const Layer&) { return key.owner == owner; },
                      false);
  std::vector<SessionId> dormant;
  for (const auto& [id, kept] : dormant_) {
    if (kept.owner == owner) dormant.push_back(id);
  }
  for (const SessionId id : dormant) EndDormant(id);
  ForgetOwner(owner);
  Publish();
}

}  // namespace voxeld::daemon
