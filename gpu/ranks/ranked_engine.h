// One display over several GPUs of one host. The engine consists of ranks, each the engine of one
// GPU, in a process of its own, with its share of the slices. To its owner it is an engine like any
// other.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "gpu/engine.h"

namespace voxeld::gpu {

// Creates a rank for each of options.devices (at least two). Waits until all have started and are
// linked, unless options.wait_until_ready is false. `reason` is for EngineInfo, which also says how
// deltas reach the GPUs. If the ranks cannot be linked (no NCCL), each is sent everything
// separately. Errors: InvalidArgument for invalid numbers; FailedPrecondition, with the rank and
// its GPU, if a GPU is not available.
//
// Contract, beyond gpu/engine.h's and gpu/worker/worker_engine.h's:
// - A call is done when all ranks have done it. Staging is written once: all ranks map it.
// - A call that one rank rejects is rejected by all, with nothing changed. If the ranks disagree
//   (one GPU runs out of memory in the middle of a call), or if one is lost, all are lost: their
//   processes are ended, and EngineOptions::lost is called once, when the last has gone.
// - FrameResult: `changed` if any rank says so, `packed_as_drawn` if all do; times are those of the
//   slowest rank; `singular_drawables` is the same for every rank; the rest are sums. A voxel
//   counts once, but a tile as often as ranks draw it.
absl::StatusOr<std::unique_ptr<Engine>> CreateRankedEngine(const EngineOptions& options,
                                                           std::string reason);

// Returns whether a DataLoss means that some GPU of a display had no memory for a call that others
// completed: then neither a GPU nor the scene is faulty.
bool IsOutOfMemory(const absl::Status& status);
inline constexpr char kOutOfMemoryPayload[] = "voxeld.dev/out-of-memory";

}  // namespace voxeld::gpu
