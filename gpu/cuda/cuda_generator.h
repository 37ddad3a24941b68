// The generator on CUDA: writes into device memory, or in chunks whose generation and copying
// overlap.
#pragma once

#include <cuda_runtime_api.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "gpu/cpu/executor.h"
#include "gpu/cuda/device.h"
#include "gpu/cuda/generate_kernels.h"
#include "gpu/generate/generator.h"

namespace voxeld::gpu::cuda {

// A batch that is on the device, ready for generation. Its generator must outlive it.
class PlacedBatch {
 public:
  uint64_t voxels() const { return extent_.voxels; }

 private:
  friend class CudaGenerator;
  generate::Extent extent_;
  Block segments_, offsets_, records_, first_segments_;
  GenerateView view_;
};

class CudaGenerator final : public generate::Generator {
 public:
  // `threads`: the CPU's threads that check batches. Errors: FailedPrecondition if the device or
  // the driver is missing.
  static absl::StatusOr<std::unique_ptr<CudaGenerator>> Open(int device, int threads);
  ~CudaGenerator() override;

  std::string name() const override { return "cuda"; }
  absl::StatusOr<generate::Plan> Prepare(const generate::Batch& batch,
                                         generate::Format format) override;
  // `out` may be any host memory; the device copies to pinned memory (AllocatePinned) at the rate
  // of the bus.
  absl::Status Generate(const generate::Batch& batch, const generate::Plan& plan,
                        generate::Format format, std::span<std::byte> out) override;
  absl::StatusOr<generate::HostMemory> Allocate(size_t bytes) override;
  // `take` receives chunks in pinned memory.
  absl::Status Stream(const generate::Batch& batch, const generate::Plan& plan,
                      generate::Format format, uint64_t chunk_voxels,
                      const generate::TakeChunk& take) override;

  // ---- device memory
  // Copies a batch to the device. Errors: ResourceExhausted if the device has too little memory.
  absl::StatusOr<PlacedBatch> Place(const generate::Batch& batch, const generate::Plan& plan);
  // Writes all voxels to device memory aligned to 16 bytes; done when it returns. Errors:
  // InvalidArgument if it is not aligned or is too small.
  absl::Status GenerateOnDevice(const PlacedBatch& batch, generate::Format format,
                                std::span<std::byte> out);
  // The same, queued in device().stream(): done when the stream has reached it; keep the batch
  // until then.
  absl::Status QueueOnDevice(const PlacedBatch& batch, generate::Format format,
                             std::span<std::byte> out);
  // The same, into host memory.
  absl::Status GenerateToHost(const PlacedBatch& batch, generate::Format format,
                              std::span<std::byte> out);
  absl::Status StreamFrom(const PlacedBatch& batch, generate::Format format, uint64_t chunk_voxels,
                          const generate::TakeChunk& take);

  Device& device() { return *device_; }

 private:
  // The number of chunks in progress.
  static constexpr size_t kSlots = 3;
  struct Slot {
    Block voxels;
    cudaEvent_t made = nullptr, copied = nullptr;
    std::span<std::byte> pinned;
  };

  CudaGenerator(std::unique_ptr<Device> device, std::unique_ptr<Executor> executor)
      : device_(std::move(device)), executor_(std::move(executor)) {}
  absl::Status Ready(Slot& slot, size_t bytes, bool pinned);
  static absl::Status Reserve(std::span<std::byte>& pinned, size_t bytes);
  // Generates a chunk and queues its copy to `to`.
  absl::Status Queue(Slot& slot, const PlacedBatch& batch, generate::Format format, uint64_t first,
                     uint64_t count, std::byte* to);
  absl::Status WaitFor(cudaEvent_t event);
  // Returns the same status; after an error, waits until no work is in progress.
  absl::Status Settled(absl::Status status);
  absl::Status PlaceOn(const generate::Batch& batch, const generate::Plan& plan,
                       PlacedBatch& placed);

  const std::unique_ptr<Device> device_;
  const std::unique_ptr<Executor> executor_;
  std::array<Slot, kSlots> slots_;
  std::span<std::byte> staging_;  // pinned: a batch on its way to the device
};

// Allocates host memory that devices copy to at the rate of the bus; FreePinned frees it.
absl::StatusOr<std::span<std::byte>> AllocatePinned(size_t bytes);
void FreePinned(std::span<std::byte> memory);

}  // namespace voxeld::gpu::cuda
