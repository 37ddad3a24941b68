// The generator's kernels. As in kernels.h, each function queues in `stream` and returns whether
// that succeeded.
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <cstdint>

#include "gpu/generate/batch.h"
#include "gpu/generate/segment.h"
#include "gpu/generate/stride.h"

namespace voxeld::gpu::cuda {

// The number of voxels that one thread makes in a walk, that a warp makes at a time, and that a
// block makes at most.
inline constexpr uint32_t kGenerateRun = 4;
inline constexpr uint32_t kGenerateRound = 32 * kGenerateRun;
inline constexpr uint32_t kGenerateWarps = 8;  // per block

// The rounds of each warp: a few voxels are shared by many warps; of many voxels each warp makes so
// many that finding where to start costs little.
inline constexpr uint32_t kGenerateMostRounds = 32;
inline uint32_t GenerateRounds(uint64_t voxels) {
  if (voxels < uint64_t{4} << 20) return 1;
  return voxels < uint64_t{64} << 20 ? 8 : kGenerateMostRounds;
}

struct StepRecord {
  uint64_t step_fraction;
  uint32_t whole, step_whole;
  uint32_t fraction;    // of S, its high 32 bits: the fraction has 16
  uint32_t bias;        // of a walk
  uint64_t round_step;  // of a walk, from the end of a thread's run to the start of its next
};

// The data of a segment that most of its voxels need.
struct alignas(16) SegmentRecord {
  StepRecord axis[3];
  uint32_t steps;
};

// A batch in device memory.
struct GenerateView {
  const generate::FixedSegment* segments = nullptr;
  const uint64_t* offsets = nullptr;   // segments + 1
  SegmentRecord* records = nullptr;    // segments
  uint32_t* first_segments = nullptr;  // of each warp's first voxel, and of the last voxel
  uint64_t voxels = 0;
  uint32_t count = 0;       // segments, at least 1
  uint32_t rounds = 1;      // of each warp: GenerateRounds(voxels)
  uint32_t most_steps = 0;  // the maximum over all segments

  uint64_t warp_voxels() const { return uint64_t{rounds} * kGenerateRound; }
  uint64_t warps() const { return (voxels + warp_voxels() - 1) / warp_voxels(); }
};

// Fills `first_segments`, and `records` for samplings that have steps.
cudaError_t PrepareGenerate(const GenerateView& view, generate::Sampling sampling,
                            cudaStream_t stream);

// Writes voxels [first, first + count) to `out`. Requires: `first` is a multiple of
// kGenerateMostRounds·kGenerateRound, and `out` is aligned to 16 bytes.
cudaError_t Generate(const GenerateView& view, generate::Format format, uint64_t first,
                     uint64_t count, void* out, cudaStream_t stream);

}  // namespace voxeld::gpu::cuda
