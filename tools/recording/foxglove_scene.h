// Converts a scene for viewers that support foxglove.SceneUpdate: lines, triangles and letters,
// transformed by the maps of entity and layer into the scene's own space (frame "voxeld").
//
//   segments, meshes, boxes, spheres, cylinders   as they are, round ones in facets
//   points                                        short lines along the axes, at most kMostPoints of an entity
//   instances                                     what their objects draw, to depth 8
//   text                                          as text that faces the viewer
//   everything else                               the name of its kind, at its place
#pragma once

#include <cstdint>

#include "tools/recording/scene_mirror.h"

namespace foxglove {
class SceneUpdate;
}

namespace voxeld::recording {

inline constexpr int kMostPoints = 5000;

// Writes what changed since the previous call into `out`, and replaces its contents.
void MakeSceneUpdate(SceneMirror& mirror, uint64_t time_ns, foxglove::SceneUpdate* out);

}  // namespace voxeld::recording
