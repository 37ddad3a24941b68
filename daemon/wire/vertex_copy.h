// Converts and checks arrays of a primitive while copying them, so that each byte is read once.
#pragma once

#include <cstdint>
#include <limits>
#include <span>

#include "daemon/wire/payload.h"

namespace voxeld::daemon::wire {

// Bounds of positions along each axis. Invalid if the positions were refused.
struct PositionBounds {
  float least[3], greatest[3];
};

// Each function copies a payload of exactly out.size() elements (three values per position) to
// `out`. Returns: false if a value is not allowed; `out` then contains the input as far as
// possible.
bool CopyFloatPositions(const Payload& in, std::span<float> out, PositionBounds* bounds);  // finite
bool CopyInt32Positions(const Payload& in, std::span<float> out, PositionBounds* bounds);  // ±2²⁴
void CopyInt16Positions(const Payload& in, std::span<float> out, PositionBounds* bounds);
bool CopyIndices32(const Payload& in, uint32_t vertex_count, std::span<uint32_t> out);
bool CopyIndices16(const Payload& in, uint32_t vertex_count, std::span<uint32_t> out);
// Converts r g b to 0x00RRGGBB. If `element_bytes` is 4, a fourth byte is ignored.
void CopyColors(const Payload& in, size_t element_bytes, std::span<uint32_t> out);

inline constexpr int32_t kGreatestI32 = 1 << 24;  // larger floats cannot represent every integer

}  // namespace voxeld::daemon::wire
