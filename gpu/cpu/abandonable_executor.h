// Parallel loops that another thread can abort, so that a daemon that stops does not wait for a
// long draw.
#pragma once

#include <atomic>
#include <memory>

#include "gpu/cpu/executor.h"

namespace voxeld::gpu {

// Returns an executor that runs loops on `executor`. Once `*abandoned` is true, For throws
// std::runtime_error before the next index.
std::unique_ptr<Executor> MakeAbandonableExecutor(
    std::unique_ptr<Executor> executor, std::shared_ptr<const std::atomic<bool>> abandoned);

}  // namespace voxeld::gpu
