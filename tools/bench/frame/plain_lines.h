// The peer of the line scenes: a plain loop over each line that writes its voxels where they lie. Compiled for the
// processor of the machine that builds it (-march=native), so its source includes nothing whose functions others share.
#pragma once

#include <cstddef>
#include <cstdint>

namespace voxeld::bench::frame {

// Lines [begin, end), two vertices of three floats each, all inside nx × ny × … voxels, x fastest: voxel ⌊S + (E−S)·k/N⌋
// in single precision for k = 0..N, N the greatest distance of the ends' voxels on an axis, takes the colour of the
// line's first vertex. Single precision may end up to one voxel below 0 on an axis: before `volume` there is room for
// PlainLinesRoom() voxels. Several threads may write into one volume.
constexpr size_t PlainLinesRoom(size_t nx, size_t ny) { return nx * ny + nx + 1; }
void DrawPlainLines(const float* positions, const uint32_t* colors, size_t begin, size_t end,
                    int nx, int ny, uint32_t* volume);

}  // namespace voxeld::bench::frame
