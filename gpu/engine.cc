#include "gpu/engine.h"

#include "gpu/cpu/cpu_engine.h"

namespace voxeld::gpu {

const char* EngineKindName(EngineKind kind) {
  switch (kind) {
    case EngineKind::kAuto:
      return "auto";
    case EngineKind::kCpu:
      return "cpu";
    case EngineKind::kCuda:
      return "cuda";
  }
  return "unknown";
}

absl::StatusOr<std::unique_ptr<Engine>> CreateEngine(const EngineOptions& options) {
  switch (options.kind) {
    case EngineKind::kCpu:
      return CreateCpuEngine(options, "asked for");
    case EngineKind::kCuda:
      return absl::FailedPreconditionError("this build has no CUDA engine");
    case EngineKind::kAuto:
      return CreateCpuEngine(options, "this build has no CUDA engine");
  }
  return absl::InvalidArgumentError("engine: the kind must be auto, cpu or cuda");
}

}  // namespace voxeld::gpu
