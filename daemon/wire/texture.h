// Pictures on triangles (voxeld.v1.Texture, and HeightMap's).
#pragma once

#include <span>
#include <string>

#include "daemon/wire/check.h"
#include "daemon/wire/context.h"

namespace voxeld::v1 {
class Texture;
}  // namespace voxeld::v1

namespace voxeld::daemon::wire {

// Lays a picture, the file's bytes at `path`, over the triangles of `out`, which has none yet. places: two of each vertex
// (gpu/primitives/texture.h), finite.
MaybeFault AddPicture(const FieldPath& path, const std::string& picture,
                      std::span<const float> places, const DecodeContext& context,
                      GeometryData* out);

// The same by a message, for a mesh.
MaybeFault ToTexture(const FieldPath& path, const v1::Texture& in, const DecodeContext& context,
                     GeometryData* out);

}  // namespace voxeld::daemon::wire
