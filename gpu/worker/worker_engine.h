// An engine in a process of its own, as its owner sees it: the ordinary door, across which calls go
// by messages and bulk data by shared memory. What goes wrong over there, a fault of the GPU say,
// ends in DataLoss here.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "gpu/engine.h"
#include "gpu/rank_link.h"
#include "gpu/worker/worker_staging.h"

namespace voxeld::gpu {

// Starts the program, unless options.workers has one for that GPU, and waits until its engine is
// there, at most options.worker_deadline_ns (for the first CUDA context, ten times that). `reason`:
// for EngineInfo. FailedPrecondition if the program or the engine cannot be had.
//
// Contract, beyond gpu/engine.h's: a call whose answer does not come within worker_deadline_ns (and
// 4 ns for each byte that goes with it), and every call after the process has ended, ends in
// DataLoss; the process is killed and never waited for. Answers come on a thread of the engine's.
absl::StatusOr<std::unique_ptr<Engine>> CreateWorkerEngine(const EngineOptions& options,
                                                           std::string reason);

// One of several that make a display together (gpu/ranks).
class RankWorker : public Engine {
 public:
  // RankLink's, over there. Joining may take as long as a first answer.
  virtual void Invite(const std::string& library,
                      std::function<void(absl::StatusOr<RankLink::Invitation>)> done) = 0;
  virtual void Join(const std::string& library, const RankLink::Invitation& invitation, int rank,
                    int ranks, Done done) = 0;
  // Ends the process soon: all that is owed, and every later call, ends in `why`, a DataLoss.
  virtual void GiveUp(const absl::Status& why) = 0;
  // Ends the connection: all that is owed is answered, Cancelled, before it returns, and so is every
  // later call. Not from the engine's own thread.
  virtual void Close() = 0;
};

// The same as a rank: with a process of its own, and staging that it shares with the others. Does not
// wait: `opened` is told, once, whether its engine is there; after an error all calls end in
// DataLoss. options.inline_execution is not looked at.
absl::StatusOr<std::unique_ptr<RankWorker>> CreateRankWorker(
    const EngineOptions& options, std::shared_ptr<WorkerStaging> staging,
    std::function<void(const absl::Status&)> opened);

// Whether a DataLoss says that no answer came in time: the engine may have been slow, not faulty.
bool IsLate(const absl::Status& status);

}  // namespace voxeld::gpu
