// Small triangles as runs of columns, and those into a tile's words, in the widest vectors that the processor has; the same
// bytes in all.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "gpu/assemble/bin_item.h"
#include "gpu/assemble/small_triangle.h"
#include "gpu/assemble/span_kernel.h"
#include "gpu/assemble/tile_rows.h"
#include "gpu/assemble/triangle_runs.h"

namespace voxeld::gpu {

// Appends the runs of `triangles` to `memory`, the `part`-th (below 2²⁰), and to `found` an item for each of their faces in
// each of the tiles with owned[tile] != 0 that it may reach. Then `triangles` has none.
void FindTriangles(SmallTriangles& triangles, uint32_t part, const WalkGrid& grid,
                   const uint8_t* owned, TriangleMemory& memory, FoundSpans& found);

// Raises `words` of the tile that begins at voxel lo and ends before hi (the volume may end in it), axes as in WalkGrid, to
// those of such items; items of count 0 are left out. The rows that it may have reached join `touched`.
void DrawTriangles(std::span<const TriangleMemory> parts, std::span<const BinItem> items,
                   const int32_t lo[3], const int32_t hi[3], uint32_t* words, TileRows& touched);

// The instruction set in use.
std::string TriangleTarget();

}  // namespace voxeld::gpu
