// The reference for the line scenes: a plain loop over each line that writes its voxels directly
// into the volume. It is compiled for the processor of the build machine (-march=native), so its
// source includes nothing whose functions other sources share.
#pragma once

#include <cstddef>
#include <cstdint>

namespace voxeld::bench::frame {

// Draws lines [begin, end) into a volume of nx × ny × … voxels, x fastest. Each line has two
// vertices of three floats, all inside the volume. Voxel ⌊S + (E−S)·k/N⌋ in single precision, for k
// = 0..N, takes the colour of the line's first vertex; N is the greatest distance of the ends'
// voxels on an axis. Single precision may end up to one voxel below 0 on an axis.
// Requires: room for PlainLinesRoom() voxels before `volume`. Several threads may write to one
// volume.
constexpr size_t PlainLinesRoom(size_t nx, size_t ny) { return nx * ny + nx + 1; }
void DrawPlainLines(const float* positions, const uint32_t* colors, size_t begin, size_t end,
                    int nx, int ny, uint32_t* volume);

}  // namespace voxeld::bench::frame
