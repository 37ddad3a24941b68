#include "tools/bench/frame/cuda_machine.h"

namespace voxeld::bench::frame {

absl::StatusOr<std::unique_ptr<gpu::Engine>> MakeCudaEngine(const gpu::EngineOptions&, bool) {
  return absl::FailedPreconditionError(
      "--engine cuda: this program was built without CUDA; give cpu");
}

void PinFrame(std::span<std::byte>) {}
void UnpinFrame(std::span<std::byte>) {}

absl::StatusOr<std::unique_ptr<Ceiling>> DeviceToHostCeiling(size_t) {
  return MakeCudaEngine({}, false).status();
}

absl::StatusOr<std::unique_ptr<Ceiling>> DeviceCopyCeiling(size_t) {
  return MakeCudaEngine({}, false).status();
}

}  // namespace voxeld::bench::frame
