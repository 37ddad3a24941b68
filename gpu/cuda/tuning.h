// What only speed depends on. Tests choose otherwise, so that small scenes come by all ways.
#pragma once

#include <cstdint>

namespace voxeld::gpu::cuda {

struct Tuning {
  // A volume of fewer items is drawn as one group: copying its pictures while others are drawn is not
  // worth the launches.
  uint64_t few_items = 100'000;
};

}  // namespace voxeld::gpu::cuda
