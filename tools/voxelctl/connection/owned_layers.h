// Layers by owner: finds what earlier commands left, and removes it as far as the caller may.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/connection/connection.h"

namespace voxeld::voxelctl {

// A layer of the scene, and its owner.
struct OwnedLayer {
  uint64_t owner = 0;
  std::string layer;
};

struct TakenDown {
  uint64_t entities = 0, layers = 0;
  std::vector<OwnedLayer> stay;  // others' layers that the caller lacks the scope to remove
};

// Returns whether the layer was left by a voxelctl command that has ended. Layers that replay and
// pipe keep may have any name.
bool IsLeftByVoxelctl(const v1::LayerInfo& layer);
// Returns the layers that were left by commands whose session was called `client_name`.
absl::StatusOr<std::vector<OwnedLayer>> LayersLeftBy(absl::string_view client_name,
                                                     Connection& connection);

// Removes these layers; one that no longer exists counts as removed. Owner 0 is skipped, because it
// would mean all owners.
absl::StatusOr<TakenDown> TakeDown(const std::vector<OwnedLayer>& layers, Connection& connection);

// Returns a sentence about layers that stay; empty if none does. Escaped for a terminal.
std::string OthersStay(const std::vector<OwnedLayer>& stay);

// Returns whether the call was refused only because the caller lacks the scope control.
bool TakesControl(const absl::Status& status);

}  // namespace voxeld::voxelctl
