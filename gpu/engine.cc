#include "gpu/engine.h"

#include <atomic>
#include <exception>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "gpu/cpu/cpu_engine.h"
#include "gpu/ranks/ranked_engine.h"
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

namespace {

absl::StatusOr<std::unique_ptr<Engine>> InWorkers(EngineOptions options, std::string reason) {
  if (options.devices.size() > 1) return CreateRankedEngine(options, std::move(reason));
  if (!options.devices.empty()) options.device = options.devices[0];
  return CreateWorkerEngine(options, std::move(reason));
}

absl::StatusOr<std::unique_ptr<Engine>> OnCpu(const EngineOptions& options, std::string reason) {
  if (options.in_worker) return InWorkers(options, std::move(reason));
  try {
    return CreateCpuEngine(options, std::move(reason));
  } catch (const std::exception& error) {
    return absl::ResourceExhaustedError(
        absl::StrCat("no thread or memory for an engine: ", error.what()));
  }
}

}  // namespace

absl::StatusOr<std::unique_ptr<Engine>> CreateEngine(const EngineOptions& options) {
  switch (options.kind) {
    case EngineKind::kCpu:
      return OnCpu(options, "asked for");
    case EngineKind::kCuda:
      return InWorkers(options, "asked for");
    case EngineKind::kAuto: {
      EngineOptions cuda = options;
      cuda.kind = EngineKind::kCuda;
      // Do not report the loss of an engine that never started.
      const auto came = std::make_shared<std::atomic<bool>>(false);
      if (options.lost) {
        cuda.lost = [came, lost = options.lost](const absl::Status& status) {
          if (*came) lost(status);
        };
      }
      absl::StatusOr<std::unique_ptr<Engine>> engine =
          InWorkers(cuda, "there is a GPU that it can use");
      if (engine.ok()) {
        *came = true;
        return engine;
      }
      EngineOptions cpu = options;
      cpu.kind = EngineKind::kCpu;
      cpu.devices.clear();
      return OnCpu(cpu, std::string(engine.status().message()));
    }
  }
  return absl::InvalidArgumentError("engine: the kind must be auto, cpu or cuda");
}

}  // namespace voxeld::gpu
