// Applies pictures to triangles (voxeld.v1.Texture, and HeightMap's).
#pragma once

#include <span>
#include <string>

#include "daemon/wire/check.h"
#include "daemon/wire/context.h"

namespace voxeld::v1 {
class Texture;
}  // namespace voxeld::v1

namespace voxeld::daemon::wire {

// Applies the picture file at `path` to the triangles of `out`. Requires: they have no picture yet.
// `places` has two finite coordinates per vertex (gpu/primitives/texture.h).
MaybeFault AddPicture(const FieldPath& path, const std::string& picture,
                      std::span<const float> places, const DecodeContext& context,
                      GeometryData* out);

// Does the same for a mesh, from a message.
MaybeFault ToTexture(const FieldPath& path, const v1::Texture& in, const DecodeContext& context,
                     GeometryData* out);

}  // namespace voxeld::daemon::wire
