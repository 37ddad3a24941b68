// Columns of pixels in the processor's widest vectors; the same bytes in all.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "gpu/slice/levels.h"

namespace voxeld::gpu {

inline constexpr size_t kChunkRows = 64;   // of a column, worked on together
inline constexpr size_t kBlockWords = 16;  // a chunk's voxels come in four runs
inline constexpr size_t kChunkPlanes = 4;  // bases, rises of red, green and blue
inline constexpr size_t kChunkBytes = kChunkPlanes * kChunkRows;
inline constexpr size_t kColumnsTogether = 32;

// Colours (interleaved, gpu/word.h) of a chunk's rows → its levels, plane after plane. Where there is `also`, the greater
// of both.
struct ChunkToLevel {
  const uint32_t* words[kChunkRows / kBlockWords];
  const uint32_t* also[kChunkRows / kBlockWords];  // all null, or none
  uint8_t* levels;                                 // kChunkBytes
};
void LevelChunks(const LevelTables& tables, std::span<const ChunkToLevel> chunks);

// Pictures from levels, row-major, one after another. `levels`: picture by picture; of each, chunk c of column u is
// number c · columns + u; null: dark. Columns are a multiple of kColumnsTogether. `dither`: DitherColumn of u % 8.
// `out`: chunks · kChunkRows rows of `columns` bytes a picture.
void DrawRgb332(std::span<const uint8_t* const> levels, size_t columns, size_t chunks,
                const uint64_t (&dither)[8], uint8_t* out);

// The instruction set in use.
std::string ColumnTarget();

}  // namespace voxeld::gpu
