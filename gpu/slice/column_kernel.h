// Columns of pixels, in the processor's widest vectors; the bytes are the same for all widths.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "gpu/slice/levels.h"

namespace voxeld::gpu {

inline constexpr size_t kChunkRows = 64;   // of a column, processed together
inline constexpr size_t kBlockWords = 16;  // a chunk's voxels come in four runs
inline constexpr size_t kChunkPlanes = 4;  // bases, rises of red, green and blue
inline constexpr size_t kChunkBytes = kChunkPlanes * kChunkRows;
inline constexpr size_t kColumnsTogether = 32;

// Converts the colours (interleaved, gpu/word.h) of a chunk's rows to levels, plane after plane.
// With `also`, the greater colour of both counts.
struct ChunkToLevel {
  const uint32_t* words[kChunkRows / kBlockWords];
  const uint32_t* also[kChunkRows / kBlockWords];  // all null, or none of them
  uint8_t* levels;                                 // kChunkBytes
};
void LevelChunks(const LevelTables& tables, std::span<const ChunkToLevel> chunks);

// Draws slice images from levels, row-major, one after another. `levels` is ordered by slice image;
// in each, chunk c of column u has the number c · columns + u; null: dark. The number of columns is
// a multiple of kColumnsTogether. `dither`: DitherColumn of u % 8. `out`: chunks · kChunkRows rows
// of `columns` bytes for each slice image.
void DrawRgb332(std::span<const uint8_t* const> levels, size_t columns, size_t chunks,
                const uint64_t (&dither)[8], uint8_t* out);

// Returns the name of the instruction set in use.
std::string ColumnTarget();

}  // namespace voxeld::gpu
