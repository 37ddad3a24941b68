// Layers by their owners: what earlier commands left, and taking it away as far as the caller may.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/connection/connection.h"

namespace voxeld::voxelctl {

// A layer of the scene, and whose it is.
struct OwnedLayer {
  uint64_t owner = 0;
  std::string layer;
};

struct TakenDown {
  uint64_t entities = 0, layers = 0;
  std::vector<OwnedLayer> stay;  // others' layers, which the caller has not the scope to take down
};

// Whether the layer was left by a command of voxelctl that has ended: what replay and pipe keep has any name.
bool IsLeftByVoxelctl(const v1::LayerInfo& layer);
// Those that were left by commands whose session was called `client_name`.
absl::StatusOr<std::vector<OwnedLayer>> LayersLeftBy(absl::string_view client_name,
                                                     Connection& connection);

// Takes these away; one that has gone already is as good as taken. Owner 0 is left out: it would stand for all.
absl::StatusOr<TakenDown> TakeDown(const std::vector<OwnedLayer>& layers, Connection& connection);

// A sentence about layers that stay; nothing where none does. Fit for a terminal.
std::string OthersStay(const std::vector<OwnedLayer>& stay);

// Whether the call was refused for want of the scope control alone.
bool TakesControl(const absl::Status& status);

}  // namespace voxeld::voxelctl
