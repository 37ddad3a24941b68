// The CUDA engine in this process, and its bus. Errors: FailedPrecondition in builds without CUDA.
#pragma once

#include <cstddef>
#include <memory>
#include <span>

#include "absl/status/statusor.h"
#include "gpu/engine.h"
#include "tools/bench/frame/ceiling.h"

namespace voxeld::bench::frame {

// With `keep_tiles`, slice images are sliced from tiles even if they could be packed while they are
// drawn.
absl::StatusOr<std::unique_ptr<gpu::Engine>> MakeCudaEngine(const gpu::EngineOptions& options,
                                                            bool keep_tiles);

// Pins a frame's buffer so that the device can write to it directly.
void PinFrame(std::span<std::byte> bytes);
void UnpinFrame(std::span<std::byte> bytes);

// Measures copying `bytes` from the device to pinned memory.
absl::StatusOr<std::unique_ptr<Ceiling>> DeviceToHostCeiling(size_t bytes);

// Measures copying `bytes` within the device's memory.
absl::StatusOr<std::unique_ptr<Ceiling>> DeviceCopyCeiling(size_t bytes);

}  // namespace voxeld::bench::frame
