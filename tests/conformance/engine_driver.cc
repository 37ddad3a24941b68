#include "tests/conformance/engine_driver.h"

#include <cstring>
#include <optional>
#include <utility>

#include "display/sync/mutex.h"

namespace voxeld::gpu::conformance {
namespace {

// Waits for the answer of an asynchronous call.
template <typename T>
class Answer {
 public:
  auto Taker() {
    return [this](T value) {
      sync::MutexLock lock(mutex_);
      value_ = std::move(value);
      here_.NotifyOne();
    };
  }
  T Wait() {
    sync::MutexLock lock(mutex_);
    while (!value_) here_.Wait(mutex_);
    return *std::move(value_);
  }

 private:
  sync::Mutex mutex_;
  sync::CondVar here_;
  std::optional<T> value_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace

EngineDriver::EngineDriver(const EngineCase& engine_case, EngineOptions options) {
  absl::StatusOr<std::unique_ptr<Engine>> engine = engine_case.create(std::move(options));
  engine_ = std::move(engine).value();
}

absl::Status EngineDriver::SetTarget(const Target& target) {
  Answer<absl::Status> answer;
  engine_->SetTarget(target, answer.Taker());
  absl::Status status = answer.Wait();
  if (!status.ok()) return status;
  target_ = target;
  bytes_.assign(target.layout.bytes(), std::byte{0xA5});  // to be overwritten
  changed_in_.assign(target.layout.pictures(), 0);
  held_ = 0;
  return status;
}

absl::Status EngineDriver::ApplyBytes(std::span<const std::byte> delta,
                                      std::vector<BulkBlock> referred) {
  absl::StatusOr<StagingBlock> block = engine_->AcquireStaging(delta.size());
  if (!block.ok()) return block.status();
  if (!delta.empty()) std::memcpy(block->bytes().data(), delta.data(), delta.size());
  block->Refer(std::move(referred));
  Answer<absl::Status> answer;
  engine_->Apply(*std::move(block), delta.size(), answer.Taker());
  return answer.Wait();
}

absl::Status EngineDriver::Apply(const DeltaBuffer& delta) {
  return ApplyBytes(delta.bytes(), delta.referred());
}

absl::StatusOr<FrameResult> EngineDriver::Frame(const FrameRequest& request, FrameBuffer buffer) {
  Answer<absl::StatusOr<FrameResult>> answer;
  engine_->SubmitFrame(request, buffer, answer.Taker());
  return answer.Wait();
}

absl::StatusOr<FrameResult> EngineDriver::Frame() {
  absl::StatusOr<FrameResult> result =
      Frame({.frame = frame_ + 1, .buffer_holds = held_}, {bytes_, changed_in_});
  if (result.ok()) held_ = ++frame_;
  return result;
}

std::vector<uint32_t> EngineDriver::Voxels() {
  const display::VoxelGrid& grid = target_.geometry.grid;
  std::vector<uint32_t> voxels(static_cast<size_t>(grid.nx) * static_cast<size_t>(grid.ny) *
                               static_cast<size_t>(grid.nz));
  Answer<absl::Status> answer;
  engine_->ReadVoxels({0, 0, 0, grid.nx, grid.ny, grid.nz}, voxels, answer.Taker());
  const absl::Status status = answer.Wait();
  if (!status.ok()) voxels.clear();
  return voxels;
}

}  // namespace voxeld::gpu::conformance
