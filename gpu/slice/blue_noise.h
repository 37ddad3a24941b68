// Blue noise by void and cluster (Ulichney, "The void-and-cluster method for dither array generation", 1993).
#pragma once

#include <array>
#include <cstdint>

#include "gpu/slice/quantize.h"

namespace voxeld::gpu {

// Returns kNoiseRanks ranks (quantize.h), row-major, each once: the pixels of rank below n are as
// evenly distributed as n pixels can be, around the edges too. The ranks are always the same; the
// first call in a process computes them.
const std::array<uint16_t, kNoiseRanks>& BlueNoise();

}  // namespace voxeld::gpu
