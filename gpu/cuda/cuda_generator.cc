#include "gpu/cuda/cuda_generator.h"

#include <algorithm>
#include <atomic>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::gpu::cuda {

using generate::Batch;
using generate::BytesOf;
using generate::FixedSegment;
using generate::Format;
using generate::kChunkGrain;
using generate::Plan;

absl::StatusOr<std::unique_ptr<CudaGenerator>> CudaGenerator::Open(int device, int threads) {
  absl::StatusOr<std::unique_ptr<Device>> opened = Device::Open(device);
  if (!opened.ok()) return opened.status();
  std::unique_ptr<CudaGenerator> made(new CudaGenerator(*std::move(opened), MakeExecutor(threads)));
  for (Slot& slot : made->slots_) {
    for (cudaEvent_t* event : {&slot.made, &slot.copied}) {
      absl::Status status = made->device_->api().Call("cudaEventCreateWithFlags", [&] {
        return cudaEventCreateWithFlags(event, cudaEventDisableTiming);
      });
      if (!status.ok()) return status;
    }
  }
  return made;
}

CudaGenerator::~CudaGenerator() {
  cudaStreamSynchronize(device_->copies());
  if (!staging_.empty()) FreePinned(staging_);
  for (Slot& slot : slots_) {
    if (slot.made != nullptr) cudaEventDestroy(slot.made);
    if (slot.copied != nullptr) cudaEventDestroy(slot.copied);
    if (!slot.pinned.empty()) FreePinned(slot.pinned);
  }
}

absl::StatusOr<Plan> CudaGenerator::Prepare(const Batch& batch, Format format) {
  return MakePlan(batch, format, *executor_);
}

absl::StatusOr<PlacedBatch> CudaGenerator::Place(const Batch& batch, const Plan& plan) {
  PlacedBatch placed;
  if (absl::Status status = CheckPlan(plan, batch); !status.ok()) return status;
  if (absl::Status status = device_->api().Enter(); !status.ok()) return status;
  placed.extent_ = plan.extent;
  placed.view_.voxels = plan.voxels();
  placed.view_.count = static_cast<uint32_t>(batch.size());
  if (batch.size() == 0) return placed;
  if (absl::Status status = Settled(PlaceOn(batch, plan, placed)); !status.ok()) return status;
  return placed;
}

absl::Status CudaGenerator::Settled(absl::Status status) {
  if (status.ok()) return status;
  cudaStreamSynchronize(device_->stream());
  cudaStreamSynchronize(device_->copies());
  return status;
}

absl::Status CudaGenerator::PlaceOn(const Batch& batch, const Plan& plan, PlacedBatch& placed) {
  const size_t segment_bytes = batch.size() * sizeof(FixedSegment);
  const size_t offset_bytes = plan.offsets.size() * sizeof(uint64_t);
  if (absl::Status status = Reserve(staging_, segment_bytes + offset_bytes); !status.ok())
    return status;
  auto* const fixed = reinterpret_cast<FixedSegment*>(staging_.data());
  auto* const staged_offsets = reinterpret_cast<uint64_t*>(staging_.data() + segment_bytes);
  staged_offsets[0] = plan.offsets[0];
  std::atomic<uint64_t> most_steps = 0;
  batch.With([&](const auto& segments) {
    constexpr size_t kGrain = 16384;
    executor_->For((segments.size() + kGrain - 1) / kGrain, 1, [&](size_t part, int) {
      const size_t end = std::min(segments.size(), (part + 1) * kGrain);
      uint64_t most = 0;
      for (size_t i = part * kGrain; i < end; ++i) {
        fixed[i] = ToFixed(segments[i]);
        staged_offsets[i + 1] = plan.offsets[i + 1];
        most = std::max(most, plan.offsets[i + 1] - plan.offsets[i] - 1);
      }
      uint64_t known = most_steps;
      while (known < most && !most_steps.compare_exchange_weak(known, most)) {
      }
    });
  });
  placed.view_.most_steps = static_cast<uint32_t>(most_steps);
  placed.view_.rounds = GenerateRounds(plan.voxels());
  auto segments = device_->Upload(fixed, batch.size());
  auto offsets = device_->Upload(staged_offsets, plan.offsets.size());
  auto records = device_->pool().Acquire(plan.extent.format.sampling == generate::Sampling::kCover
                                             ? 1
                                             : batch.size() * sizeof(SegmentRecord));
  auto first_segments = device_->pool().Acquire((placed.view_.warps() + 1) * sizeof(uint32_t));
  for (const auto* block : {&segments, &offsets, &records, &first_segments}) {
    if (!block->ok()) return block->status();
  }
  placed.segments_ = *std::move(segments);
  placed.offsets_ = *std::move(offsets);
  placed.records_ = *std::move(records);
  placed.first_segments_ = *std::move(first_segments);
  placed.view_.segments = placed.segments_.as<FixedSegment>();
  placed.view_.offsets = placed.offsets_.as<uint64_t>();
  placed.view_.records = placed.records_.as<SegmentRecord>();
  placed.view_.first_segments = placed.first_segments_.as<uint32_t>();
  absl::Status status = device_->Run("PrepareGenerate", [&] {
    return PrepareGenerate(placed.view_, plan.extent.format.sampling, device_->stream());
  });
  return status.ok() ? device_->Wait() : status;  // the next batch uses the staging memory
}

absl::Status CudaGenerator::QueueOnDevice(const PlacedBatch& batch, Format format,
                                          std::span<std::byte> out) {
  if (absl::Status status = CheckRoom(batch.extent_, format, out.size()); !status.ok())
    return status;
  if (reinterpret_cast<uintptr_t>(out.data()) % 16 != 0) {
    return absl::InvalidArgumentError(
        "the output in device memory does not begin at a multiple of 16 bytes");
  }
  if (absl::Status status = device_->api().Enter(); !status.ok()) return status;
  if (batch.voxels() == 0) return absl::OkStatus();
  return device_->Run("Generate", [&] {
    return cuda::Generate(batch.view_, format, 0, batch.voxels(), out.data(), device_->stream());
  });
}

absl::Status CudaGenerator::GenerateOnDevice(const PlacedBatch& batch, Format format,
                                             std::span<std::byte> out) {
  if (absl::Status status = QueueOnDevice(batch, format, out); !status.ok()) return status;
  return device_->Wait();
}

absl::Status CudaGenerator::Ready(Slot& slot, size_t bytes, bool pinned) {
  if (slot.voxels.size() < bytes) {
    slot.voxels = Block();
    absl::StatusOr<Block> block = device_->pool().Acquire(bytes);
    if (!block.ok()) return block.status();
    slot.voxels = *std::move(block);
  }
  return pinned ? Reserve(slot.pinned, bytes) : absl::OkStatus();
}

absl::Status CudaGenerator::Reserve(std::span<std::byte>& pinned, size_t bytes) {
  if (pinned.size() >= bytes) return absl::OkStatus();
  if (!pinned.empty()) FreePinned(std::exchange(pinned, {}));
  absl::StatusOr<std::span<std::byte>> memory = AllocatePinned(bytes);
  if (!memory.ok()) return memory.status();
  pinned = *memory;
  return absl::OkStatus();
}

absl::Status CudaGenerator::Queue(Slot& slot, const PlacedBatch& batch, Format format,
                                  uint64_t first, uint64_t count, std::byte* to) {
  Api& api = device_->api();
  absl::Status status = api.Call("Generate", [&] {
    return cuda::Generate(batch.view_, format, first, count, slot.voxels.as<void>(),
                          device_->stream());
  });
  if (!status.ok()) return status;
  const cudaStream_t copies = device_->copies();
  status =
      api.Call("cudaEventRecord", [&] { return cudaEventRecord(slot.made, device_->stream()); });
  if (!status.ok()) return status;
  status =
      api.Call("cudaStreamWaitEvent", [&] { return cudaStreamWaitEvent(copies, slot.made, 0); });
  if (!status.ok()) return status;
  status = api.Call("cudaMemcpyAsync", [&] {
    return cudaMemcpyAsync(to, slot.voxels.as<void>(), count * BytesOf(format.output),
                           cudaMemcpyDeviceToHost, copies);
  });
  if (!status.ok()) return status;
  return api.Call("cudaEventRecord", [&] { return cudaEventRecord(slot.copied, copies); });
}

absl::Status CudaGenerator::WaitFor(cudaEvent_t event) {
  return device_->api().Call("cudaEventSynchronize", [&] { return cudaEventSynchronize(event); });
}

absl::Status CudaGenerator::GenerateToHost(const PlacedBatch& batch, Format format,
                                           std::span<std::byte> out) {
  const uint64_t all = batch.voxels();
  const size_t bytes = BytesOf(format.output);
  if (absl::Status status = CheckRoom(batch.extent_, format, out.size()); !status.ok())
    return status;
  if (absl::Status status = device_->api().Enter(); !status.ok()) return status;
  const uint64_t chunk = std::min(kChunkVoxels, all);
  for (Slot& slot : slots_) {
    if (absl::Status status = Ready(slot, chunk * bytes, false); !status.ok()) return status;
  }
  absl::Status status;
  for (uint64_t i = 0, first = 0; first < all && status.ok(); ++i, first += chunk) {
    Slot& slot = slots_[i % kSlots];
    // The device, not this thread, waits for the slot's last copy.
    status = device_->api().Call("cudaStreamWaitEvent", [&] {
      return cudaStreamWaitEvent(device_->stream(), slot.copied, 0);
    });
    if (!status.ok()) break;
    status =
        Queue(slot, batch, format, first, std::min(chunk, all - first), out.data() + first * bytes);
  }
  // On any failure, nothing writes to the output after this returns.
  absl::Status waited = device_->api().Call(
      "cudaStreamSynchronize", [&] { return cudaStreamSynchronize(device_->copies()); });
  return status.ok() ? waited : Settled(status);
}

absl::Status CudaGenerator::StreamFrom(const PlacedBatch& batch, Format format,
                                       uint64_t chunk_voxels, const generate::TakeChunk& take) {
  if (absl::Status status = generate::CheckChunk(chunk_voxels); !status.ok()) return status;
  if (absl::Status status = CheckForm(batch.extent_, format); !status.ok()) return status;
  if (absl::Status status = device_->api().Enter(); !status.ok()) return status;
  const uint64_t all = batch.voxels();
  chunk_voxels = std::min(chunk_voxels, all / kChunkGrain * kChunkGrain + kChunkGrain);
  const size_t bytes = BytesOf(format.output);
  const uint64_t chunks = (all + chunk_voxels - 1) / chunk_voxels;
  for (Slot& slot : slots_) {
    absl::Status status = Ready(slot, std::min(chunk_voxels, all) * bytes, true);
    if (!status.ok()) return status;
  }
  const auto count_of = [&](uint64_t i) { return std::min(chunk_voxels, all - i * chunk_voxels); };
  absl::Status status;
  for (uint64_t i = 0; i < chunks + kSlots && status.ok(); ++i) {
    Slot& slot = slots_[i % kSlots];
    if (i >= kSlots) {
      const uint64_t done = i - kSlots;
      if (done >= chunks) break;
      status = WaitFor(slot.copied);
      if (status.ok())
        status = take(done * chunk_voxels, slot.pinned.first(count_of(done) * bytes));
    }
    if (status.ok() && i < chunks)
      status = Queue(slot, batch, format, i * chunk_voxels, count_of(i), slot.pinned.data());
  }
  return Settled(status);
}

absl::Status CudaGenerator::Generate(const Batch& batch, const Plan& plan, Format format,
                                     std::span<std::byte> out) {
  if (absl::Status status = CheckRoom(plan.extent, format, out.size()); !status.ok()) return status;
  absl::StatusOr<PlacedBatch> placed = Place(batch, plan);
  if (!placed.ok()) return placed.status();
  return GenerateToHost(*placed, format, out);
}

absl::StatusOr<generate::HostMemory> CudaGenerator::Allocate(size_t bytes) {
  if (absl::Status status = device_->api().Enter(); !status.ok()) return status;
  absl::StatusOr<std::span<std::byte>> memory = AllocatePinned(bytes);
  if (!memory.ok()) return memory.status();
  return generate::HostMemory(memory->data(), [](std::byte* at) { cudaFreeHost(at); });
}

absl::Status CudaGenerator::Stream(const Batch& batch, const Plan& plan, Format format,
                                   uint64_t chunk_voxels, const generate::TakeChunk& take) {
  absl::StatusOr<PlacedBatch> placed = Place(batch, plan);
  if (!placed.ok()) return placed.status();
  return StreamFrom(*placed, format, chunk_voxels, take);
}

absl::StatusOr<std::span<std::byte>> AllocatePinned(size_t bytes) {
  void* memory = nullptr;
  if (const cudaError_t error = cudaMallocHost(&memory, bytes); error != cudaSuccess) {
    return absl::ResourceExhaustedError(
        absl::StrCat(bytes, " bytes of pinned memory: ", cudaGetErrorString(error)));
  }
  return std::span(static_cast<std::byte*>(memory), bytes);
}

void FreePinned(std::span<std::byte> memory) { cudaFreeHost(memory.data()); }

}  // namespace voxeld::gpu::cuda
