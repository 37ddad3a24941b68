// How much memory an engine takes for what it draws, so that a scene can be refused before anything is made.
#pragma once

#include <cstddef>
#include <cstdint>

#include "gpu/records.h"

namespace voxeld::gpu {

// Bytes that the C library's allocator takes for a block of `bytes`: a header, a multiple of 16, 32 at least; 0 for none.
constexpr uint64_t HeapBytes(uint64_t bytes) {
  if (bytes == 0) return 0;
  const uint64_t block = (bytes + 8 + 15) / 16 * 16;
  return block < 32 ? 32 : block;
}

// Of a drawable without vertices: its record, its places in indexes, and the smallest lists (checked in assemble/scene.cc).
inline constexpr uint64_t kMostDrawableBytes = 1200;

// At most so many bytes does an engine hold of one drawable of this geometry. Not among them are lists of tiles, what curves are cut
// into, and lists of items, which EngineOptions::index_bytes bounds.
constexpr uint64_t MostDerivedBytes(const GeometryRecord& geometry) {
  return kMostDrawableBytes + HeapBytes(uint64_t{geometry.vertex_count} * 3 * sizeof(int32_t));
}

}  // namespace voxeld::gpu
