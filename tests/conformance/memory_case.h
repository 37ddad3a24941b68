// The engine whose memory memory_count_test.cc measures. A program that runs the test is linked with one of memory_case_*.cc.
#pragma once

#include <cstddef>
#include <cstdint>

#include "tests/conformance/engine_driver.h"

namespace voxeld::gpu::conformance {

struct MemoryCase {
  EngineCase engine;
  // The number of drawables up to which a scene is repeated, so that its memory is much more than the smallest measurable amount.
  size_t drawables = 0;
  // The number of drawables in a scene in which all share one small geometry, as instances do.
  size_t dots = 0;
  // The bytes that the engine may keep after a scene was removed.
  uint64_t kept_bytes = 0;
};

MemoryCase MeasuredEngine();

// Returns: the bytes in use on the engine's device, beside the process's own memory.
uint64_t DeviceBytes();

}  // namespace voxeld::gpu::conformance
