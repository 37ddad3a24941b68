// A batch that has been looked through: where each segment's voxels go, and that all is as it may be.
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

// What a plan says of all its voxels together.
struct Extent {
  Format format;
  uint64_t voxels = 0;
  Voxel lo, hi;  // both included; none: 0
};

struct Plan {
  // Voxels of segment i: offsets[i] to offsets[i + 1] − 1, from S on (COVER: from the
  // lexicographically smaller end on).
  std::vector<uint64_t> offsets;
  Extent extent;

  uint64_t voxels() const { return extent.voxels; }
};

// InvalidArgument names the segment, the coordinate, its value and what may be: a coordinate that is no
// number or beyond ±kMostCoordinate, a segment beyond kMostSteps, bounds that `format.output` cannot
// hold, more than kMostVoxels or kMostSegments. The first of several.
absl::StatusOr<Plan> MakePlan(const Batch& batch, Format format, Executor& executor);

// InvalidArgument if the plan is not of that batch.
absl::Status CheckPlan(const Plan& plan, const Batch& batch);
// InvalidArgument if what was planned has another sampling, if `format.output` cannot hold it, or if `bytes` are
// too few for it.
absl::Status CheckRoom(const Extent& extent, Format format, size_t bytes);
absl::Status CheckForm(const Extent& extent, Format format);

}  // namespace voxeld::gpu::generate
