// Runs an accepted program on numbers, on intervals and hoisted: it reads and writes only its own
// memory, and intervals contain the numbers.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "gpu/implicit/formula_text.h"
#include "gpu/implicit/hoist.h"
#include "gpu/implicit/hoisted.h"
#include "gpu/implicit/interval.h"
#include "gpu/implicit/number.h"
#include "gpu/implicit/program.h"
#include "tests/fuzz/expect.h"

namespace voxeld::fuzz {

inline void Evaluate(std::span<const uint32_t> words, const float low[3], const float size[3],
                     float share) {
  using gpu::implicit::Interval;
  const gpu::implicit::ProgramView program{words.data()};
  constexpr float kVoxel = 0.125f;
  float at[3];
  Interval box[3];
  for (int i = 0; i < 3; ++i) {
    const float high = low[i] + size[i];
    at[i] = low[i] + share * size[i];
    if (!(at[i] >= low[i])) at[i] = low[i];
    if (!(at[i] <= high)) at[i] = high;
    box[i] = {low[i], high, false};
  }
  struct Part {
    const uint32_t* code;
    uint32_t count, slot;
  };
  for (const Part& part : {Part{program.surface_code(), program.surface(), program.surface_slot()},
                           Part{program.bound_code(), program.bound(), program.bound_slot()},
                           Part{program.color_code(), program.color(), program.color_slot(0)}}) {
    if (part.count == 0) continue;
    float numbers[gpu::implicit::kMostSlots];
    Interval intervals[gpu::implicit::kMostSlots];
    gpu::implicit::Run(part.code, part.count, at, kVoxel, numbers);
    gpu::implicit::Run(part.code, part.count, box, kVoxel, intervals);
    EXPECT_THAT_HOLDS(intervals[part.slot].Has(numbers[part.slot]), "the number ",
                      numbers[part.slot], " is not in [", intervals[part.slot].lo, ", ",
                      intervals[part.slot].hi, "]");
  }
  // The same operations in the same order, divided by axes.
  const uint32_t depends[3] = {1, 2, 4};
  const std::vector<uint32_t> parted = gpu::implicit::Hoist(program, depends);
  const gpu::implicit::HoistedView hoisted{parted.data()};
  std::vector<float> values(hoisted.count());
  for (int axis = 0; axis < 3; ++axis) {
    float slots[gpu::implicit::kMostSlots] = {};
    gpu::implicit::Run(hoisted.axis_code(axis), hoisted.axis_instructions(axis), at, kVoxel, slots);
    for (uint32_t value = hoisted.begin(axis); value < hoisted.end(axis); ++value) {
      values.at(value) = slots[hoisted.slot(value)];
    }
  }
  float slots[gpu::implicit::kMostSlots] = {}, direct[gpu::implicit::kMostSlots] = {};
  gpu::implicit::Run(hoisted.rest_code(), hoisted.rest(), at, kVoxel, slots,
                     [&](uint32_t value) { return values.at(value); });
  gpu::implicit::Run(program.surface_code(), program.surface(), at, kVoxel, direct);
  const float a = slots[hoisted.rest_slot()], b = direct[program.surface_slot()];
  EXPECT_THAT_HOLDS(gpu::implicit::IsNan(a) ? gpu::implicit::IsNan(b) : a == b, a, " hoisted, ", b,
                    " else");
  EXPECT_THAT_HOLDS(!gpu::implicit::FormulaText(parted).empty());
  EXPECT_THAT_HOLDS(gpu::implicit::FormulaKey(parted) == gpu::implicit::FormulaKey(parted));
  gpu::implicit::FormulaWeight(parted);
}

}  // namespace voxeld::fuzz
