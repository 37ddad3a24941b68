// Blue noise by void and cluster (Ulichney, "The void-and-cluster method for dither array generation", 1993).
#pragma once

#include <array>
#include <cstdint>

#include "gpu/slice/quantize.h"

namespace voxeld::gpu {

// kNoiseRanks ranks (quantize.h), row-major, each once: the pixels of rank below n lie as evenly as n pixels can, around the
// edges too. Always the same; made when a process first asks.
const std::array<uint16_t, kNoiseRanks>& BlueNoise();

}  // namespace voxeld::gpu
