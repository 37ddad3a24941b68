// The program that hoist.h produces, read in place. As words: HoistedHeader; for each hoisted value
// the slot that it is left in (hoisted values are ordered by axis); instructions, two words each,
// of the three axes and of the rest, in which Op::kHoisted stands for a value.
#pragma once

#include "gpu/implicit/program.h"

namespace voxeld::gpu::implicit {

inline constexpr uint32_t kMostHoisted = 16;
inline constexpr uint32_t kMostHoistedOfAxis = 8;

struct HoistedHeader {
  uint32_t end[3] = {};             // of each axis' hoisted values; the first axis' begin at 0
  uint32_t axis[3] = {}, rest = 0;  // numbers of instructions
  uint32_t rest_slot = 0;
  uint32_t needs_coordinates = 0;  // 1: the rest uses x, y or z
};
inline constexpr uint32_t kHoistedWords = sizeof(HoistedHeader) / sizeof(uint32_t);

struct HoistedView {
  const uint32_t* words = nullptr;

  VOXELD_HD uint32_t begin(int axis) const { return axis == 0 ? 0 : words[axis - 1]; }
  VOXELD_HD uint32_t end(int axis) const { return words[axis]; }
  VOXELD_HD uint32_t count() const { return words[2]; }
  VOXELD_HD uint32_t axis_instructions(int axis) const { return words[3 + axis]; }
  VOXELD_HD uint32_t rest() const { return words[6]; }
  VOXELD_HD uint32_t rest_slot() const { return words[7]; }
  VOXELD_HD bool needs_coordinates() const { return words[8] != 0; }
  VOXELD_HD uint32_t slot(uint32_t value) const { return words[kHoistedWords + value]; }
  VOXELD_HD int axis_of(uint32_t value) const {
    return static_cast<int>(value >= words[0]) + static_cast<int>(value >= words[1]);
  }
  VOXELD_HD const uint32_t* axis_code(int axis) const {
    const uint32_t* code = words + kHoistedWords + count();
    for (int a = 0; a < axis; ++a) code += 2 * axis_instructions(a);
    return code;
  }
  VOXELD_HD const uint32_t* rest_code() const { return axis_code(3); }
};

}  // namespace voxeld::gpu::implicit
