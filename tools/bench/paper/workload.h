// The batches that are measured; they are the same for one seed on every machine.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "gpu/generate/batch.h"
#include "tools/bench/paper/tables.h"

namespace voxeld::bench::paper {

struct Workload {
  std::string table;  // "2", "3", "4", "4 skewed", "4 packed"
  std::vector<gpu::generate::Segment<double>> segments;
  uint64_t voxels = 0;
  gpu::generate::Format format;
  // The paper's times, if it has such a row.
  std::optional<std::array<double, kMachines>> paper_ms;
};

// Returns `count` EUCLIDEAN segments of `voxels` voxels each, in random directions from random
// places.
Workload OneLength(const std::string& table, uint64_t count, uint64_t voxels, uint64_t seed);
// Returns the batch of Table 4: lengths of 0.05 to 1.95 times the mean, `total` voxels together.
Workload Different(uint64_t total, uint64_t seed);
// Returns one segment with nine tenths of the voxels, and 1,023 that share the rest.
Workload Skewed(uint64_t total, uint64_t seed);
// Returns segments between random places in 2048×2048×1024 voxels, four bytes per voxel.
Workload Packed(uint64_t total, uint64_t seed);

}  // namespace voxeld::bench::paper
