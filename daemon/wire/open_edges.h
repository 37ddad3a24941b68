// Determines whether triangles form a closed mesh with an inside.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

namespace voxeld::daemon::wire {

// Two vertices, and the number of triangles that share the edge between them.
struct OpenEdge {
  uint32_t first, second;
  uint32_t triangles;  // odd
};

// Returns: the first edge, by its least vertex, that belongs to an odd number of triangles, or
// nothing if the mesh is closed. Vertices at the same position are equal, and an edge between them
// is ignored. `positions` has x y z per vertex. `indices` has three vertices per triangle; if it is
// empty, consecutive vertices form triangles. Time and memory are proportional to both, except for
// sorting vertices if indices alone do not close the mesh.
std::optional<OpenEdge> FindOpenEdge(std::span<const float> positions,
                                     std::span<const uint32_t> indices);

}  // namespace voxeld::daemon::wire
