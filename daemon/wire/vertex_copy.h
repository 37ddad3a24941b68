// Arrays of a primitive, converted and checked while they are copied: each byte is read once.
#pragma once

#include <cstdint>
#include <limits>
#include <span>

#include "daemon/wire/payload.h"

namespace voxeld::daemon::wire {

// Of positions: bounds along each axis. Not to be looked at if they were refused.
struct PositionBounds {
  float least[3], greatest[3];
};

// Each copies a payload of exactly out.size() elements (positions: of three) to `out`. False: a
// value is not allowed; `out` holds what came all the same, where it can.
bool CopyFloatPositions(const Payload& in, std::span<float> out, PositionBounds* bounds);  // finite
bool CopyInt32Positions(const Payload& in, std::span<float> out, PositionBounds* bounds);  // ±2²⁴
void CopyInt16Positions(const Payload& in, std::span<float> out, PositionBounds* bounds);
bool CopyIndices32(const Payload& in, uint32_t vertex_count, std::span<uint32_t> out);
bool CopyIndices16(const Payload& in, uint32_t vertex_count, std::span<uint32_t> out);
// r g b, and a fourth byte that is ignored if `element_bytes` is 4, to 0x00RRGGBB.
void CopyColors(const Payload& in, size_t element_bytes, std::span<uint32_t> out);

inline constexpr int32_t kGreatestI32 = 1 << 24;  // beyond it floats skip integers

}  // namespace voxeld::daemon::wire
