#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "gpu/cpu/executor.h"
#include "gpu/generate/cpu_kernel.h"
#include "gpu/generate/generator.h"

namespace voxeld::gpu::generate {
namespace {

// The number of voxels that justifies another thread.
constexpr uint64_t kTaskVoxels = 64 << 10;
// The bytes that a core's own cache may still hold for the next reader.
constexpr uint64_t kCachedBytes = 4 << 20;

class CpuGenerator final : public Generator {
 public:
  explicit CpuGenerator(int threads) : executor_(MakeExecutor(threads)) {}

  std::string name() const override { return "cpu"; }

  absl::StatusOr<Plan> Prepare(const Batch& batch, Format format) override {
    return MakePlan(batch, format, *executor_);
  }

  absl::Status Generate(const Batch& batch, const Plan& plan, Format format,
                        std::span<std::byte> out) override {
    if (absl::Status status = CheckPlan(plan, batch); !status.ok()) return status;
    if (absl::Status status = CheckRoom(plan.extent, format, out.size()); !status.ok())
      return status;
    Emit(batch, plan, format, 0, plan.voxels(), out.data());
    return absl::OkStatus();
  }

  absl::Status Stream(const Batch& batch, const Plan& plan, Format format, uint64_t chunk_voxels,
                      const TakeChunk& take) override {
    if (absl::Status status = CheckPlan(plan, batch); !status.ok()) return status;
    if (absl::Status status = CheckForm(plan.extent, format); !status.ok()) return status;
    if (absl::Status status = CheckChunk(chunk_voxels); !status.ok()) return status;
    const uint64_t all = plan.voxels();
    chunk_voxels = std::min(chunk_voxels, all / kChunkGrain * kChunkGrain + kChunkGrain);
    if (chunk_.size() < std::min(chunk_voxels, all) * BytesOf(format.output)) {
      chunk_.resize(std::min(chunk_voxels, all) * BytesOf(format.output));
    }
    for (uint64_t first = 0; first < all; first += chunk_voxels) {
      const uint64_t count = std::min(chunk_voxels, all - first);
      Emit(batch, plan, format, first, count, chunk_.data());
      absl::Status taken = take(first, {chunk_.data(), count * BytesOf(format.output)});
      if (!taken.ok()) return taken;
    }
    return absl::OkStatus();
  }

 private:
  void Emit(const Batch& batch, const Plan& plan, Format format, uint64_t first, uint64_t count,
            std::byte* out) {
    const bool past_caches = count * BytesOf(format.output) > kCachedBytes;
    const auto threads = static_cast<uint64_t>(executor_->concurrency());
    if (threads == 1 || count < 2 * kTaskVoxels) {
      return EmitVoxels(batch, format, plan.offsets, first, count, past_caches, out);
    }
    // Make a few tasks per thread, in case threads are not equally fast.
    const uint64_t tasks = std::min(count / kTaskVoxels, threads * 4);
    const uint64_t each = (count / tasks + 15) / 16 * 16;  // whole lines of memory
    executor_->For(tasks, 1, [&](size_t task, int) {
      const uint64_t begin = std::min(count, task * each);
      const uint64_t end = task + 1 == tasks ? count : std::min(count, begin + each);
      EmitVoxels(batch, format, plan.offsets, first + begin, end - begin, past_caches,
                 out + begin * BytesOf(format.output));
    });
  }

  const std::unique_ptr<Executor> executor_;
  std::vector<std::byte> chunk_;  // used by Stream
};

}  // namespace

absl::StatusOr<HostMemory> Generator::Allocate(size_t bytes) {
  return HostMemory(new std::byte[bytes], [](std::byte* memory) { delete[] memory; });
}

std::unique_ptr<Generator> MakeCpuGenerator(int threads) {
  return std::make_unique<CpuGenerator>(threads);
}

absl::Status CheckChunk(uint64_t chunk_voxels) {
  if (chunk_voxels > 0 && chunk_voxels % kChunkGrain == 0) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrFormat("a chunk of %d voxels; it must be a multiple of %d, and at least that",
                      chunk_voxels, kChunkGrain));
}

}  // namespace voxeld::gpu::generate
