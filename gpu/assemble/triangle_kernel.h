// Small triangles into a tile's words, in the widest vectors that the processor has; the same bytes in all.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "gpu/assemble/bin_item.h"
#include "gpu/assemble/small_triangle.h"
#include "gpu/assemble/tile_rows.h"

namespace voxeld::gpu {

// Raises `words` of the tile that begins at voxel lo and ends before hi (the volume may end in it), axes as in WalkGrid, to
// those of triangles[item]; items of count 0 are left out. The rows that it may have reached join `touched`.
void DrawTriangles(const SmallTriangle* triangles, std::span<const BinItem> items,
                   const int32_t lo[3], const int32_t hi[3], uint32_t* words, TileRows& touched);

// The instruction set in use.
std::string TriangleTarget();

}  // namespace voxeld::gpu
