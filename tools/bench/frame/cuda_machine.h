// The CUDA engine in this process, and its bus; FailedPrecondition in builds without CUDA.
#pragma once

#include <cstddef>
#include <memory>
#include <span>

#include "absl/status/statusor.h"
#include "gpu/engine.h"
#include "tools/bench/frame/ceiling.h"

namespace voxeld::bench::frame {

// keep_tiles: pictures are sliced from tiles also where they could be packed as they are drawn.
absl::StatusOr<std::unique_ptr<gpu::Engine>> MakeCudaEngine(const gpu::EngineOptions& options,
                                                            bool keep_tiles);

// A frame's buffer that the device writes directly.
void PinFrame(std::span<std::byte> bytes);
void UnpinFrame(std::span<std::byte> bytes);

// That many bytes from the device to pinned memory.
absl::StatusOr<std::unique_ptr<Ceiling>> DeviceToHostCeiling(size_t bytes);

// That many bytes within the device's memory.
absl::StatusOr<std::unique_ptr<Ceiling>> DeviceCopyCeiling(size_t bytes);

}  // namespace voxeld::bench::frame
