// voxeld-engine: an engine in a process of its own. It is started by its owner, or by a service
// manager for a connection to its socket, and never by hand.
#include <sys/socket.h>

#include <cstdio>

#include "absl/status/status.h"
#include "common/memory/out_of_memory.h"
#include "gpu/cpu/cpu_engine.h"
#include "gpu/worker/no_cuda_engine.h"
#include "gpu/worker/process.h"
#include "gpu/worker/worker_server.h"
#if defined(VOXELD_HAVE_CUDA)
#include "gpu/cuda/cuda_engine.h"
#include "gpu/cuda/pin.h"
#endif

namespace voxeld::gpu {
namespace {

absl::StatusOr<std::unique_ptr<Engine>> MakeEngine(const EngineOptions& options) {
  if (options.kind == EngineKind::kCpu) return CreateCpuEngine(options, "");
#if defined(VOXELD_HAVE_CUDA)
  return CreateCudaEngine(options, "");
#else
  return NoCudaEngine(GpuIsVisible());
#endif
}

int Main() {
  int type = 0;
  socklen_t size = sizeof(type);
  if (getsockopt(kWorkerSocket, SOL_SOCKET, SO_TYPE, &type, &size) != 0 || type != SOCK_SEQPACKET) {
    std::fprintf(stderr, "voxeld-engine is started by voxeld, not by hand\n");
    return 2;
  }
  BecomeWorker();
  WorkerHooks hooks;
  hooks.make_engine = MakeEngine;
#if defined(VOXELD_HAVE_CUDA)
  hooks.pin = cuda::PinMemory;
  hooks.unpin = cuda::UnpinMemory;
  hooks.pin_read_only = cuda::PinReadOnlyMemory;
#endif
  ServeEngines(kWorkerSocket, hooks);
}

}  // namespace
}  // namespace voxeld::gpu

int main() {
  voxeld::ExitWhenOutOfMemory();
  return voxeld::gpu::Main();
}
