// From a placed and coloured model to requests of the wire.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "gpu/affine.h"
#include "tools/voxelctl/import/model.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::voxelctl {

struct PackedSizes {
  uint64_t objects = 0, vertices = 0, indices = 0, bytes = 0;
};

using RequestSink = std::function<absl::Status(v1::StreamRequest)>;

// Defines `object`: geometry in pieces of about half a MiB (less if `limits` want it), each an
// object of its own, and an object of instances over them, last. So one SetTransform moves it all,
// and no message is bulky. Stops at the first error of `sink`. ResourceExhausted if
// limits.max_parts_per_object is too small for so many pieces.
absl::StatusOr<PackedSizes> PackObject(const Model& model, const std::string& object,
                                       const v1::Limits& limits, const RequestSink& sink);

// The entity that draws `object`.
v1::StreamRequest InstanceRequest(const std::string& layer, const std::string& id,
                                  const std::string& object, const std::string& label,
                                  const gpu::Affine& transform);

v1::StreamRequest TransformRequest(const std::string& layer, const std::string& id,
                                   const gpu::Affine& transform);

}  // namespace voxeld::voxelctl
