// A worker that fails as VOXELD_TEST_FAULT says: WHAT:N, at the n-th frame; crash, exit or hang.
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <string>

#include "gpu/cpu/cpu_engine.h"
#include "gpu/worker/process.h"
#include "gpu/worker/worker_server.h"

namespace voxeld::gpu {
namespace {

void Fail(const std::string& what) {
  if (what == "crash") std::raise(SIGSEGV);
  if (what == "exit") _exit(0);
  for (;;) pause();
}

int Main() {
  BecomeWorker();
  const char* fault = std::getenv("VOXELD_TEST_FAULT");
  const std::string text = fault == nullptr ? "" : fault;
  const size_t colon = text.find(':');
  WorkerHooks hooks;
  hooks.make_engine = [](const EngineOptions& options) -> absl::StatusOr<std::unique_ptr<Engine>> {
    return CreateCpuEngine(options, "");
  };
  if (colon != std::string::npos) {
    hooks.before_frame = [what = text.substr(0, colon),
                          at = std::stoull(text.substr(colon + 1))](uint64_t frame) {
      if (frame == at) Fail(what);
    };
  }
  ServeEngines(kWorkerSocket, hooks);
}

}  // namespace
}  // namespace voxeld::gpu

int main() { return voxeld::gpu::Main(); }
