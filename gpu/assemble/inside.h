// Which voxels are inside of triangles (primitives/filled.h), worked out once for all rows.
#pragma once

#include <cstdint>
#include <vector>

#include "gpu/cpu/executor.h"
#include "gpu/primitives/filled.h"

namespace voxeld::gpu {

// Voxels of the volume around a source's vertices. They are there (`vertices` is not null).
Box3 BoundsOfVertices(const Source& source, const TileGrid& grid);

// As InsideRows has them, of the box that is the source's bounds.
std::vector<uint32_t> FindInside(const Source& source, Executor& executor);

// Raises the words of a tile to `word` where its voxels, `box`, are inside.
void DrawInside(const Source& source, const Box3& box, const TileGrid& grid, uint32_t word,
                uint32_t* words);

}  // namespace voxeld::gpu
