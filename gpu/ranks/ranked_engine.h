// One display over several GPUs of one host: an engine made of ranks, each the engine of one GPU, in a
// process of its own, with its share of the slices. To its owner it is an engine like any other.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "gpu/engine.h"

namespace voxeld::gpu {

// A rank for each of options.devices (two at least). Waits until all are there, and linked, unless
// options.wait_until_ready says otherwise; `reason`: for EngineInfo, which also says how what comes
// reaches the GPUs. InvalidArgument for numbers that cannot be, FailedPrecondition, with the rank and
// its GPU, if one cannot be had. Where the ranks cannot be linked (no NCCL) each is sent everything
// by itself.
//
// Contract, beyond gpu/engine.h's and gpu/worker/worker_engine.h's:
// - A call is done when all ranks have done it. Staging is written once: all ranks map it.
// - What one rank refuses all refuse, with nothing changed. Where they differ (memory that runs out
//   on one GPU in the middle of a call), and where one is lost, all are: their processes are ended,
//   and EngineOptions::lost is told once, when the last has gone.
// - FrameResult: `changed` if one says so, `packed_as_drawn` if all do; times are those of the rank
//   that took longest; `singular_drawables` is every rank's; the rest are sums. A voxel counts once,
//   but a tile as often as ranks draw it.
absl::StatusOr<std::unique_ptr<Engine>> CreateRankedEngine(const EngineOptions& options,
                                                           std::string reason);

// Whether a DataLoss says that some GPU of a display had no memory for what the others did: none is
// faulty, and nothing in the scene is.
bool IsOutOfMemory(const absl::Status& status);
inline constexpr char kOutOfMemoryPayload[] = "voxeld.dev/out-of-memory";

}  // namespace voxeld::gpu
