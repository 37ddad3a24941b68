// A scene for viewers that know foxglove.SceneUpdate: lines, triangles and letters, under the maps of entity
// and layer, in the scene's own space (frame "voxeld").
//
//   segments, meshes, boxes, spheres, cylinders   as they are, round ones in facets
//   points                                        short lines along the axes, at most kMostPoints of an entity
//   instances                                     what their objects draw, to depth 8
//   text                                          as text that faces the viewer
//   everything else                               its kind's name, where it stands
#pragma once

#include <cstdint>

#include "tools/recording/scene_mirror.h"

namespace foxglove {
class SceneUpdate;
}

namespace voxeld::recording {

inline constexpr int kMostPoints = 5000;

// What changed since the mirror was asked last, over whatever is in `out`.
void MakeSceneUpdate(SceneMirror& mirror, uint64_t time_ns, foxglove::SceneUpdate* out);

}  // namespace voxeld::recording
