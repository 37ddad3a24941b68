// A stand-in for voxeld-engine that fails when faults.h says so, without a GPU: when CUDA is
// requested, it is the CPU engine under another name. VOXELD_FAULT_KIND: crash (the default), exit,
// hang, dataloss, exhausted. It also lies when liar.h says so.
#include <cstdlib>
#include <string>
#include <utility>

#include "gpu/cpu/cpu_engine.h"
#include "gpu/worker/process.h"
#include "gpu/worker/worker_server.h"
#include "tests/gpu/worker/faults.h"
#include "tests/gpu/worker/liar.h"

namespace voxeld::gpu {
namespace {

absl::StatusOr<std::unique_ptr<Engine>> MakeEngine(const EngineOptions& options) {
  std::unique_ptr<Engine> engine = CreateCpuEngine(options, "");
  EngineInfo info = engine->info();
  if (options.kind == EngineKind::kCuda) info = {EngineKind::kCuda, "a GPU that faults", ""};
  return MakeFaulty(std::move(engine), std::move(info), FaultTrigger::FromEnvironment(), Fail,
                    MakeFaultyLink());
}

int Main() {
  BecomeWorker();
  WorkerHooks hooks;
  hooks.make_engine = MakeEngine;
  const char* const lie = std::getenv("VOXELD_FAULT_LIE");
  ServeEngines(lie != nullptr && *lie != 0 ? ServeThroughALiar(kWorkerSocket, lie) : kWorkerSocket,
               hooks);
}

}  // namespace
}  // namespace voxeld::gpu

int main() { return voxeld::gpu::Main(); }
