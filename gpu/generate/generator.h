// Turns batches of 3D segments into voxel coordinates: the paper's generator of primitives (its
// Fig. 1, its parametric method), on the CPU or on CUDA, with the same bytes.
//
//   auto generator = MakeCpuGenerator(threads);
//   auto plan = generator->Prepare(segments, {.sampling = Sampling::kThin});
//   std::vector<std::byte> out(plan->voxels() * BytesOf(Output::kI32x3));
//   generator->Generate(segments, *plan, {.sampling = Sampling::kThin}, out);
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "gpu/generate/batch.h"
#include "gpu/generate/plan.h"

namespace voxeld::gpu::generate {

// Receives the voxels from `first` on, which are valid only during the call. An error ends the work
// and becomes its result.
using TakeChunk = std::function<absl::Status(uint64_t first, std::span<const std::byte> voxels)>;

// Host memory of one size, freed with its pointer.
using HostMemory = std::unique_ptr<std::byte[], std::function<void(std::byte*)>>;

// Used by one thread at a time.
class Generator {
 public:
  // The default size of chunks: 24 MiB of i32x3.
  static constexpr uint64_t kChunkVoxels = uint64_t{2} << 20;

  virtual ~Generator() = default;

  // "cpu", "cuda", "auto".
  virtual std::string name() const = 0;

  // Checks the batch; errors as MakePlan's. The plan can be used repeatedly with this batch, this
  // format and any generator.
  virtual absl::StatusOr<Plan> Prepare(const Batch& batch, Format format) = 0;

  // Writes all voxels into the caller's memory, in the order of the segments. Errors:
  // InvalidArgument if it is too small. Any error before the first byte leaves the memory
  // untouched.
  virtual absl::Status Generate(const Batch& batch, const Plan& plan, Format format,
                                std::span<std::byte> out) = 0;

  // Returns memory that Generate fills faster than any other, if the generator has such memory; its
  // contents are undefined.
  virtual absl::StatusOr<HostMemory> Allocate(size_t bytes);

  // The same as Generate, but `chunk_voxels` (a multiple of 8,192) at a time, in order. Needs
  // memory only for a few chunks.
  virtual absl::Status Stream(const Batch& batch, const Plan& plan, Format format,
                              uint64_t chunk_voxels, const TakeChunk& take) = 0;
};

// Returns a generator that uses `threads` ≥ 1 threads of the CPU.
std::unique_ptr<Generator> MakeCpuGenerator(int threads);

inline constexpr uint64_t kChunkGrain = 8192;
// Checks the chunk size of a call of Stream. Errors: InvalidArgument if it is not a multiple of
// kChunkGrain.
absl::Status CheckChunk(uint64_t chunk_voxels);

}  // namespace voxeld::gpu::generate
