// Encodes the core's results as messages of the protocol. Reentrant.
#pragma once

#include <vector>

#include "daemon/core/core.h"

namespace voxeld::v1 {
class ClearLayerResponse;
class DisplayDescription;
class EntityInfo;
class EntityKey;
class Issue;
class LayerInfo;
class Limits;
class ListEntitiesResponse;
class ListOwnersResponse;
class Opened;
class OwnerInfo;
class Receipt;
class Stats;
class VolumeHeader;
}  // namespace voxeld::v1

namespace voxeld::daemon::wire {

// Encodes everything except the server's own fields: version, time, limits.
void Encode(const SessionInfo& in, v1::Opened* out);
void Encode(const OwnerInfo& in, v1::OwnerInfo* out);
void Encode(const std::vector<OwnerInfo>& in, v1::ListOwnersResponse* out);
void Encode(const Issue& in, v1::Issue* out);
void Encode(const Receipt& in, v1::Receipt* out);
void Encode(const Limits& in, v1::Limits* out);
void Encode(const EntityKey& in, v1::EntityKey* out);
void Encode(const EntityInfo& in, v1::EntityInfo* out);
void Encode(const LayerInfo& in, v1::LayerInfo* out);
void Encode(const EntityPage& in, v1::ListEntitiesResponse* out);
void Encode(const Cleared& in, v1::ClearLayerResponse* out);
void Encode(const Stats& in, v1::Stats* out);
void Encode(const DisplayDescription& in, v1::DisplayDescription* out);

// Encodes the header of a captured volume; its slices follow unchanged.
void Encode(const DisplayDescription& display, const display::DecodedVolume& volume,
            v1::VolumeHeader* out);

}  // namespace voxeld::daemon::wire
