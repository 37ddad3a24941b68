// How much memory an engine takes for what it draws, so that a scene can be rejected before
// anything is allocated.
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "gpu/records.h"

namespace voxeld::gpu {

// Returns: the bytes that the C library's allocator uses for a block of `bytes`, its header
// included: a multiple of 16, at least 32.
constexpr uint64_t HeapBytes(uint64_t bytes) {
  if (bytes == 0) return 0;
  const uint64_t block = (bytes + 8 + 15) / 16 * 16;
  return block < 32 ? 32 : block;
}

// Returns: the bytes of the vector's block, unused capacity included.
template <typename Vector>
uint64_t VectorBytes(const Vector& vector) {
  return HeapBytes(vector.capacity() * sizeof(vector[0]));
}

// Returns: the bytes of the slots of an Abseil hash map or set, with a control byte for each.
template <typename Map>
uint64_t HashBytes(const Map& map) {
  using Slot = typename std::remove_cvref_t<Map>::value_type;
  // NOLINTNEXTLINE(bugprone-sizeof-expression): a set may hold pointers
  return HeapBytes(map.capacity() * (sizeof(Slot) + 1));
}

// An upper bound for a drawable without vertices: its record, its entries in indexes, and the
// smallest lists (assemble/scene.cc checks it). The CPU takes about 930 bytes; a GPU takes 1,300 on
// the host, and 1,300 on the device.
inline constexpr uint64_t kMostDrawableBytes = 2800;

// Returns: an upper bound of the bytes that an engine holds for one drawable of this geometry.
// Lists of tiles and items, and the pieces of curves, do not count: EngineOptions::index_bytes
// bounds those for all drawables together.
constexpr uint64_t MostDerivedBytes(const GeometryRecord& geometry) {
  return kMostDrawableBytes + HeapBytes(uint64_t{geometry.vertex_count} * 3 * sizeof(int32_t));
}

}  // namespace voxeld::gpu
