#include "tests/conformance/memory_case.h"

namespace voxeld::gpu::conformance {

MemoryCase MeasuredEngine() {
  return {.engine = {"cpu", [](EngineOptions options) { return CreateEngine(options); }},
          .drawables = 1000,
          .dots = 100'000};
}

uint64_t DeviceBytes() { return 0; }

}  // namespace voxeld::gpu::conformance
