// Drawing on the CPU: from a drawable to its items in tiles, and to the voxels of a tile.
#pragma once

#include <cstdint>
#include <span>

#include "gpu/affine.h"
#include "gpu/assemble/scene.h"
#include "gpu/cpu/executor.h"
#include "gpu/primitives/grid.h"

namespace voxeld::gpu {

// Fills in what is derived: vertices, source. `view`: scene → voxel space.
void MapDrawable(Drawable& drawable, const Affine& view, const TileGrid& grid, Executor& executor,
                 uint64_t inside_bytes = UINT64_MAX);
// Finds what is inside of a mesh that is filled, and mapped, if that is not there and takes no more than so many bytes.
// True if it has.
bool FillIn(Drawable& drawable, uint64_t inside_bytes, Executor& executor);
// The same, and bins. `owned[tile]`: 0 leaves the tile out.
void PrepareDrawable(Drawable& drawable, const Affine& view, const TileGrid& grid,
                     std::span<const uint8_t> owned, Executor& executor);

// Of a drawable that is prepared: a solid whose map has no inverse. It draws nothing.
bool IsSingular(const Drawable& drawable);

// Raises `words` (kTileVoxels) of the tile in `box` to what these items of its bins cover.
void DrawItems(const Drawable& drawable, std::span<const BinItem> items, const TileGrid& grid,
               const Box3& box, uint32_t* words);
// The same of `bins`, which may be others than its own; the rows that it may have reached join `touched`.
void DrawItems(const Drawable& drawable, const Bins& bins, std::span<const BinItem> items,
               const TileGrid& grid, const Box3& box, uint32_t* words, TileRows& touched);
// Soon these will be drawn: brings what they need near, as far as that is worth it.
void FetchItems(const Drawable& drawable, std::span<const BinItem> items);

}  // namespace voxeld::gpu
