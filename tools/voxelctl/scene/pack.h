// Converts a placed and coloured model to the client's objects.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/scene/volume.h"
#include "voxeld/client.h"

namespace voxeld::voxelctl {

struct PackedSizes {
  uint64_t objects = 0, vertices = 0, indices = 0, samples = 0, bytes = 0;
  std::string note;  // about left-out contents; usually empty
};

// Receives a definition: the object's name, its parts, and their approximate size in bytes.
using ObjectSink = std::function<absl::Status(const std::string& object,
                                              std::vector<client::Part> parts, uint64_t bytes)>;

// Defines `object`: geometry in pieces of about half a MiB (less if `limits` require it), each an
// object of its own, and last an object of instances of them. So one SetTransform moves everything,
// and no message is large except those of volumes (scene/volume.h). Stops at the first error of
// `sink`. Errors: ResourceExhausted if limits.max_parts_per_object is too small for so many pieces.
absl::StatusOr<PackedSizes> PackObject(const Model& model, const std::string& object,
                                       const client::Limits& limits, const ObjectSink& sink,
                                       const VolumeLook& look = {}, const AssetSink& upload = {});

}  // namespace voxeld::voxelctl
