// Blue noise by void and cluster (Ulichney, "The void-and-cluster method for dither array generation", 1993).
#pragma once

#include <cstdint>
#include <vector>

namespace voxeld::gpu {

// kNoiseRanks ranks (quantize.h), row-major, each once: the pixels of rank below n lie as evenly as n pixels can, around the
// edges too. Always the same.
std::vector<uint16_t> MakeBlueNoise();

}  // namespace voxeld::gpu
