// What clients are told of an entity or a layer of a snapshot. Reentrant.
#pragma once

#include <string>

#include "daemon/core/core.h"
#include "daemon/scene/snapshot.h"

namespace voxeld::daemon {

EntityInfo InfoOf(const OwnedName& layer, const std::string& id, const Entity& entity);
LayerInfo InfoOf(const OwnedName& key, const Layer& layer);

}  // namespace voxeld::daemon
