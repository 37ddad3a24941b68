// A validated batch: its coordinates are valid, and the place of each segment's voxels is known.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "gpu/cpu/executor.h"
#include "gpu/generate/batch.h"

namespace voxeld::gpu::generate {

inline constexpr uint64_t kMostVoxels = uint64_t{1} << 40;  // of a batch
inline constexpr size_t kMostSegments = size_t{1} << 27;

// The common properties of a plan's voxels.
struct Extent {
  Format format;
  uint64_t voxels = 0;
  Voxel lo, hi;  // both included; 0 without voxels
};

struct Plan {
  // The voxels of segment i have the numbers offsets[i] to offsets[i + 1] − 1, from S on (COVER:
  // from the lexicographically smaller end on).
  std::vector<uint64_t> offsets;
  Extent extent;

  uint64_t voxels() const { return extent.voxels; }
};

// Errors: InvalidArgument names the first invalid segment, the coordinate, its value and what is
// valid. Invalid are a coordinate that is NaN or beyond ±kMostCoordinate, a segment of more than
// kMostSteps, bounds that `format.output` cannot hold, and more than kMostVoxels or kMostSegments.
absl::StatusOr<Plan> MakePlan(const Batch& batch, Format format, Executor& executor);

// Errors: InvalidArgument if the plan does not belong to that batch.
absl::Status CheckPlan(const Plan& plan, const Batch& batch);
// Errors: InvalidArgument if the plan has another sampling, if `format.output` cannot hold its
// voxels, or if `bytes` are too few for them.
absl::Status CheckRoom(const Extent& extent, Format format, size_t bytes);
absl::Status CheckForm(const Extent& extent, Format format);

}  // namespace voxeld::gpu::generate
