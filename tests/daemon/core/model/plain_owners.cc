// The actions of operators, and their effects on owners.
#include <algorithm>

#include "tests/daemon/core/model/plain_core.h"

namespace voxeld::daemon::model {

Cleared PlainCore::ClearLayer(uint64_t owner, const std::string& layer, bool keep_state) {
  Cleared cleared;
  for (auto& [number, who] : scene.owners) {
    if (owner != 0 && owner != number) continue;
    for (auto it = who.layers.begin(); it != who.layers.end();) {
      auto& [name, state] = *it;
      if ((!layer.empty() && layer != name) || (keep_state && state.entities.empty())) {
        ++it;
        continue;
      }
      cleared.entities += state.entities.size();
      ++cleared.layers;
      state.entities.clear();
      it = keep_state ? std::next(it) : who.layers.erase(it);
    }
  }
  Tidy();
  return cleared;
}

absl::StatusCode PlainCore::MayControl(const OwnerControl& control) const {
  if (!scene.owners.contains(control.owner)) return absl::StatusCode::kNotFound;
  if (control.max_bytes.value_or(0) > limits_.max_bytes_per_owner ||
      control.max_entities.value_or(0) > limits_.max_entities_per_owner) {
    return absl::StatusCode::kInvalidArgument;
  }
  return absl::StatusCode::kOk;
}

void PlainCore::Control(const OwnerControl& control) {
  PlainOwner& owner = scene.owners.at(control.owner);
  if (control.hidden.has_value()) owner.hidden = *control.hidden;
  const auto quota = [](uint64_t value) { return value == 0 ? UINT64_MAX : value; };
  if (control.max_bytes.has_value()) owner.max_bytes = quota(*control.max_bytes);
  if (control.max_entities.has_value()) owner.max_entities = quota(*control.max_entities);
}

void PlainCore::EndOwner(uint64_t number) {
  scene.owners.at(number).layers.clear();
  std::erase_if(dormant, [number](const auto& entry) { return entry.second.owner == number; });
  Tidy();
  std::erase_if(lingering_, [this](const auto& entry) { return !scene.HasLayers(entry.second); });
}

std::map<uint64_t, OwnerInfo> PlainCore::Owners() const {
  std::map<uint64_t, OwnerInfo> infos;
  for (const auto& [number, owner] : scene.owners) {
    const PlainCount count = scene.Count(owner);
    OwnerInfo& info = infos[number];
    info.owner = number;
    info.hidden = owner.hidden;
    info.max_bytes = std::min(owner.max_bytes, limits_.max_bytes_per_owner);
    info.max_entities = std::min(owner.max_entities, limits_.max_entities_per_owner);
    info.layers = count.layers;
    info.entities = count.entities;
    info.objects = count.objects;
    info.bytes = count.bytes;
    for (const auto& [name, layer] : owner.layers) info.orphaned_layers += layer.orphaned;
  }
  for (const auto& [id, session] : sessions) {
    ++infos[session.owner].sessions;
    infos[session.owner].client_names.push_back(session.options.client_name);
  }
  return infos;
}

void PlainCore::Tidy() {
  for (auto& [number, owner] : scene.owners) {
    const bool open = std::any_of(sessions.begin(), sessions.end(),
                                  [&](const auto& entry) { return entry.second.owner == number; });
    if (!open && owner.layers.empty()) owner.objects.clear();
  }
  std::erase_if(scene.owners, [&](const auto& entry) {
    const auto is_its = [&](const auto& other) { return other.second.owner == entry.first; };
    return entry.second.layers.empty() && !std::any_of(sessions.begin(), sessions.end(), is_its) &&
           !std::any_of(dormant.begin(), dormant.end(), is_its);
  });
  std::erase_if(owner_tokens,
                [&](const auto& entry) { return !scene.owners.contains(entry.second); });
}

}  // namespace voxeld::daemon::model
