// voxeld-engine with the real CUDA engine, whose GPU really faults when faults.h says so: the error
// that CUDA then reports is handled like any error of the device. VOXELD_FAULT_KIND: illegal (the
// default), or one of faulty_engine's.
#include <string>
#include <utility>

#include "gpu/cuda/cuda_engine.h"
#include "gpu/cuda/pin.h"
#include "gpu/worker/process.h"
#include "gpu/worker/worker_server.h"
#include "tests/gpu/worker/faults.h"
#include "tests/gpu/worker/illegal_address.h"

namespace voxeld::gpu {
namespace {

absl::Status FailOnGpu(const std::string& kind) {
  if (!kind.empty() && kind != "illegal") return Fail(kind);
  WriteToAnIllegalAddress();
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<Engine>> MakeEngine(const EngineOptions& options) {
  absl::StatusOr<std::unique_ptr<Engine>> engine = CreateCudaEngine(options, "");
  if (!engine.ok()) return engine;
  EngineInfo info = (*engine)->info();
  return MakeFaulty(*std::move(engine), std::move(info), FaultTrigger::FromEnvironment(),
                    FailOnGpu);
}

int Main() {
  BecomeWorker();
  WorkerHooks hooks;
  hooks.make_engine = MakeEngine;
  hooks.pin = cuda::PinMemory;
  hooks.unpin = cuda::UnpinMemory;
  ServeEngines(kWorkerSocket, hooks);
}

}  // namespace
}  // namespace voxeld::gpu

int main() { return voxeld::gpu::Main(); }
