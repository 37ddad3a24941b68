#include "gpu/engine.h"

#include <atomic>

#include "gpu/cpu/cpu_engine.h"
#include "gpu/worker/worker_engine.h"

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
      return options.in_worker ? CreateWorkerEngine(options, "asked for")
                               : CreateCpuEngine(options, "asked for");
    case EngineKind::kCuda:
      return CreateWorkerEngine(options, "asked for");
    case EngineKind::kAuto: {
      EngineOptions cuda = options;
      cuda.kind = EngineKind::kCuda;
      // The loss of one that never came is nobody's.
      const auto came = std::make_shared<std::atomic<bool>>(false);
      if (options.lost) {
        cuda.lost = [came, lost = options.lost](const absl::Status& status) {
          if (*came) lost(status);
        };
      }
      absl::StatusOr<std::unique_ptr<Engine>> engine =
          CreateWorkerEngine(cuda, "there is a GPU that it can use");
      if (engine.ok()) {
        *came = true;
        return engine;
      }
      EngineOptions cpu = options;
      cpu.kind = EngineKind::kCpu;
      const std::string why(engine.status().message());
      return options.in_worker ? CreateWorkerEngine(cpu, why) : CreateCpuEngine(cpu, why);
    }
  }
  return absl::InvalidArgumentError("engine: the kind must be auto, cpu or cuda");
}

}  // namespace voxeld::gpu
