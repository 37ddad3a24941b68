// Whether triangles close a mesh, so that it has an inside.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

namespace voxeld::daemon::wire {

// Two vertices, and how many triangles have the edge between them.
struct OpenEdge {
  uint32_t first, second;
  uint32_t triangles;  // odd
};

// The first edge, by its least vertex, that an odd number of triangles has; none if the mesh is closed. Vertices at one
// position are one, and an edge between them is none. positions: x y z by vertex; indices: three a triangle, each of a
// vertex; without any, vertices three by three. Time and memory in proportion to both, but for sorting vertices if indices
// alone do not close it.
std::optional<OpenEdge> FindOpenEdge(std::span<const float> positions,
                                     std::span<const uint32_t> indices);

}  // namespace voxeld::daemon::wire
